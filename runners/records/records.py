"""Records of a run: written while it lasts, read for tables and figures.

While a run lasts, each finished episode is one line of the append log, `parts/episodes.jsonl`. `RecordWriter.merge`
moves the episodes to `episodes.parquet` and `trajectories.parquet` and removes the append log. Whenever a run
is killed, every finished episode is in one of the two places or in both. Readers take the union.
"""

from __future__ import annotations

import contextlib
import io
import json
import math
import os
import warnings
from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError
from runners.config.catalogue import Catalogue
from runners.config.changes import describe_changes, flatten, map_like, robot_difference, robots_like
from runners.config.job import scale_in_words
from runners.config.quoting import resume_command, value_text
from runners.config.systems import ablation_labels, describe_ablation, system_settings
from runners.records.atomic_write import what_is_full
from runners.records.episode_record import (
    APPEND_LOG,
    KEY_COLUMNS,
    AppendLog,
    EpisodeKey,
    EpisodeKeys,
    EpisodeResult,
    LogEntry,
    cut_torn_line,
    encode,
    entry_of,
    lock,
    read_log,
)
from runners.records.launch_record import DEFAULTS, LAUNCH, Launch, read_launch
from runners.records.parquet import (
    EPISODES,
    entries_in_files,
    episode_table,
    first_row,
    keys_not_in,
    keys_of,
    trajectory_table,
    write_files,
)

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

# Columns with the same value in all episodes of a run.
PLANNED_WORLDS, PLANNED_EPISODES = "planned_worlds", "planned_episodes"
ABLATED = "ablated"
REQUIRED = frozenset({*KEY_COLUMNS, "system", "outcome"})


class RecordsWriteError(OSError):
    """Records could not be written, for example because the disk is full. Earlier records are kept."""


class RecordWriter:
    """Writer that adds finished episodes to the records of a run directory.

    Use as a context manager. Only one process can hold a run directory at a time. Raises InputError if the directory
    cannot be written or another process holds it.
    """

    def __init__(self, run_dir: Path) -> None:
        self._run_dir = Path(run_dir)
        self._log = self._run_dir / APPEND_LOG
        self._file: Any = None
        self._stored_keys = EpisodeKeys(())
        self._appended = 0
        self._unmerged = 0  # episodes that are only in the append log

    def __enter__(self) -> RecordWriter:
        try:
            self._log.parent.mkdir(parents=True, exist_ok=True)
            # Unbuffered: once append() returns, the line survives SIGKILL.
            self._file = self._log.open("ab", buffering=0)
        except OSError as error:
            raise InputError(
                f"cannot write to the output directory {self._run_dir} ({error.strerror}): "
                "choose another with hydra.run.dir=PATH"
            ) from None
        try:
            lock(self._file, self._run_dir)
            cut_torn_line(self._log)
            with read_log(self._log) as log:
                merged = keys_of(self._run_dir)
                new_keys = keys_not_in(log, merged)
            self._stored_keys = EpisodeKeys(np.union1d(merged.codes, new_keys.codes))
            self._unmerged = len(new_keys)
        except BaseException:
            self._file.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def done(self) -> EpisodeKeys:
        """Return the keys of the episodes recorded so far."""
        return self._stored_keys

    def append(self, result: EpisodeResult) -> None:
        """Add one finished episode. An episode that is already recorded stays as it is.

        Raises RecordsWriteError, for example when the disk is full.
        """
        if result.record.key not in self._stored_keys:
            self._append(entry_of(result))
            self._appended += 1
            self._unmerged += 1

    def merge(self) -> None:
        """Move the episodes of the append log to the two Parquet files, sorted by key, and remove the log.

        The result depends on the episodes alone, not on the order in which they finished or on how often the run
        was resumed. Each file is replaced whole. Raises RecordsWriteError.
        """
        # Bring everything into the log, whose reader sorts and drops duplicates, and write both files from it.
        if self._unmerged:
            for entry in entries_in_files(self._run_dir):
                self._append(entry)
            try:
                with read_log(self._log) as log:
                    write_files(self._run_dir, log)
            except OSError as error:
                if not self._run_dir.is_dir():
                    raise self._gone() from None
                raise self._write_error(Path(error.filename or self._run_dir), error) from None
        # The files hold all episodes now.
        try:
            self._log.unlink()  # a reader that has the file open can read on
        except OSError:  # Windows keeps a file that is open
            with contextlib.suppress(OSError):
                self._file.truncate(0)
        with contextlib.suppress(OSError):
            self._log.parent.rmdir()

    def _append(self, entry: LogEntry) -> None:
        line = encode(entry)
        status = os.fstat(self._file.fileno())
        if not status.st_nlink:  # Windows does not let an open file be deleted
            raise self._gone()
        size_before = status.st_size
        try:
            while line:
                line = line[self._file.write(line) :]
        except OSError as error:
            with contextlib.suppress(OSError):
                self._file.truncate(size_before)
            raise self._write_error(self._log, error) from None

    def _gone(self) -> RecordsWriteError:
        return RecordsWriteError(
            f"{self._run_dir}: its records are gone: they were deleted while the run wrote them; start it again"
        )

    def _write_error(self, path: Path, error: OSError) -> RecordsWriteError:
        cause = what_is_full(error, path) or f"{error.strerror or error} while writing {path}"
        return RecordsWriteError(
            f"{cause}: {len(self._stored_keys) + self._appended} episodes are kept; "
            "free some space and add resume=true"
        )


