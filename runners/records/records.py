"""Episode records on disk: appended one line at a time, folded into two Parquet files at the end.

While a run lasts, each finished episode is one line of `parts/episodes.jsonl`. `RecordWriter.merge` folds
them into `episodes.parquet` and `trajectories.parquet` and removes the parts. Whatever the moment a run was
killed at, every episode is in one of the two places, or in both; whoever reads takes the union.
"""

from __future__ import annotations

import contextlib
import errno
import os
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError
from runners.config.flatten import flatten
from runners.records.append_log import (
    PARTS,
    Episode,
    Key,
    Record,
    Trajectory,
    cut_torn_line,
    encode,
    lock,
    read_parts,
)

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

EPISODES = "episodes.parquet"
TRAJECTORIES = "trajectories.parquet"

KEY = ("world", "run")
TIMING_COLUMNS = ("decision_us_p50", "decision_us_p99", "wall_s")
COLUMNS = (  # their order in the file; others follow, by name
    *("system", "guide", "planner", "global_map"),
    *("ablation", "weights", "robot", "map", "subset", *KEY, "seed", "outcome"),
    *("time_s", "optimal_time_s", "barn_metric", "path_length_m", "shortest_path_length_m", "spl"),
    *("steps", "switches", "no_free_candidate", "min_clearance_m", "final_distance_m"),
    *("start_x_m", "start_y_m", "start_yaw_rad", "goal_x_m", "goal_y_m", "goal_tolerance_m", "reward"),
    *TIMING_COLUMNS,
)
TRAJECTORY_COLUMNS = (
    *(*KEY, "step", "time_s", "x_m", "y_m", "yaw_rad", "v_mps", "omega_radps"),
    *("subgoal_x_m", "subgoal_y_m", "switched", "clearance_m"),
)
REQUIRED = frozenset({*KEY, "system", "outcome"})

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class RecordsWriteError(OSError):
    """The disk took no more. The message is one line; whatever was recorded before is still there."""


class RecordWriter:
    """Appends finished episodes to a run directory, continuing whatever is there already.

    Use as a context manager. Only one process can hold a run directory at a time. Raises InputError where
    the directory cannot be written or is held by another process.
    """

    def __init__(self, run_dir: Path) -> None:
        self._run_dir = Path(run_dir)
        self._parts = self._run_dir / PARTS
        self._file: Any = None
        self._done: set[Key] = set()

    def __enter__(self) -> RecordWriter:
        try:
            self._parts.parent.mkdir(parents=True, exist_ok=True)
            # Unbuffered: a line that append() returned from survives SIGKILL.
            self._file = self._parts.open("ab", buffering=0)
        except OSError as error:
            raise InputError(
                f"cannot write to the output directory {self._run_dir} ({error.strerror}): "
                "choose another with hydra.run.dir=PATH"
            ) from None
        try:
            lock(self._file, self._run_dir)
            cut_torn_line(self._parts)
            self._done = self.done()
        except BaseException:
            self._file.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def done(self) -> set[Key]:
        """(world, run) of every episode recorded so far, folded or not."""
        path = self._run_dir / EPISODES
        folded = _read_parquet(path, columns=list(KEY)).to_pylist() if path.is_file() else []
        return {(row["world"], row["run"]) for row in folded} | {part.key for part in read_parts(self._parts)}

    def append(self, record: Record, trajectory: Trajectory) -> None:
        """Add one finished episode; one that is there already stays as it is.

        trajectory: equal-length 1-D arrays by name. Raises RecordsWriteError when the disk is full.
        """
        key = record["world"], record["run"]
        if key in self._done:
            return
        line = encode(record, trajectory)
        kept = os.fstat(self._file.fileno()).st_size
        try:
            while line:
                line = line[self._file.write(line) :]
        except OSError as error:
            with contextlib.suppress(OSError):
                self._file.truncate(kept)
            raise _write_error(self._parts, error, len(self._done)) from None
        self._done.add(key)

    def merge(self) -> None:
        """Fold the parts into the two Parquet files, sorted by (world, run), and remove the parts.

        The result depends on the episodes alone, not on the order they finished in or on how often the run
        was resumed. Each file is replaced at once or not at all. Raises RecordsWriteError.
        """
        parts = list(read_parts(self._parts))
        if parts:
            # Trajectories first: an episode is complete once it is in the other file.
            _replace(self._run_dir / TRAJECTORIES, _trajectory_table(self._run_dir, parts), len(self._done))
            _replace(self._run_dir / EPISODES, _episode_table(self._run_dir, parts), len(self._done))
        with contextlib.suppress(OSError):
            self._file.truncate(0)
            self._parts.unlink()
            self._parts.parent.rmdir()


