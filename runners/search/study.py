"""The study: trials proposed, run and told, in a journal beside the run or in a storage that machines share.

A batch of trials is asked before any of it is run, and told in the order of its numbers once all of it has
run. What the sampler sees is therefore the same for any number of workers, and for a study that was killed: its
unfinished trials keep their parameters and are run again.
"""

from __future__ import annotations

import socket
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any, NamedTuple

from lme.errors import InputError
from runners.config.space import Space
from runners.records import launch_record
from runners.search.samplers import Search, per_trial
from runners.workers.trials import Score

if TYPE_CHECKING:
    import optuna
    from optuna.storages import BaseStorage
    from optuna.trial import FrozenTrial

JOURNAL = "study.journal"
IDENTITY, CONFIGURATIONS, OWNER, SCORES = "identity", "configurations", "owner", "scores"
# What is done with the result, or how long is searched, is no part of what a study is.
_NOT_SEARCHED = ("trials", "runs", "held_out", "name", "storage", "study")


class Proposal(NamedTuple):
    """A trial that is to be run: its number and its values by dotted config key."""

    number: int
    values: dict[str, float]


class Trial(NamedTuple):
    """A trial that has been told. scores: one per configuration, in their order."""

    number: int
    reward: float
    values: dict[str, float]
    scores: list[Score]


class Study:
    """The trials of one search. Only one process works on a run directory; others may share the storage."""

    def __init__(self, study: optuna.Study, space: Space, owner: str, flush: Callable[[], None]) -> None:
        self._study = study
        self._space = space
        self._owner = owner
        self._flush = flush

    @property
    def told(self) -> list[Trial]:
        """Finished trials by number."""
        return [_trial(trial) for trial in self._in_state("COMPLETE")]

    @property
    def best(self) -> float | None:
        """The best reward so far."""
        return max(self._rewards(), default=None)

    @property
    def num_elsewhere(self) -> int:
        """Trials in flight on other machines."""
        owners = [trial.user_attrs.get(OWNER, self._owner) for trial in self._in_state("RUNNING")]
        return sum(owner != self._owner for owner in owners)

    def room(self, total: int, batch: int) -> int:
        """How many trials to ask next: a batch, or what is left of `total`."""
        taken = len(self._in_state("COMPLETE")) + self.num_elsewhere
        return max(min(batch, total - taken), 0)

    def ask(self, count: int) -> list[Proposal]:
        """New trials."""
        proposals = [self._proposal(self._study.ask()) for _ in range(count)]
        self._flush()
        return proposals

    def unfinished(self) -> list[Proposal]:
        """Trials asked by this run directory but not told: it was killed."""
        import optuna

        mine = [t for t in self._in_state("RUNNING") if t.user_attrs.get(OWNER) == self._owner]
        return [self._proposal(optuna.trial.Trial(self._study, trial._trial_id)) for trial in mine]

    def scored(self, number: int) -> bool:
        """Whether every episode of a trial that is not told yet has been run."""
        return SCORES in self._frozen(number).user_attrs

    def keep(self, number: int, scores: Sequence[Score]) -> None:
        """Note how a trial went, before it is told."""
        attributes = [list(score) for score in scores]
        self._study._storage.set_trial_user_attr(self._frozen(number)._trial_id, SCORES, attributes)
        self._flush()

    def tell(self, number: int) -> None:
        """Tell the mean reward of a trial that has been kept."""
        scores = [Score(*score) for score in self._frozen(number).user_attrs[SCORES]]
        self._study.tell(number, fmean(score.reward for score in scores))
        self._flush()

    def settle(self, name: str, value: Any) -> Any:
        """An attribute of the whole study: `value` where it has none yet, else the one that it has."""
        if name not in self._study.user_attrs:
            self._study.set_user_attr(name, value)
            self._flush()
        return self._study.user_attrs[name]

    def importances(self) -> dict[str, float]:
        """Share of each parameter in what tells the best tenth of trials from the rest; {} with too few.

        PED-ANOVA (Watanabe, Bansal and Hutter 2023, arXiv 2304.10255).
        """
        from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances

        rewards = self._rewards()
        if len(rewards) < 20 or len(set(rewards)) < 3:
            return {}
        found = get_param_importances(self._study, evaluator=PedAnovaImportanceEvaluator())
        return {name: float(share) for name, share in found.items()}

    def _proposal(self, trial: optuna.Trial) -> Proposal:
        # Every trial in one order of parameters: the sampler's random numbers depend on it.
        values = {
            key: trial.suggest_float(key, found.low, found.high, log=found.log)
            for key, found in self._space.items()
        }
        if OWNER not in trial.user_attrs:
            trial.set_user_attr(OWNER, self._owner)
        return Proposal(trial.number, values)

    def _rewards(self) -> list[float]:
        return [trial.value for trial in self._in_state("COMPLETE") if trial.value is not None]

    def _in_state(self, state: str) -> list[FrozenTrial]:
        import optuna

        return self._study.get_trials(deepcopy=False, states=(optuna.trial.TrialState[state],))

    def _frozen(self, number: int) -> FrozenTrial:
        trials = self._study.get_trials(deepcopy=False)
        return next(trial for trial in reversed(trials) if trial.number == number)