def find_runs(paths: Iterable[Path]) -> list[Path]:
    """Return the run directories among `paths`. The directory of a sweep stands for its runs.

    Numbered directories come in numerical order. Raises InputError for a path without records.
    """
    runs: dict[Path, None] = {}  # in order, each once
    for path in map(Path, paths):
        children = list(path.iterdir()) if path.is_dir() else []
        children.sort(
            key=lambda child: (
                not child.name.isdigit(),
                int(child.name) if child.name.isdigit() else 0,
                child.name,
            )
        )
        run_dirs_here = [path] if has_records(path) else [child for child in children if has_records(child)]
        if not run_dirs_here:
            raise InputError(_why_no_runs(path, children))
        if run_dirs_here != [path]:
            _warn_of_missing_jobs(path, len(run_dirs_here))
        runs |= dict.fromkeys(run_dirs_here)
    return list(runs)


def _warn_of_missing_jobs(sweep_dir: Path, num_runs: int) -> None:
    """Warn if a sweep was stopped before all of its jobs had begun."""
    with contextlib.suppress(InputError):  # the jobs have launch records of their own
        launch = read_launch(sweep_dir)
        if launch is not None and launch.num_jobs is not None and num_runs < launch.num_jobs:
            command = resume_command(launch.command, sweep_dir)
            warnings.warn(
                f"{sweep_dir}: {num_runs} of its {launch.num_jobs} jobs have records; the others are missing here: "
                f"{command}",
                stacklevel=3,
            )


def _why_no_runs(path: Path, children: Sequence[Path]) -> str:
    """Say what to give in place of a path without runs. Those of a sweep of trainings are a level deeper."""
    deeper = [
        run_dir
        for child in children
        if child.is_dir()
        for run_dir in sorted(child.iterdir())
        if has_records(run_dir)
    ]
    if deeper:
        examples = " ".join(map(str, deeper[:2])) + (" …" if len(deeper) > 2 else "")
        return f"{path} has no records of its own: give the directories in it that have some: {examples}"
    problem = "has no records" if path.is_dir() else "is not a directory"
    return f"{path} {problem}: give a run directory ({EPISODES} or {APPEND_LOG} in it) or a sweep's"


def read_episodes(run_dirs: Sequence[Path]) -> pd.DataFrame:
    """Read the records of one or more runs, finished or not: one row per episode, with the column `run_dir`.

    Facts from the launch records of the runs become further columns: see `_columns_of`.
    Raises InputError for a file that is missing or has no records.
    """
    import pandas as pd

    frames = read_runs(run_dirs)
    return frames[0] if len(frames) == 1 else pd.concat(frames, ignore_index=True)


def read_runs(run_dirs: Sequence[Path], without: Collection[str] = ()) -> list[pd.DataFrame]:
    """Read the records of runs as `read_episodes` does, but return a frame for each run that has some.

    without: names of columns that are not needed, each of which takes 8 MB of a million episodes.
    """
    import pandas as pd
    import pyarrow as pa

    frames = []
    for table, columns in _tables(run_dirs, without):
        series, num_rows = {}, table.num_rows
        for name in table.column_names:
            series[name] = _series(table[name])
            table = table.drop_columns(name)  # a large run does not fit in memory twice
        # Records without the column are of systems that saw the people who were really there.
        truth = str(DEFAULTS["people"])
        series["people"] = (
            series["people"].fillna(truth) if "people" in series else _constant(truth, num_rows)
        )
        added = {key: _constant(value, num_rows) for key, value in columns.items() if key not in series}
        frames.append(pd.DataFrame({**series, **added}, copy=False))
    pa.default_memory_pool().release_unused()
    return frames


