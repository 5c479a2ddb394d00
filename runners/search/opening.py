"""Opens the study of a run, or creates it, and checks that it is of the same search."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from runners.config.space import Space
from runners.config.urls import masked
from runners.records import launch_record
from runners.search.heartbeat import Heartbeat
from runners.search.optuna_private import is_first
from runners.search.samplers import Search, per_trial
from runners.search.score_log import SCORE_LOG, ScoreLog
from runners.search.storage import open_storage, storage_errors
from runners.search.study import Study

if TYPE_CHECKING:
    import optuna
    from optuna.storages import BaseStorage

JOURNAL = "study.journal"
_IDENTITY = "identity"
# Keys that do not identify a study: the length of the search, and the use of its result.
_NOT_SEARCHED = ("trials", "runs", "held_out", "name", "storage", "study")


def open_study(
    storage: str | None,
    name: str | None,
    run_dir: Path,
    identity: Mapping[str, Any],
    space: Space,
    search: Search,
    first: Mapping[str, float],
    restarts: int = 1,
) -> Study:
    """Open the study of a run, or create it.

    storage, name: as in the config. identity: of the config. first: values for the first trial; the search chooses
    the others. restarts: number of searches that the trials belong to in turn. Raises InputError if the storage cannot
    be used, or has a study of this name with another robot, map, search space or seed.
    """
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    searched = {key: value for key, value in identity.items() if key not in _NOT_SEARCHED}
    name = name or f"lme-{launch_record.fingerprint([searched], multirun=False)[:8]}"
    sampler = per_trial(search.sampler, identity["seed"], first, restarts)
    with storage_errors(storage, "start again when it does"):
        study = _open(storage, name, run_dir, space, sampler)
        stored = study.get_or_set(_IDENTITY, searched)
    damaged = [] if isinstance(stored, Mapping) else [f"{_IDENTITY} is {stored!r:.40}: must be a mapping"]
    found = damaged or list(launch_record.differences(stored, searched))
    if found:
        place = run_dir / JOURNAL if storage is None else f"study {name} in {masked(storage)}"
        raise InputError(
            f"{place}: belongs to another search ({launch_record.shortened(found)}): "
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
    """The study in a journal. Raises InputError if it is damaged."""
    from optuna.storages import JournalStorage

    from runners.search.journal import Journal

    journal = Journal(path)
    try:
        created = _create(JournalStorage(journal), name, sampler)
        if not is_first(created):
            raise ValueError("the first study was deleted")
        study = Study(created, space, "", journal.flush, Heartbeat(None), ScoreLog(None))
        _ = study.told  # raises unless every trial can be read
    except Exception as error:  # JSON that does not describe steps of a study can raise anything
        raise InputError(
            f"{path}: is damaged ({type(error).__name__}): restore the file, or start another study"
        ) from error
    return study


def _no_flush() -> None:
    """Do nothing: a database needs no flush."""