def find_runs(paths: Iterable[Path]) -> list[Path]:
    """Run directories among `paths`, or right below them where a path is the directory of a sweep.

    Numbered folders come in numerical order. Raises InputError for a path without records.
    """
    runs: list[Path] = []
    for path in map(Path, paths):
        below = sorted(path.iterdir(), key=_natural_order) if path.is_dir() else []
        found = [path] if _has_records(path) else [child for child in below if _has_records(child)]
        if not found:
            problem = "holds no records" if path.is_dir() else "is not a directory"
            raise InputError(
                f"{path} {problem}: give a run directory ({EPISODES} or {PARTS} in it) or a sweep's"
            )
        runs.extend(run for run in found if run not in runs)
    return runs


def read_episodes(run_dirs: Sequence[Path]) -> pd.DataFrame:
    """Records of one or more runs, finished or not: one row per episode, and `run_dir`.

    Config keys that differ between the runs become columns under their dotted names.
    Raises InputError for a file that is missing or is no record file.
    """
    import pandas as pd

    frames = []
    run_dirs = [Path(run_dir) for run_dir in run_dirs]
    for run_dir, differing in zip(run_dirs, _differing_keys(run_dirs), strict=True):
        table = _episode_table(run_dir, _parts_of(run_dir))
        if table.num_rows == 0:
            warnings.warn(f"{run_dir} holds no finished episode yet: left out", stacklevel=2)
            continue
        missing = ", ".join(sorted(REQUIRED - set(table.column_names)))
        if missing:
            raise InputError(f"records in {run_dir} lack the columns {missing}: not written by lme eval")
        frame = table.to_pandas()
        constants = {"run_dir": str(run_dir), **differing}
        frames.append(frame.assign(**{key: constants[key] for key in constants if key not in frame}))
    if not frames:
        raise InputError(f"no finished episode yet in {', '.join(map(str, run_dirs))}")
    return pd.concat(frames, ignore_index=True)


def read_trajectories(run_dirs: Sequence[Path]) -> pd.DataFrame:
    """Trajectories of one or more runs, finished or not: one row per control step, and `run_dir`."""
    import pandas as pd

    frames = [
        _trajectory_table(run_dir, _parts_of(run_dir)).to_pandas().assign(run_dir=str(run_dir))
        for run_dir in map(Path, run_dirs)
    ]
    return pd.concat(frames, ignore_index=True)


def _has_records(path: Path) -> bool:
    return (path / EPISODES).is_file() or (path / PARTS).is_file()


def _natural_order(path: Path) -> tuple[bool, int, str]:
    return not path.name.isdigit(), int(path.name) if path.name.isdigit() else 0, path.name


def _parts_of(run_dir: Path) -> list[Episode]:
    if not _has_records(run_dir):
        raise InputError(f"{run_dir} holds no records: expected {EPISODES} or {PARTS}")
    return list(read_parts(run_dir / PARTS))


