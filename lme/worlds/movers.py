"""Moving obstacles: pedestrians and doors, on scripted or reactive paths."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lme.errors import InputError, argument_error, building, require
from lme.inputs import plausibility
from lme.inputs.yaml_entry import Entry
from lme.types import Floats

REPEATS = ("once", "back_and_forth", "cycle")
SCRIPTED, ORCA, SOCIAL_FORCE = "scripted", "orca", "social_force"
MOTIONS = (SCRIPTED, ORCA, SOCIAL_FORCE)
_NUMBERS = ("radius", "speed", "turn_rate_deg", "start_after", "starts_within", "waits_within")
_KEYS = (*_NUMBERS, "outline", "trigger", "repeat", "motion", "sees_robot")


@dataclass(frozen=True, slots=True, eq=False)
class Mover:
    """A solid shape that moves along waypoints: either a disc (radius) or a polygon (outline).

    path: (P, 3) poses [x, y, yaw] or (P, 2) positions [m, rad] with yaw 0; P ≥ 1. The mover waits at the first.
    It moves and turns evenly on each leg, for the longer of the times that `speed` and `turn_rate` need. Yaw is
    interpolated without wrapping (from 0 to 4 rad it turns by 4 rad), so two poses at its hinge make a door.
    outline: (V, 2) vertices in order [m] about the mover's origin, V ≥ 3.
    The mover starts as soon as `start_after` seconds of the episode have passed and, if `starts_within` is given,
    the robot's base is that near to `trigger`, or to the mover itself if there is no trigger.
    motion: "scripted" keeps to the path whatever is there. "orca" and "social_force" are people (discs): they walk
    from waypoint to waypoint around walls, each other and, if `sees_robot`, the robot (`lme.simulation.walkers`).
    times: (P,) rising times of a recorded track [s], instead of a speed; the mover is there only between them.
    Raises InputError for an invalid shape, path or number.
    """

    path: Floats
    radius: float | None = None  # [m], of a disc
    outline: Floats | None = None  # (V, 2) [m], of a polygon
    speed: float = 1.0  # [m/s]
    turn_rate: float = 1.0  # [rad/s]
    start_after: float = 0.0  # [s]
    starts_within: float | None = None  # [m] from the robot's base; None: starts whatever the robot does
    trigger: tuple[float, float] | None = None  # [m] the point that the robot must come near
    waits_within: float | None = None  # [m] it stops while the robot's base is this near before its centre
    repeat: str = "once"  # once | back_and_forth | cycle (from the last waypoint to the first)
    motion: str = SCRIPTED  # scripted | orca | social_force
    sees_robot: bool = True  # of people: they keep out of the robot's way as well
    times: Floats | None = None  # (P,) [s]

    def __post_init__(self) -> None:
        path = _rows(self.path, "path", (2, 3), 1)
        object.__setattr__(self, "path", path if path.shape[1] == 3 else np.pad(path, ((0, 0), (0, 1))))
        if (self.radius is None) == (self.outline is None):
            raise InputError("a mover needs either a radius (disc) or an outline (polygon)")
        if self.outline is not None:
            object.__setattr__(self, "outline", _rows(self.outline, "outline", (2,), 3))
        if self.repeat not in REPEATS:
            raise argument_error(f"repeat is {self.repeat!r}: must be {', '.join(REPEATS)}")
        for key in ("radius", "speed", "turn_rate", "starts_within", "waits_within"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)
        if self.radius is not None:
            plausibility.check_fields(self)
        require("start_after", self.start_after, at_least=0.0)
        if self.trigger is not None and self.starts_within is None:
            raise argument_error("trigger needs starts_within: how near to it the robot must come")
        if self.trigger is not None and (len(self.trigger) != 2 or not all(map(math.isfinite, self.trigger))):
            raise argument_error(f"trigger is {self.trigger}: must be x, y in metres")
        self._check_motion()
        if self.times is not None:
            object.__setattr__(self, "times", self._checked_times(self.times))

    @property
    def walks(self) -> bool:
        """Return whether the mover is a person who walks around obstacles."""
        return self.motion != SCRIPTED

    @property
    def reach(self) -> float:
        """Distance from the mover's origin to its furthest point [m]."""
        if self.outline is None:
            assert self.radius is not None
            return self.radius
        return float(np.hypot(*self.outline.T).max())

    def _check_motion(self) -> None:
        if self.motion not in MOTIONS:
            raise argument_error(f"motion is {self.motion!r}: must be {', '.join(MOTIONS)}")
        if self.walks and self.radius is None:
            raise argument_error(f"motion is {self.motion}: must be scripted for a mover with an outline")
        if self.walks and (self.starts_within, self.waits_within, self.times) != (None, None, None):
            raise argument_error(
                f"motion is {self.motion}: must be scripted for a mover with starts_within, waits_within or times"
            )

    def _checked_times(self, times: Floats) -> Floats:
        values = np.array(times, dtype=np.float64)
        if (
            values.shape != (len(self.path),)
            or len(values) < 2
            or not (np.diff(values) > 0.0).all()
            or values[0] < 0.0
        ):
            raise argument_error(
                f"times has {values.size} values for {len(self.path)} waypoints: must be rising times "
                "from 0 s on, one for each of at least two"
            )
        return values


