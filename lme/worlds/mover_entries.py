"""Movers in shape and scene files. Angles are in degrees: poses of `path` [x, y, yaw_deg], `turn_rate_deg`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from lme.errors import InputError
from lme.types import Floats
from lme.worlds.movers import MOTIONS, REPEATS, Mover
from lme.yaml_entry import Entry

_NUMBERS = ("radius", "speed", "turn_rate_deg", "start_after", "starts_within", "waits_within")
_KEYS = (*_NUMBERS, "outline", "trigger", "repeat", "motion", "sees_robot")


def mover_of(place: str, item: object) -> Mover:
    """The mover that an entry of a file describes. Raises InputError, which begins with `place`."""
    entry = Entry(place, item, ["path"], _KEYS)
    given: dict[str, Any] = {key: entry.number(key) for key in _NUMBERS if entry.value(key) is not None}
    if "turn_rate_deg" in given:
        given["turn_rate"] = math.radians(given.pop("turn_rate_deg"))
    if entry.value("outline") is not None:
        given["outline"] = entry.points("outline", 3)
    if entry.value("trigger") is not None:
        given["trigger"] = tuple(entry.numbers("trigger", "x, y", 2))
    for key, names in (("repeat", REPEATS), ("motion", MOTIONS), ("sees_robot", (True, False))):
        if entry.value(key) is not None:
            given[key] = _one_of(entry, key, names)
    try:
        return Mover(path=_poses(entry), **given)
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


def _one_of(entry: Entry, key: str, names: Sequence[object]) -> Any:
    if entry.value(key) not in names:
        raise entry.mistake(key, f"one of {', '.join(map(str, names))}")
    return entry.value(key)


def _poses(entry: Entry) -> Floats:
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
