"""Study of a search: its trials, in a journal in the run directory or in a storage that machines share.

A batch of trials is proposed before any of them runs, and reported to the sampler in the order of their numbers after
all have run. The sampler therefore sees the same for any number of workers. The unfinished trials of a killed study
keep their parameters and run again: at once in its own directory, or after a timeout in another process that shares
the storage.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, suppress
from statistics import fmean
from typing import TYPE_CHECKING, Any, NamedTuple

from runners.config.space import Space
from runners.training.optuna_private import annotate, id_of, resume_trial
from runners.training.race_log import ScoreLog
from runners.training.storage import Heartbeat
from runners.workers.trials import Score

if TYPE_CHECKING:
    import optuna
    from optuna.trial import FrozenTrial

CONFIGURATIONS, OWNER, SCORES = "configurations", "owner", "scores"


class Proposal(NamedTuple):
    """Trial to run: its number, and its values by dotted config key."""

    number: int
    values: dict[str, float]


class Trial(NamedTuple):
    """Finished trial. values: by dotted config key. scores: one per configuration, in their order."""

    number: int
    reward: float
    values: dict[str, float]
    scores: list[Score]


class Study:
    """Trials of one search. One process works on a run directory; several may share a storage."""

    def __init__(
        self,
        study: optuna.Study,
        space: Space,
        owner: str,
        flush: Callable[[], None],
        heartbeat: Heartbeat,
        log: ScoreLog,
    ) -> None:
        self._study = study
        self._space = space
        self._owner = owner
        self._flush = flush
        self._heartbeat = heartbeat
        self._log = log
        self._values: dict[int, dict[str, float]] = {}  # by trial that this process has proposed

    @property
    def finds_killed(self) -> bool:
        """Return whether `claim` finds the trials of killed processes."""
        return self._heartbeat.finds_killed

    def keep_alive(self) -> AbstractContextManager[None]:
        """Within the block, show other processes that this one is alive."""
        return self._heartbeat.send_heartbeats()

    @property
    def num_finished(self) -> int:
        """Number of finished trials."""
        return len(self._trials_in_state("COMPLETE"))

    @property
    def finished_trials(self) -> list[Trial]:
        """Finished trials in the order of their numbers."""
        return [_trial(trial) for trial in self._trials_in_state("COMPLETE")]

    @property
    def best(self) -> float | None:
        """Best reward so far; None before the first trial ends."""
        return max(self._rewards(), default=None)

    @property
    def num_elsewhere(self) -> int:
        """Number of trials that other processes are running."""
        return sum(trial.user_attrs.get(OWNER) != self._owner for trial in self._trials_in_state("RUNNING"))

    def claim(self, total: int, batch: int) -> list[Proposal]:
        """Return trials to run next: unfinished ones of this directory, else those of killed processes and new ones.

        There are at most `batch`, and never so many that more than `total` would finish; none if other processes run
        the rest.
        """
        self._heartbeat.requeue_killed(self._study)
        count = min(batch, total - self.num_finished - self.num_elsewhere)
        proposals = self._unfinished() or [self._ask() for _ in range(count)]
        self._flush()
        return [
            proposal
            for proposal in proposals
            if proposal is not None and self._is_within_total(proposal.number, total)
        ]

    def _unfinished(self) -> list[Proposal | None]:
        """Return the trials that a killed run in this directory proposed but did not finish."""
        own_trials = [t for t in self._trials_in_state("RUNNING") if t.user_attrs.get(OWNER) == self._owner]
        return [self._proposal(resume_trial(self._study, trial)) for trial in own_trials]

    def _ask(self) -> Proposal | None:
        with warnings.catch_warnings():
            # Optuna warns that only Study.optimize sends heartbeats; here Heartbeat does.
            warnings.simplefilter("ignore")
            return self._proposal(self._study.ask())

    def _is_within_total(self, number: int, total: int) -> bool:
        """Return whether fewer than `total` trials precede this one; if not, withdraw it.

        Processes that propose at the same time may propose too many. The storage numbers trials one after the other,
        and later ones never precede this one, so all processes see the same first `total`.
        """
        earlier = [trial for trial in self._study.get_trials(deepcopy=False) if trial.number < number]
        if sum(trial.state.name != "FAIL" for trial in earlier) < total:
            return True
        self._finish(number, None)
        return False

    def scored(self, number: int) -> bool:
        """Return whether the scores of an unfinished trial are stored."""
        return SCORES in self._frozen(number).user_attrs

    def store_scores(self, number: int, scores: Sequence[Score]) -> None:
        """Store the scores of a trial, before `tell`."""
        import optuna

        attributes = [list(score) for score in scores]
        self._log.add(self._values[number], attributes)  # first, since the storage may not answer
        with suppress(optuna.exceptions.UpdateFinishedTrialError):  # another process has taken it
            annotate(self._study, self._frozen(number), SCORES, attributes)
        self._flush()

    def tell(self, number: int) -> None:
        """Finish a trial with the mean reward of its stored scores, unless another process has taken it."""
        scores = self._frozen(number).user_attrs.get(SCORES)  # without any, another process has taken it
        self._finish(number, None if scores is None else fmean(Score(*score).reward for score in scores))
        self._flush()

    def get_or_set(self, name: str, value: Any) -> Any:
        """Return the study's attribute `name`, after setting it to `value` if the study does not have it yet."""
        if name not in self._study.user_attrs:
            self._study.set_user_attr(name, value)
            self._flush()
        return self._study.user_attrs[name]

    def importances(self) -> dict[str, float]:
        """Return each parameter's share in what sets the best tenth of trials apart; {} with too few trials.

        PED-ANOVA (Watanabe, Bansal and Hutter 2023, arXiv 2304.10255).
        """
        from optuna.importance import PedAnovaImportanceEvaluator, get_param_importances

        rewards = self._rewards()
        if len(rewards) < 20 or len(set(rewards)) < 3:
            return {}
        shares = get_param_importances(self._study, evaluator=PedAnovaImportanceEvaluator())
        return {name: float(share) for name, share in shares.items()}

    def _finish(self, number: int, reward: float | None) -> None:
        """Finish a trial, unless another process has taken it. reward: None if it failed and does not count."""
        import optuna

        state = optuna.trial.TrialState.FAIL if reward is None else None
        with suppress(optuna.exceptions.UpdateFinishedTrialError):
            self._study.tell(number, reward, state=state, skip_if_finished=True)
        self._heartbeat.end(id_of(self._frozen(number)))

    def _proposal(self, trial: optuna.Trial) -> Proposal | None:
        """Return the trial with its values; None if another process has taken it meanwhile."""
        import optuna

        self._heartbeat.begin(id_of(trial))
        try:
            return self._with_values(trial)
        except optuna.exceptions.UpdateFinishedTrialError:
            self._heartbeat.end(id_of(trial))
            return None

    def _with_values(self, trial: optuna.Trial) -> Proposal:
        # The parameters have a fixed order, because the sampler's random numbers depend on it.
        values = {
            key: trial.suggest_float(key, bounds.low, bounds.high, log=bounds.log)
            for key, bounds in self._space.items()
        }
        if trial.user_attrs.get(OWNER) != self._owner:
            trial.set_user_attr(OWNER, self._owner)
        self._values[trial.number] = values
        scores = self._log.get(values)
        if scores is not None and SCORES not in trial.user_attrs:
            trial.set_user_attr(SCORES, scores)
        return Proposal(trial.number, values)

    def _rewards(self) -> list[float]:
        return [trial.value for trial in self._trials_in_state("COMPLETE") if trial.value is not None]

    def _trials_in_state(self, state: str) -> list[FrozenTrial]:
        import optuna

        return self._study.get_trials(deepcopy=False, states=(optuna.trial.TrialState[state],))

    def _frozen(self, number: int) -> FrozenTrial:
        trials = self._study.get_trials(deepcopy=False)
        return next(trial for trial in reversed(trials) if trial.number == number)


def _trial(trial: FrozenTrial) -> Trial:
    # A repeated trial has the scores of the original.
    stored = (Score(*score) for score in trial.user_attrs.get(SCORES, []))
    scores = [score._replace(trial=trial.number) for score in stored]
    assert trial.value is not None
    return Trial(trial.number, trial.value, dict(trial.params), scores)
