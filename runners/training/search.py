"""The search of a run: its study, opened or created and checked to be the same search, and the trials in it."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from runners.config.escaping import masked
from runners.config.space import Space
from runners.records import launch_record
from runners.training.optuna_private import is_first
from runners.training.race_log import SCORE_LOG, ScoreLog
from runners.training.samplers import Search, per_trial
from runners.training.storage import Heartbeat, open_storage, storage_errors
from runners.training.study import Proposal, Study
from runners.workers.executor import Map
from runners.workers.trials import Attempt, Place, Score

if TYPE_CHECKING:
    import optuna
    from optuna.storages import BaseStorage


JOURNAL = "study.journal"
_IDENTITY = "identity"
_POLL_S = 1.0  # [s] between checks of the trials of other processes
# Keys that do not identify a study: they set the length of the search, and the use of its result.
_NOT_SEARCHED = ("trials", "runs", "held_out", "name", "storage", "study")


def open_study(
    storage: str | None,
    name: str | None,
    run_dir: Path,
    identity: Mapping[str, Any],
    space: Space,
    search: Search,
    start_values: Mapping[str, float],
    restarts: int = 1,
) -> Study:
    """Open the study of a run, or create it.

    storage, name: as in the config. identity: that of the config. start_values: values of the first trial; the search
    chooses the others. restarts: number of searches, among which the trials alternate. Raises InputError if the
    storage cannot be used, or has a study of this name with another robot, map, search space or seed.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    searched = {key: value for key, value in identity.items() if key not in _NOT_SEARCHED}
    name = name or f"lme-{launch_record.fingerprint([searched], multirun=False)[:8]}"
    # Open the study; the first process stores the identity of its search.
    sampler = per_trial(search.sampler, identity["seed"], start_values, restarts)
    with storage_errors(storage, "start again when it does"):
        study = _open(storage, name, run_dir, space, sampler)
        stored = study.get_or_set(_IDENTITY, searched)
    # A study of another search must not be continued.
    damaged = [] if isinstance(stored, Mapping) else [f"{_IDENTITY} is {stored!r:.40}: must be a mapping"]
    conflicts = damaged or list(launch_record.differences(stored, searched))
    if conflicts:
        study_name = run_dir / JOURNAL if storage is None else f"study {name} in {masked(storage)}"
        raise InputError(
            f"{study_name}: belongs to another search ({launch_record.shortened(conflicts)}): "
            "choose another study=NAME or directory"
        )
    return study


def _open(
    storage: str | None, name: str, run_dir: Path, space: Space, sampler: optuna.samplers.BaseSampler
) -> Study:
    from optuna.storages import RDBStorage

    if storage is None:
        return _open_journal(run_dir / JOURNAL, name, space, sampler)
    shared = open_storage(storage)
    owner = f"{socket.gethostname()}:{run_dir.resolve()}"
    heartbeat = Heartbeat(shared if isinstance(shared, RDBStorage) else None)
    log = ScoreLog(run_dir / SCORE_LOG)
    return Study(_create(shared, name, sampler), space, owner, _no_flush, heartbeat, log)


def _create(storage: BaseStorage, name: str, sampler: optuna.samplers.BaseSampler) -> optuna.Study:
    import optuna

    return optuna.create_study(
        study_name=name,
        storage=storage,
        sampler=sampler,
        pruner=optuna.pruners.NopPruner(),
        direction="maximize",
        load_if_exists=True,
    )


def _open_journal(path: Path, name: str, space: Space, sampler: optuna.samplers.BaseSampler) -> Study:
    """Open the study in a journal. Raises InputError if it is damaged."""
    from optuna.storages import JournalStorage

    from runners.training.journal import Journal

    journal = Journal(path)
    try:
        created = _create(JournalStorage(journal), name, sampler)
        if not is_first(created):
            raise ValueError("the first study was deleted")
        study = Study(created, space, "", journal.flush, Heartbeat(None), ScoreLog(None))
        _ = study.finished_trials  # raises unless every trial can be read
    except Exception as error:  # JSON that does not describe steps of a study can raise anything
        raise InputError(
            f"{path}: is damaged ({type(error).__name__}): restore the file, or start another study"
        ) from error
    return study


def _no_flush() -> None:
    """Do nothing: a database needs no flush."""


def run_trials(
    study: Study,
    total: int,
    batch: int,
    configurations: Sequence[Place],
    run_all: Map,
    note: Callable[[int, float | None], None],
) -> None:
    """Run trials until the study has `total`, starting with the unfinished ones of a killed run.

    If other processes run the last trials, wait for them, and take over those of a process that dies.
    configurations: families and worlds that every trial drives. run_all: maps attempts to scores, in any order. note:
    called with the number of finished trials and the best reward so far.
    """
    with study.keep_alive():
        while study.num_finished < total:
            # Claim and run a batch, and report it in the order of the numbers, which the sampler depends on.
            if proposals := study.claim(total, batch):
                _run_batch(study, proposals, configurations, run_all)
                for proposal in proposals:
                    study.tell(proposal.number)
                    note(study.num_finished, study.best)
            # Other processes run the rest: wait, as one of them may die.
            elif study.finds_killed:
                time.sleep(_POLL_S)
                note(study.num_finished, study.best)
            else:
                break


def _run_batch(study: Study, batch: list[Proposal], configurations: Sequence[Place], run_all: Map) -> None:
    """Run all episodes of a batch. The scores of a trial are stored when its last episode ends."""
    unscored = [proposal for proposal in batch if not study.scored(proposal.number)]
    attempts = [
        Attempt(proposal.number, *configuration, tuple(proposal.values.items()))
        for proposal in unscored
        for configuration in configurations
    ]
    scores: dict[int, dict[Place, Score]] = {proposal.number: {} for proposal in unscored}
    for score in run_all(attempts):
        of_trial = scores[score.trial]
        of_trial[score.place] = score
        if len(of_trial) == len(configurations):
            study.store_scores(score.trial, [of_trial[configuration] for configuration in configurations])