def _rows(values: Floats, key: str, columns: tuple[int, ...], min_rows: int) -> Floats:
    """Return the values as an array. Raises InputError unless they are at least `min_rows` rows of finite numbers."""
    rows = np.array(values, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] not in columns or len(rows) < min_rows or not np.isfinite(rows).all():
        shape = " or ".join(map(str, columns))
        raise argument_error(
            f"{key} is {np.asarray(values).tolist()}: must be at least {min_rows} rows of {shape} finite numbers"
        )
    return rows


def mover_of(entry_name: str, item: object) -> Mover:
    """Build the mover that an entry of a file describes. Raises InputError, which begins with the name of the entry."""
    entry = Entry(entry_name, item, ["path"], _KEYS)
    arguments: dict[str, Any] = {key: entry.number(key) for key in _NUMBERS if entry.value(key) is not None}
    if "turn_rate_deg" in arguments:
        arguments["turn_rate"] = math.radians(arguments.pop("turn_rate_deg"))
    if entry.value("outline") is not None:
        arguments["outline"] = entry.points("outline", 3)
    if entry.value("trigger") is not None:
        arguments["trigger"] = tuple(entry.numbers("trigger", "x, y", 2))
    for key, names in (("repeat", REPEATS), ("motion", MOTIONS), ("sees_robot", (True, False))):
        if entry.value(key) is not None:
            arguments[key] = _one_of(entry, key, names)
    path = _entry_poses(entry)
    try:
        with building("mover"):
            return Mover(path=path, **arguments)
    except InputError as error:
        raise InputError(f"{entry_name}: {error}") from error


def _one_of(entry: Entry, key: str, names: Sequence[object]) -> Any:
    if entry.value(key) not in names:
        raise entry.mistake(key, f"one of {', '.join(map(str, names))}")
    return entry.value(key)


def _entry_poses(entry: Entry) -> Floats:
    """(P, 3) poses [m, rad] of a mover's path, given as [x, y] or [x, y, yaw_deg]."""
    rows = entry.value("path")
    if not isinstance(rows, list) or not rows:
        raise entry.mistake("path", "a list of positions [x, y] or poses [x, y, yaw_deg]")
    poses = np.zeros((len(rows), 3))
    for i, row in enumerate(rows):
        count = 2 if isinstance(row, list) and len(row) == 2 else 3
        pose = Entry(entry.place, {f"path[{i}]": row}, [f"path[{i}]"])
        poses[i, :count] = pose.numbers(f"path[{i}]", "x, y] or [x, y, yaw_deg", count)
    poses[:, 2] = np.radians(poses[:, 2])
    return poses
