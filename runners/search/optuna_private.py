"""Optuna's private names: all of them, and nothing else.

Processes share trials, resume those of a killed process, and send signs of life for them. All that takes the id of a
trial in its storage, which Optuna keeps in `_trial_id` alone: the public `record_heartbeat` wants it, and a trial that
was asked for before is made again from it. An attribute of such a trial can be set only through the study's `_storage`.
A journal whose first study was deleted is known by `_study_id`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import optuna
    from optuna.trial import FrozenTrial


def id_of(trial: optuna.Trial | FrozenTrial) -> int:
    """The id of a trial in its storage."""
    return int(trial._trial_id)


def asked_again(study: optuna.Study, running: FrozenTrial) -> optuna.Trial:
    """A trial that was asked for before and is still running, to suggest its values once more."""
    import optuna

    return optuna.trial.Trial(study, id_of(running))


def annotate(study: optuna.Study, trial: FrozenTrial, name: str, value: Any) -> None:
    """Set an attribute of a trial, whoever asked for it. Raises UpdateFinishedTrialError."""
    study._storage.set_trial_user_attr(id_of(trial), name, value)


def is_first(study: optuna.Study) -> bool:
    """Whether the study is the first one of its storage."""
    return study._study_id == 0