def _episode_table(run_dir: Path, parts: list[Episode]) -> pa.Table:
    """Records folded before and those in parts, sorted; a key that is in both counts once."""
    import pyarrow as pa

    path = run_dir / EPISODES
    rows = _read_parquet(path).to_pylist() if path.is_file() else []
    by_key = {(row["world"], row["run"]): row for row in [*(part.record for part in reversed(parts)), *rows]}
    ordered = [by_key[key] for key in sorted(by_key)]
    names = _in_order({name for row in ordered for name in row}, COLUMNS)
    return pa.table({name: [row.get(name) for row in ordered] for name in names})


def _trajectory_table(run_dir: Path, parts: list[Episode]) -> pa.Table:
    """Control steps folded before and those in parts, sorted; a key that is in both counts once."""
    import pyarrow as pa

    path = run_dir / TRAJECTORIES
    tables = [_read_parquet(path)] if path.is_file() else []
    folded = {(row["world"], row["run"]) for table in tables for row in table.select(list(KEY)).to_pylist()}
    for episode in parts:
        if episode.key not in folded and episode.trajectory:
            steps = np.arange(len(next(iter(episode.trajectory.values()))))
            world, run = (np.full(len(steps), number) for number in episode.key)
            tables.append(pa.table({"world": world, "run": run, "step": steps, **episode.trajectory}))
    if not tables:
        return pa.table({name: [] for name in TRAJECTORY_COLUMNS})
    joined = pa.concat_tables(tables, promote_options="default")
    joined = joined.select(_in_order(set(joined.column_names), TRAJECTORY_COLUMNS))
    return joined.sort_by([(name, "ascending") for name in (*KEY, "step")]).combine_chunks()


def _in_order(names: set[str], known: Sequence[str]) -> list[str]:
    return [name for name in known if name in names] + sorted(names - set(known))


def _read_parquet(path: Path, columns: list[str] | None = None) -> pa.Table:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        # ParquetFile, not read_table: the folder's name must not be taken for a partition key.
        with pq.ParquetFile(path) as file:
            missing = set(KEY) - set(file.schema_arrow.names)
            table = file.read(columns=columns)
    except (pa.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} is not a readable Parquet file: {reason}; restore or remove it") from None
    if missing:
        raise InputError(f"{path} lacks the columns {', '.join(sorted(missing))}: not a file of lme eval")
    return table


def _replace(path: Path, table: pa.Table, kept: int) -> None:
    """Write beside `path`, then take its place: a reader sees the old file or the new one, never half."""
    import pyarrow.parquet as pq

    temporary = path.with_name(f".{path.name}.tmp")
    try:
        with temporary.open("wb") as file:
            pq.write_table(table, file)
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise _write_error(path, error, kept) from None


def _write_error(path: Path, error: OSError, kept: int) -> RecordsWriteError:
    cause = "disk full while writing" if error.errno in _FULL else f"{error.strerror or error} while writing"
    return RecordsWriteError(f"{cause} {path}: {kept} episodes are kept; free some space and add resume=true")


def _differing_keys(run_dirs: Sequence[Path]) -> list[dict[str, str]]:
    """For each run, the config keys that are not the same in all of them, and what they are there.

    Keys that are recorded as columns anyway (`map.subset` as `subset`) are left out. Factors on parameters are
    one column, `scale`, even where all runs have the same: records of scaled parameters must not pass for plain ones.
    """
    from runners.config.weights import in_words
    from runners.records.run_directories import read_launch

    launches = [read_launch(run_dir) for run_dir in run_dirs]
    configs = [dict(flatten(launch.configs[0])) if launch else {} for launch in launches]
    keys = dict.fromkeys(key for config in configs for key in config)
    differing = [
        key
        for key in keys
        if key.rpartition(".")[2] not in COLUMNS
        and not key.startswith("scale.")
        and any(config.get(key) != configs[0].get(key) for config in configs)
    ]
    scales = [in_words(launch.configs[0].get("scale", {})) if launch else "" for launch in launches]
    return [
        {**({"scale": scale} if any(scales) else {}), **{key: str(config.get(key, "")) for key in differing}}
        for scale, config in zip(scales, configs, strict=True)
    ]