def _series(column: pa.ChunkedArray) -> pd.Series:
    """Return a column of records for pandas. Texts are objects, and equal texts the same object: 8 bytes each."""
    import pandas as pd
    import pyarrow as pa

    if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
        return column.to_pandas()
    encoded = column.combine_chunks().dictionary_encode()
    if len(encoded.dictionary) == 1 and not encoded.null_count:
        return _repeated(encoded.dictionary[0].as_py(), len(encoded))
    texts = np.array([*encoded.dictionary.to_pylist(), math.nan], dtype=object)
    codes = encoded.indices.fill_null(len(texts) - 1).to_numpy(zero_copy_only=False)
    return pd.Series(texts[codes], dtype=object)


def _constant(value: object, num_rows: int) -> pd.Series:
    """Return a column with the same value for every episode."""
    import pandas as pd

    return _repeated(value, num_rows) if isinstance(value, str) else pd.Series(value, index=range(num_rows))


def _repeated(text: str, times: int) -> pd.Series:
    """Return a column that holds one text once, however long it is: most texts of a run are labels of all of it."""
    import pandas as pd

    return pd.Series(np.broadcast_to(np.array([text], dtype=object), times), dtype=object, copy=False)


def planned(episodes: pd.DataFrame, column: str) -> int:
    """Sum one of the planned numbers over the runs of these episodes; 0 without launch records."""
    if column not in episodes:
        return 0
    runs = episodes.drop_duplicates("run_dir") if "run_dir" in episodes else episodes.iloc[:1]
    return int(runs[column].sum())


def episode_tables(run_dirs: Sequence[Path]) -> list[tuple[pa.Table, dict[str, object]]]:
    """Return, for each run, the records as its files hold them and the columns that `read_episodes` adds.

    Raises as `read_episodes` does.
    """
    return list(_tables(run_dirs))


def _tables(
    run_dirs: Sequence[Path], without: Collection[str] = ()
) -> Iterator[tuple[pa.Table, dict[str, object]]]:
    has_episodes = False
    run_dirs = [Path(run_dir) for run_dir in run_dirs]
    launches = [read_launch(run_dir) for run_dir in run_dirs]
    # Every key that some run has changed is a column of all.
    changed_keys = dict.fromkeys(key for launch in launches if launch for key in launch.changes[0])
    for run_dir, launch in zip(run_dirs, launches, strict=True):
        columns = {} if launch is None else _columns_of(launch, changed_keys)
        with log_of(run_dir) as log:
            tables = [episode_table(run_dir, log, without)]
        if not tables[0].num_rows:
            warnings.warn(f"{run_dir} has no finished episode yet: left out", stacklevel=3)
            continue
        missing_columns = ", ".join(sorted(REQUIRED - set(tables[0].column_names)))
        if missing_columns:
            raise InputError(
                f"records in {run_dir} lack the columns {missing_columns}: not written by lme eval"
            )
        has_episodes = True
        yield tables.pop(), {"run_dir": str(run_dir), **columns}  # which the caller alone holds then
    if not has_episodes:
        raise InputError(f"no finished episode yet in {', '.join(map(str, run_dirs))}")


def read_first(run_dir: Path) -> dict[str, Any]:
    """Return one record of a run that has some, by column: its labels are those of all. Raises as `read_episodes`."""
    if (run_dir / EPISODES).is_file():
        row = first_row(run_dir / EPISODES)
    else:
        with (run_dir / APPEND_LOG).open("rb") as lines:
            first_line = io.BytesIO(lines.readline())
        row = next(AppendLog(first_line, run_dir / APPEND_LOG).entries()).row
    known = {name: value for name, value in row.items() if value is not None}
    return {"people": str(DEFAULTS["people"]), **known}


def read_record(run_dir: Path, key: EpisodeKey) -> dict[str, Any]:
    """Return the record of one episode by column. Raises InputError if the run has none."""
    import pyarrow.compute as pc

    with log_of(run_dir) as log:
        table = episode_table(run_dir, log)
    rows = table.filter((pc.field("world") == key.world) & (pc.field("run") == key.run)).to_pylist()
    if not rows:
        raise InputError(f"{run_dir}: has no episode of {key}: {EPISODES} lists its episodes")
    record: dict[str, Any] = rows[0]
    return record


