"""Optuna's private names: all of them, and nothing else.

Processes share trials, resume those of a killed process, and send heartbeats for them. All this needs the id of a
trial in its storage, which only `_trial_id` holds: the public `record_heartbeat` takes it, and a trial that was asked
for before is constructed again from it. Only the study's `_storage` can set an attribute of such a trial. `_study_id`
shows whether the first study of a journal was deleted. Samplers read the trials of a study by `_get_trials`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import optuna
    from optuna.trial import FrozenTrial


def id_of(trial: optuna.Trial | FrozenTrial) -> int:
    """Return the id of a trial in its storage."""
    return int(trial._trial_id)


def resume_trial(study: optuna.Study, running: FrozenTrial) -> optuna.Trial:
    """Return a trial that was asked for before and is still running, to suggest its values again."""
    import optuna

    return optuna.trial.Trial(study, id_of(running))


def annotate(study: optuna.Study, trial: FrozenTrial, name: str, value: Any) -> None:
    """Set an attribute of a trial, whichever process asked for it. Raises UpdateFinishedTrialError."""
    study._storage.set_trial_user_attr(id_of(trial), name, value)


def is_first(study: optuna.Study) -> bool:
    """Return whether the study is the first one of its storage."""
    return study._study_id == 0


class Part:
    """View of a study that shows a sampler only some of its trials."""

    def __init__(self, study: optuna.Study, includes: Callable[[FrozenTrial], bool]) -> None:
        self._study = study
        self._includes = includes

    def __getattr__(self, name: str) -> Any:
        return getattr(self._study, name)

    def _get_trials(self, *args: Any, **keywords: Any) -> list[FrozenTrial]:
        return list(filter(self._includes, self._study._get_trials(*args, **keywords)))

    def get_trials(self, *args: Any, **keywords: Any) -> list[FrozenTrial]:
        """Return the trials that belong to the part."""
        return list(filter(self._includes, self._study.get_trials(*args, **keywords)))
