"""Record of one episode, and the append log of a run: one line of JSON per finished episode.

The fields of `EpisodeRecord` are the columns of `episodes.parquet`, in the order of the file. A line of the log is
appended when the episode ends, and counts once its newline is on disk. Arrays are stored byte for byte, so an episode
that is read back equals the episode that was written.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import re
from array import array
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cache, partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError
from lme.types import Floats

CUSTOM_SUBSET = "custom"  # instead of the name of a subset, where the config names the worlds
APPEND_LOG = "parts/episodes.jsonl"
_BLOCK = 1 << 20  # bytes
_FOREIGN_BYTES = 2**20  # of a line that is not an episode, read to find its end
_LINE_BYTES = 2**28  # longest line of an episode; one of a million steps has about 2**27


@dataclass(frozen=True, slots=True, order=True)
class EpisodeKey:
    """An episode of a run: the number of its world, and its number among the episodes in that world."""

    world: int
    run: int

    def __str__(self) -> str:
        return f"world {self.world}, run {self.run}"

    @property
    def code(self) -> int:
        """World times 2³² plus run: one number, in the order of the keys."""
        return (self.world << 32) + self.run

    @classmethod
    def of_code(cls, code: int) -> Self:
        """Return the key with this code."""
        return cls(*divmod(code, 2**32))

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the key of a row of `episodes.parquet` or `trajectories.parquet`."""
        return cls(int(row["world"]), int(row["run"]))


class EpisodeKeys(Collection[EpisodeKey]):
    """Set of keys in 8 bytes each, a tenth of what a set of objects takes. codes: those of the keys, in any order."""

    def __init__(self, codes: ArrayLike) -> None:
        self.codes = np.unique(np.asarray(codes, dtype=np.int64))

    @classmethod
    def of(cls, keys: Iterable[EpisodeKey]) -> Self:
        """Return the set of these keys."""
        return cls([key.code for key in keys])

    def __contains__(self, key: object) -> bool:
        if not isinstance(key, EpisodeKey):
            return False
        position = int(np.searchsorted(self.codes, key.code))
        return position < len(self.codes) and int(self.codes[position]) == key.code

    def __iter__(self) -> Iterator[EpisodeKey]:
        return (EpisodeKey.of_code(int(code)) for code in self.codes)

    def __len__(self) -> int:
        return len(self.codes)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLabels:
    """Columns that name what was run; they are the same in all episodes of a run.

    people: the people that the system sees: truth, tracked or none.
    subset: that of the map's worlds; CUSTOM_SUBSET if the config names the worlds, empty for a map without subsets.
    """

    system: str
    guide: str
    planner: str
    global_map: str
    ablation: str
    weights: str
    robot: str
    map: str
    subset: str
    people: str


@dataclass(frozen=True, slots=True, kw_only=True)
class EpisodeRecord(RunLabels):
    """One row of `episodes.parquet`. `docs/reference/records.md` explains each column.

    world_measures: the map set's measures of the world; each is a column `world_NAME`. social: measures of a world with
    people; each is a column. Records of other worlds have no such columns.
    """

    world: int
    run: int
    seed: int
    outcome: str
    time_s: float
    optimal_time_s: float
    barn_metric: float
    path_length_m: float
    shortest_path_length_m: float
    spl: float
    steps: int
    switches: int
    no_free_candidate: int
    mean_abs_domega_radps: float
    min_clearance_m: float
    final_distance_m: float
    last_minute_m: float
    reversals: int
    collision_in_reverse: int
    contact_part: str
    start_x_m: float
    start_y_m: float
    start_yaw_rad: float
    goal_x_m: float
    goal_y_m: float
    goal_tolerance_m: float
    decision_us_p50: float
    decision_us_p99: float
    wall_s: float
    world_measures: Mapping[str, Any] = field(default_factory=dict)
    social: Mapping[str, float] = field(default_factory=dict)

    @property
    def key(self) -> EpisodeKey:
        """Key of the episode."""
        return EpisodeKey(self.world, self.run)

    def columns(self) -> dict[str, Any]:
        """Return the row by column name."""
        row = {name: getattr(self, name) for name in COLUMNS}
        return (
            row | {f"world_{name}": value for name, value in self.world_measures.items()} | dict(self.social)
        )


