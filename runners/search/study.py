"""The study of a search: its trials, in a journal in the run directory or in a storage that machines share.

A batch of trials is proposed before any of them runs, and told to the sampler in the order of their numbers after all
have run. The sampler therefore sees the same for any number of workers. The unfinished trials of a killed study keep
their parameters and run again.
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
# Keys that do not identify a study: the length of the search, and what is done with the result.
_NOT_SEARCHED = ("trials", "runs", "held_out", "name", "storage", "study")


class Proposal(NamedTuple):
    """A trial to run: its number, and its values by dotted config key."""

    number: int
    values: dict[str, float]


class Trial(NamedTuple):
    """A finished trial. values: by dotted config key. scores: one per configuration, in their order."""

    number: int
    reward: float
    values: dict[str, float]
    scores: list[Score]


class Study:
    """The trials of one search. One process works on a run directory; several may share a storage."""

    def __init__(self, study: optuna.Study, space: Space, owner: str, flush: Callable[[], None]) -> None:
        self._study = study
        self._space = space
        self._owner = owner
        self._flush = flush

    @property
    def told(self) -> list[Trial]:
        """Finished trials, by number."""
        return [_trial(trial) for trial in self._in_state("COMPLETE")]

    @property
    def best(self) -> float | None:
        """The best reward so far; None before the first trial ends."""
        return max(self._rewards(), default=None)

    @property
    def num_elsewhere(self) -> int:
        """Number of trials that other machines are running."""
        owners = [trial.user_attrs.get(OWNER, self._owner) for trial in self._in_state("RUNNING")]
        return sum(owner != self._owner for owner in owners)

    def room(self, total: int, batch: int) -> int:
        """Number of trials to propose next: `batch`, or the rest of `total`."""
        taken = len(self._in_state("COMPLETE")) + self.num_elsewhere
        return max(min(batch, total - taken), 0)

    def ask(self, count: int) -> list[Proposal]:
        """Propose new trials."""
        proposals = [self._proposal(self._study.ask()) for _ in range(count)]
        self._flush()
        return proposals

    def unfinished(self) -> list[Proposal]:
        """Trials that a killed run in this directory proposed but did not finish."""
        import optuna

        mine = [t for t in self._in_state("RUNNING") if t.user_attrs.get(OWNER) == self._owner]
        return [self._proposal(optuna.trial.Trial(self._study, trial._trial_id)) for trial in mine]

    def scored(self, number: int) -> bool:
        """Whether the scores of an unfinished trial are stored."""
        return SCORES in self._frozen(number).user_attrs

    def keep(self, number: int, scores: Sequence[Score]) -> None:
        """Store the scores of a trial, before `tell`."""
        attributes = [list(score) for score in scores]
        self._study._storage.set_trial_user_attr(self._frozen(number)._trial_id, SCORES, attributes)
        self._flush()

    def tell(self, number: int) -> None:
        """Finish a trial with the mean reward of its stored scores."""
        scores = [Score(*score) for score in self._frozen(number).user_attrs[SCORES]]
        self._study.tell(number, fmean(score.reward for score in scores))
        self._flush()

    def settle(self, name: str, value: Any) -> Any:
        """The study's attribute `name`, which is set to `value` if the study has none yet."""
        if name not in self._study.user_attrs:
            self._study.set_user_attr(name, value)
            self._flush()
        return self._study.user_attrs[name]

    def importances(self) -> dict[str, float]:
        """Share of each parameter in the difference between the best tenth of trials and the rest; {} with too few.

        PED-ANOVA (Watanabe, Bansal and Hutter 2023, arXiv 2304.10255).
        """
        from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances

        rewards = self._rewards()
        if len(rewards) < 20 or len(set(rewards)) < 3:
            return {}
        found = get_param_importances(self._study, evaluator=PedAnovaImportanceEvaluator())
        return {name: float(share) for name, share in found.items()}

    def _proposal(self, trial: optuna.Trial) -> Proposal:
        # The parameters have a fixed order, because the sampler's random numbers depend on it.
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
    """Open the study of a run, or create it.

    storage, name: as in the config. identity: of the config. first: values for the first trial; the search chooses
    the others. Raises InputError if the storage cannot be used, or has a study of this name with another robot, map,
    search space or seed.
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
    """The storage at an Optuna URL: a database, or redis:// for a journal. Raises InputError if it cannot be used."""
    from optuna.storages import JournalStorage, RDBStorage
    from optuna.storages.journal import JournalRedisBackend

    try:
        if url.startswith(("redis://", "rediss://", "unix://")):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # Optuna's warning that it is experimental
                return JournalStorage(JournalRedisBackend(url))
        return RDBStorage(url, engine_kwargs=_patience(url))
    except Exception as error:  # any error of the driver, or of its import
        raise unreachable(url, error) from error


def unreachable(url: str, error: Exception) -> InputError:
    """The error for a storage that cannot be used, in one line."""
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
    """A database needs no flush."""


def _patience(url: str) -> dict[str, Any]:
    """Options that give up on an unreachable server after seconds."""
    if url.startswith(("postgresql", "mysql")):
        return {"connect_args": {"connect_timeout": 10}}
    return {}


def _trial(trial: FrozenTrial) -> Trial:
    scores = [Score(*score) for score in trial.user_attrs.get(SCORES, [])]
    assert trial.value is not None
    return Trial(trial.number, trial.value, dict(trial.params), scores)