def open_study(
    storage: str | None,
    name: str | None,
    run_dir: Path,
    identity: Mapping[str, Any],
    space: Space,
    search: Search,
    first: Mapping[str, float],
) -> Study:
    """The study of a run, made if need be.

    storage, name: as in the config. identity: of the config. first: values that the first trial has, where the
    search does not choose them. Raises InputError where the storage cannot be
    used, or holds under this name a study of another robot, map, search space or seed.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    searched = {key: value for key, value in identity.items() if key not in _NOT_SEARCHED}
    backend, flush = _journal(run_dir / JOURNAL) if storage is None else (open_storage(storage), _nothing)
    name = name or f"lme-{launch_record.fingerprint([searched], multirun=False)[:8]}"
    study = _created(backend, name, per_trial(search.sampler, identity["seed"]), storage)
    owner = "" if storage is None else f"{socket.gethostname()}:{run_dir.resolve()}"
    if first and not study.get_trials(deepcopy=False):
        study.enqueue_trial(dict(first))
    opened = Study(study, space, owner, flush)
    found = list(launch_record.differences(opened.settle(IDENTITY, searched), searched))
    if found:
        place = run_dir / JOURNAL if storage is None else f"study {name} in {masked(storage)}"
        raise InputError(
            f"{place}: is of another search ({launch_record.shortened(found)}): "
            "choose another study=NAME or directory"
        )
    return opened


def open_storage(url: str) -> BaseStorage:
    """The storage at an Optuna URL: a database, or redis:// for a journal. Raises InputError without one."""
    from optuna.storages import JournalStorage, RDBStorage
    from optuna.storages.journal import JournalRedisBackend

    try:
        if url.startswith(("redis://", "rediss://", "unix://")):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # experimental, says Optuna
                return JournalStorage(JournalRedisBackend(url))
        return RDBStorage(url, engine_kwargs=_patience(url))
    except Exception as error:  # whatever the driver raises, or that there is none
        raise unreachable(url, error) from error


def unreachable(url: str, error: Exception) -> InputError:
    """One line about a storage that does not answer."""
    reason = (str(error).splitlines() or [type(error).__name__])[0]
    return InputError(
        f"storage is {masked(url)}: cannot be used ({reason.replace(url, masked(url))[:200]}); must be an Optuna "
        "storage URL such as postgresql://user@host/optuna, with its driver installed, or null for a journal"
    )


def masked(url: str) -> str:
    """The URL without its password."""
    scheme, separator, rest = url.partition("://")
    account, at, host = rest.rpartition("@")
    user = account.partition(":")[0]
    return f"{scheme}{separator}{f'{user}:***' if ':' in account else account}{at}{host}"


def _created(
    storage: BaseStorage, name: str, sampler: optuna.samplers.BaseSampler, url: str | None
) -> optuna.Study:
    import optuna

    try:
        return optuna.create_study(
            study_name=name,
            storage=storage,
            sampler=sampler,
            pruner=optuna.pruners.NopPruner(),
            direction="maximize",
            load_if_exists=True,
        )
    except Exception as error:
        if url is None:
            raise
        raise unreachable(url, error) from error


def _journal(path: Path) -> tuple[BaseStorage, Callable[[], None]]:
    from optuna.storages import JournalStorage

    from runners.search.journal import Journal

    journal = Journal(path)
    return JournalStorage(journal), journal.flush


def _nothing() -> None:
    """Databases write at once."""


def _patience(url: str) -> dict[str, Any]:
    """Give up on a dead server in seconds."""
    if url.startswith(("postgresql", "mysql")):
        return {"connect_args": {"connect_timeout": 10}}
    return {}


def _trial(trial: FrozenTrial) -> Trial:
    scores = [Score(*score) for score in trial.user_attrs.get(SCORES, [])]
    assert trial.value is not None
    return Trial(trial.number, trial.value, dict(trial.params), scores)