@dataclass(frozen=True, slots=True)
class EpisodeResult:
    """Result that a worker returns for one episode. trajectory: (T, 10), see `lme.navigation.episode.Episode`."""

    record: EpisodeRecord
    trajectory: Floats


KEY_COLUMNS = tuple(column.name for column in fields(EpisodeKey))
COLUMNS = tuple(
    column.name for column in fields(EpisodeRecord) if column.name not in ("world_measures", "social")
)
TEXTS = tuple(column.name for column in fields(EpisodeRecord) if column.type == "str")


class LogEntry(NamedTuple):
    """One line by column name. Another version of the program may have written it, with other columns.

    row: the episode's row of `episodes.parquet`. trajectory: 1-D arrays of equal length.
    """

    row: dict[str, Any]
    trajectory: dict[str, NDArray[Any]]

    @property
    def key(self) -> EpisodeKey:
        """Key of the episode."""
        return EpisodeKey.of(self.row)

    @property
    def steps(self) -> int:
        """Number of rows of the trajectory."""
        return len(next(iter(self.trajectory.values()), ()))


def entry_of(result: EpisodeResult) -> LogEntry:
    """Return the log entry of an episode."""
    from lme.navigation.episode import TRAJECTORY_COLUMNS

    return LogEntry(result.record.columns(), dict(zip(TRAJECTORY_COLUMNS, result.trajectory.T, strict=True)))


def encode(entry: LogEntry) -> bytes:
    """Encode an episode as a line. An array is [dtype, base64 of its bytes]: exact, and shorter than decimals."""
    arrays = {
        name: [array.dtype.str, base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()]
        for name, array in entry.trajectory.items()
    }
    line = {"record": entry.row, "trajectory": arrays}
    return json.dumps(line, default=lambda scalar: scalar.item()).encode() + b"\n"


class AppendLog:
    """Append log that is read in the order of the keys; if a key occurs twice, the first line counts.

    Memory holds only the key and the offset of each line. A last line without a newline is ignored.
    keys: of all lines. row_layouts: every combination of (name, Python type) in a row. layouts: every combination of
    (name, dtype) of trajectory columns.
    """

    def __init__(self, lines: BinaryIO, path: Path) -> None:
        """Index the lines. Raises InputError for a line that is not an episode."""
        self._lines, self._path = lines, path
        self.row_layouts: set[tuple[tuple[str, type], ...]] = set()
        self.layouts: set[tuple[tuple[str, str], ...]] = set()
        codes, starts = np.array(self._index(), dtype=np.int64).reshape(-1, 2).T
        self.keys = EpisodeKeys(codes)
        self._lines_of_keys = np.unique(codes, return_index=True)[1]  # the first line of each
        self._starts = starts[self._lines_of_keys]

    def entries(self, selected: EpisodeKeys | None = None) -> Iterator[LogEntry]:
        """Yield all entries, or the `selected` ones, in the order of the keys. Raises InputError."""
        is_selected = slice(None) if selected is None else np.isin(self.keys.codes, selected.codes)
        for number, start in zip(self._lines_of_keys[is_selected], self._starts[is_selected], strict=True):
            self._lines.seek(start)
            yield _decode(self._lines.readline(), self._path, int(number) + 1)

    def _index(self) -> array[int]:
        index, start = array("q"), 0
        for number, first_byte in enumerate(iter(partial(self._lines.readline, 1), b""), start=1):
            max_bytes = _LINE_BYTES if first_byte == b"{" else _FOREIGN_BYTES
            line = first_byte if first_byte == b"\n" else first_byte + self._lines.readline(max_bytes)
            if not line.endswith(b"\n") and len(line) <= max_bytes:
                break
            with _name_bad_line(self._path, number):
                fields = json.loads(line.decode())  # of bytes it guesses the encoding, at length for zeros
                index.extend((EpisodeKey.of(fields["record"]).code, start))
                self.row_layouts.add(_row_layout(fields["record"]))
                self.layouts.add(_layout(fields["trajectory"]))
            start += len(line)
        return index


