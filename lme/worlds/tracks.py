"""Recorded people: the tracks of ETH, UCY and others in their common text format, replayed around the robot.

A line is `frame id x y`, separated by white space or commas; x and y in metres. The people walk as they did, whatever
the robot does. Pellegrini, Ess, Schindler and van Gool 2009, DOI 10.1109/ICCV.2009.5459260; Lerner, Chrysanthou and
Lischinski 2007, DOI 10.1111/j.1467-8659.2007.01089.x. The recordings do not ship with lme.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from lme.errors import InputError, argument_error, require
from lme.inputs.guarded_file import read_text
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.rules import PacedRules, check_chosen, check_numbers, map_path
from lme.worlds.world import Task, World

MOST_BEGINNINGS = 100_000
CLEAR = 1.0  # [m] least distance of people from the robot's start at first

_COLUMNS = "frame id x y"
_LOST = 2.0  # [s] after a longer gap, an id counts as another person
_WALKING = (0.2, 2.0)  # [m/s] slower is standing, and a faster median is a mistake in the units
_USUAL_SPEED, _USUAL_STEP = 1.3, 0.4  # [m/s], [s] of people, and between the frames of most recordings
_WIDEST = 200.0  # [m] of a recorded area


@dataclass(slots=True)
class RecordedPeopleConfig(PacedRules):
    """Keys of `conf/map/tracks.yaml`."""

    path: str | None
    name: str | None
    frame_rate: float
    every: float
    start: list[float] | None
    goal: list[float] | None
    body_radius: float

    def __post_init__(self) -> None:
        PacedRules.__post_init__(self)  # super() fails in a dataclass with slots
        for key in ("frame_rate", "every", "body_radius"):
            require(key, getattr(self, key), above=0.0)
        for key in ("start", "goal"):
            if getattr(self, key) is not None:
                check_numbers(key, getattr(self, key), (2,), "x, y in metres, or null")


class RecordedPeople:
    """A recording replayed from different times on: world n begins n × `every` after the first frame.

    Worlds at whose beginning someone stands where the robot starts are left out. There are no walls: the recordings
    have none.
    """

    Config = RecordedPeopleConfig

    def __init__(self, config: RecordedPeopleConfig) -> None:
        """Read the recording. Raises InputError for a missing or wrong file, and if no world is left."""
        if config.path is None:
            raise argument_error(f"path is null: must be a file with lines of {_COLUMNS}")
        path = map_path(config.path, f"a file with lines of {_COLUMNS}")
        self.config = config
        self.name = config.name or path.stem
        # By default, the robot crosses the recorded area in the direction of x, in the middle of y.
        self._tracks = _read(path, path.stat().st_mtime_ns, config.frame_rate)
        positions = np.vstack([track[:, 1:] for track in self._tracks])
        (x0, y0), (x1, y1) = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
        self._start = np.array(config.start or [x0, (y0 + y1) / 2])
        self._goal = np.array(config.goal or [x1, (y0 + y1) / 2])
        end_time = max(track[-1, 0] for track in self._tracks)
        if not end_time / config.every <= MOST_BEGINNINGS:
            raise InputError(
                f"{path}: lasts {end_time:.4g} s at frame_rate {config.frame_rate:g}: must have at most "
                f"{MOST_BEGINNINGS} beginnings, one every {config.every:g} s"
            )
        # Offer only worlds at whose beginning nobody stands where the robot starts.
        self._spans = np.array([track[[0, -1], 0] for track in self._tracks])
        offered = [
            number for number in range(math.ceil(end_time / config.every - 1e-9)) if self._is_clear(number)
        ]
        if not offered:
            raise argument_error(
                f"start is {self._start.tolist()}: must be a place where nobody stands at first"
            )
        self.numbers = config.numbers(offered)
        if not set(self.numbers) <= set(offered):
            raise argument_error(
                f"worlds is {list(self.numbers)}: must be of {', '.join(map(str, offered))}, at whose beginning "
                f"nobody is within {CLEAR:g} m of the start"
            )

    def task(self, number: int) -> Task:
        """Build the task of beginning `number`. Raises InputError for one that was not chosen."""
        check_chosen(number, self.numbers, "world", self.name)
        config = self.config
        displacement = self._goal - self._start
        x, y = self._start.tolist()
        length = float(np.hypot(*displacement))
        people = self._people(number, config.limit(length))
        return config.task(
            self.name,
            number,
            World(movers=people),
            Pose(x, y, math.atan2(displacement[1], displacement[0])),
            self._goal.copy(),
            length=length,
            speed=config.pace,
            measures={"people": float(len(people))},
        )

    def _people(self, number: int, time_limit: float) -> tuple[Mover, ...]:
        """People who are there between the beginning and the time limit [s]."""
        begin = number * self.config.every
        cut = (_from_time(track, begin) for track in self._tracks)
        radius = self.config.body_radius
        return tuple(
            Mover(path=track[:, 1:], times=track[:, 0], radius=radius)
            for track in cut
            if len(track) > 1 and track[0, 0] < time_limit
        )

    def _is_clear(self, number: int) -> bool:
        begin = number * self.config.every
        present = np.flatnonzero((self._spans[:, 0] <= begin) & (begin < self._spans[:, 1]))
        tracks = (_from_time(self._tracks[number], begin) for number in present)
        return all(math.dist(track[0, 1:], self._start) > CLEAR for track in tracks)


def _from_time(track: Floats, begin: float) -> Floats:
    """The part of a track (N, 3) of t, x, y after a time, with that time as 0."""
    remaining = track[track[:, 0] > begin]
    if track[0, 0] <= begin < track[-1, 0]:
        position = [np.interp(begin, track[:, 0], track[:, axis]) for axis in (1, 2)]
        remaining = np.vstack([[begin, *position], remaining])
    return np.asarray(remaining - [begin, 0.0, 0.0])


@lru_cache(maxsize=8)
def _read(path: Path, _modified: int, frame_rate: float) -> tuple[Floats, ...]:
    """Tracks (N, 3) of t [s], x, y [m], N ≥ 2, from the first frame on, in the order of the ids.

    _modified: part of the key, so that an edited file is read again. Raises InputError.
    """
    rows = _rows(path)
    times = (rows[:, 0] - rows[:, 0].min()) / frame_rate
    order = np.lexsort((times, rows[:, 1]))
    # Sorted by id and then by time, the rows of an id are a track, or several where it was lost for long.
    persons = np.flatnonzero(np.diff(rows[order, 1])) + 1
    tracks: list[Floats] = []
    for lines in np.split(order, persons):
        track, person = np.column_stack([times[lines], rows[lines, 2:]]), rows[lines[0], 1]
        if (np.diff(track[:, 0]) <= 0.0).any():
            raise InputError(f"{path}: id {person:g} is twice in a frame; must be once")
        tracks += np.split(track, np.flatnonzero(np.diff(track[:, 0]) > _LOST) + 1)
    long_tracks = tuple(track for track in tracks if len(track) > 1)
    if not long_tracks:
        raise InputError(
            f"{path}: nobody is in two frames{_apart(tracks, frame_rate)}; must hold lines of {_COLUMNS}"
        )
    _warn_of_units(path, long_tracks, frame_rate)
    return long_tracks


def _apart(tracks: Sequence[Floats], frame_rate: float) -> str:
    """Explain that tracks fell apart into single frames by the frame rate; empty if that is not the reason."""
    gaps = np.diff([track[0, 0] for track in tracks])
    gaps = gaps[gaps > _LOST]
    if not len(gaps):
        return ""
    step = float(np.median(gaps))
    return (
        f" within {_LOST:g} s (they are {step:.3g} s apart at frame_rate {frame_rate:g}; "
        f"{frame_rate * step / _USUAL_STEP:.3g} would make that {_USUAL_STEP:g} s)"
    )


def _warn_of_units(path: Path, tracks: Sequence[Floats], frame_rate: float) -> None:
    """Warn of people who run and of an area that is too wide: then the frame rate or the unit is wrong."""
    steps = np.vstack([np.diff(track, axis=0) for track in tracks])
    speeds = np.hypot(steps[:, 1], steps[:, 2]) / steps[:, 0]
    walking = speeds[speeds > _WALKING[0]]
    speed = float(np.median(walking)) if len(walking) else 0.0
    positions = np.vstack([track[:, 1:] for track in tracks])
    width, height = np.ptp(positions, axis=0).tolist()
    if max(width, height) > _WIDEST:
        warnings.warn(
            f"{path}: people walk in {width:.4g} by {height:.4g} m, at {speed:.3g} m/s (median): positions must be in "
            f"metres, not in pixels, centimetres or millimetres; at {_USUAL_SPEED:g} m/s the unit of the file would be "
            f"{_USUAL_SPEED / max(speed, _WALKING[0]):.2g} m",
            stacklevel=2,
        )
    elif speed > _WALKING[1]:
        warnings.warn(
            f"{path}: people walk at {speed:.3g} m/s (median) with frame_rate={frame_rate:g}: "
            f"{frame_rate * _USUAL_SPEED / speed:.3g} would make that {_USUAL_SPEED:g} m/s; the columns must be "
            f"{_COLUMNS}",
            stacklevel=2,
        )


def _rows(path: Path) -> Floats:
    """Read the numbers of the file as (N, 4). Raises InputError that names the line."""
    try:
        lines = read_text(path).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}: cannot be read ({error}); must be a text file with lines of {_COLUMNS}"
        ) from error
    rows = []
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 4 or not all(map(math.isfinite, row)):
            raise InputError(f"{path}, line {number}: {line.strip()[:60]!r} must be four numbers: {_COLUMNS}")
        rows.append(row)
    if not rows:
        raise InputError(f"{path}: is empty; must hold lines of {_COLUMNS}")
    return np.array(rows)