def read_trajectories(
    run_dirs: Sequence[Path], episodes: Collection[EpisodeKey] | None = None
) -> pd.DataFrame:
    """Read the trajectories of one or more runs, finished or not: one row per control step, with column `run_dir`.

    episodes: those to read of each run; None for all, which takes 9 kB of memory for an episode of 70 steps.
    """
    import pandas as pd

    frames = []
    for run_dir in map(Path, run_dirs):
        with log_of(run_dir) as log:
            table = trajectory_table(run_dir, log, episodes)
        frames.append(table.to_pandas().assign(run_dir=str(run_dir)))
    return pd.concat(frames, ignore_index=True)


def has_records(path: Path) -> bool:
    """Return whether the directory is that of a run with records."""
    return (path / EPISODES).is_file() or (path / APPEND_LOG).is_file()


def log_of(run_dir: Path) -> contextlib.AbstractContextManager[AppendLog]:
    """Open the append log of a run, finished or not. Raises InputError if no run is there or Arrow cannot open it."""
    try:
        str(run_dir).encode()
    except UnicodeEncodeError:
        raise InputError(f"{run_dir}: the name is not UTF-8: rename the folder") from None
    if not has_records(run_dir):
        raise InputError(f"{run_dir} has no records: expected {EPISODES} or {APPEND_LOG}")
    return read_log(run_dir / APPEND_LOG)


def _columns_of(launch: Launch, changed_keys: Iterable[str]) -> dict[str, object]:
    """Return the columns that a launch record adds to the episodes of its run.

    sim: the simulator. filter: that of the commands, if there is one. crowd: people added to the worlds, if any.
    scale: factors on parameters. ablated: the ablation in words, "without c_o". changes: keys whose values differ
    from those in the files of the chosen options, as text. Every key that some run has changed is a column too, by its
    dotted name. So are the numbers of worlds and episodes that the run was planned to drive, and the columns of
    `_likeness`.
    """
    config, choices = launch.configs[0], launch.choices[0]
    values, ablation = dict(flatten(config)), choices.get("ablation", "")
    return {
        "sim": choices.get("sim", ""),
        **{group: choices[group] for group in ("filter", "crowd") if config.get(group)},
        "scale": scale_in_words(config.get("scale", {})),
        ABLATED: describe_ablation(ablation, ablation_labels(launch.folders, [ablation])),
        **_likeness(launch),
        "changes": describe_changes(launch.changes[0]),
        **{key: value_text(values.get(key, "")) for key in changed_keys},
        **_planned(launch),
    }


def _planned(launch: Launch) -> dict[str, int]:
    """Return how many worlds and episodes a run of `lme eval` was to drive; a killed run has driven fewer."""
    if launch.command != "eval":
        return {}
    num_worlds, runs = launch.num_worlds, launch.configs[0].get("runs")
    if num_worlds is None:
        raise InputError(
            f"{launch.directory}: its {LAUNCH}, of an earlier lme, gives no num_worlds: drive it again"
        )
    if not isinstance(runs, int):
        raise InputError(
            f"{launch.directory}: its {LAUNCH} is damaged: runs is {runs!r}, must be a whole number"
        )
    return {PLANNED_WORLDS: num_worlds, PLANNED_EPISODES: num_worlds * runs}


def _likeness(launch: Launch) -> dict[str, str]:
    """Return the columns that identify robot and map by their values, whatever they are called.

    robot_like: names, separated by spaces, of the robots with the values of the run's own; see `robots_like`.
    robot_difference: difference from the shipped robot of its name. map_like: the shipped map set with the values of
    the run's own.
    """
    config, choices = launch.configs[0], launch.choices[0]
    nodes = json.dumps([node if isinstance(node, dict) else {} for node in map(config.get, ("robot", "map"))])
    return _likeness_of(nodes, launch.folders, choices.get("system", ""), choices.get("map", ""))


@lru_cache(maxsize=256)  # most runs of a sweep share robot and map
def _likeness_of(nodes: str, folders: tuple[Path, ...], system: str, map_option: str) -> dict[str, str]:
    """nodes: robot and map set of the config, in JSON."""
    robot, map_set = json.loads(nodes)
    settings = system_settings(system, Catalogue(folders)).get("robot")
    return {
        "robot_like": " ".join(robots_like(robot, folders, settings)),
        "robot_difference": robot_difference(robot, settings),
        "map_like": map_like(map_set, map_option, str(map_set.get("name") or "barn")),
    }