@contextlib.contextmanager
def read_log(path: Path) -> Iterator[AppendLog]:
    """Give the append log at `path`; an empty one if there is none. Raises InputError as `AppendLog` does."""
    with path.open("rb") if path.is_file() else io.BytesIO() as lines:
        yield AppendLog(lines, path)


def _decode(line: bytes, path: Path, number: int) -> LogEntry:
    with _name_bad_line(path, number):
        fields = json.loads(line.decode())  # of bytes it guesses the encoding, at length for zeros
        arrays = {
            name: np.frombuffer(base64.b64decode(data), dtype=_dtype(kind))
            for name, (kind, data) in fields["trajectory"].items()
        }
        if len(set(map(len, arrays.values()))) > 1:
            raise ValueError("columns of different lengths")
        _check(fields["record"])
        return LogEntry(fields["record"], arrays)


def _row_layout(row: dict[str, Any]) -> tuple[tuple[str, type], ...]:
    """Return names and types of the values. Raises ValueError or TypeError for names that Parquet cannot hold."""
    "".join(row).encode()  # JSON may hold half characters
    return tuple((name, type(value)) for name, value in row.items())


def _layout(trajectory: dict[str, tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Return names and types of the columns. Raises ValueError or TypeError for what Parquet cannot hold."""
    "".join(trajectory).encode()  # JSON may hold half characters
    return tuple((name, _dtype(kind).str) for name, (kind, _) in trajectory.items())


@cache  # asked for every column of every line
def _dtype(kind: str) -> np.dtype[Any]:
    # NumPy would parse a string with a comma as a structured type.
    if not re.fullmatch(r"[<>|=]?[fiu]\d\d?", kind):
        raise ValueError(f"{kind} is not a type of number")
    return np.dtype(kind)


def _check(row: dict[str, Any]) -> None:
    """Raise TypeError or ValueError unless the values have the types that `encode` writes."""
    for name, value in row.items():
        kind = str if name in TEXTS else int | float if name in COLUMNS else str | int | float
        if value is not None and not isinstance(value, kind):
            raise TypeError(f"{name} is {value!r}")
        if isinstance(value, int) and abs(value) >= 2**63:
            raise ValueError(f"{name} is too large")
    texts = [value for value in row.values() if isinstance(value, str)]
    "".join([*row, *texts]).encode()  # JSON may hold half characters, Parquet may not


@contextlib.contextmanager
def _name_bad_line(path: Path, number: int) -> Iterator[None]:
    """Raise InputError, which names the line, if the block finds that it is not an episode."""
    try:
        yield
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        raise InputError(f"{path} line {number} is not an episode record: remove that line") from None


def cut_torn_line(path: Path) -> None:
    """Remove a last line without a newline, left by a killed run; the next line would be joined to it."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        size = complete_size = file.seek(0, os.SEEK_END)
        while complete_size > 0:
            block_start = max(0, complete_size - _BLOCK)
            file.seek(block_start)
            newline = file.read(complete_size - block_start).rfind(b"\n")
            if newline >= 0:
                complete_size = block_start + newline + 1
                break
            complete_size = block_start
            if size - complete_size > _LINE_BYTES:
                raise InputError(
                    f"{path}: its last line has more than {_LINE_BYTES} bytes: restore or remove it"
                )
    if complete_size < size:
        os.truncate(path, complete_size)


def lock(file: Any, run_dir: Path) -> None:
    """Lock an open file so that only one process writes the run. The lock ends with the process.

    Raises InputError, naming `run_dir`, if another process holds the lock.
    """
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError(
            f"{run_dir} is being written by another process: wait for it, or choose another hydra.run.dir"
        ) from None
