"""Check what a guide, planner, filter, criterion, simulator or source of people returns, once, where lme takes it.

Each of them may be a user's own. The message names its class or function by the dotted path, what is wrong, and how
many values are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Set
from typing import Any

import numpy as np

from lme.errors import InputError
from lme.types import Floats, Guidance, LaserScan, Observation, Twist

_NO_NUMBER = (str, bytes, bool, np.bool_)
_REAL = "fiub"  # kinds of NumPy's dtypes that hold real numbers


class ReturnedError(InputError):
    """A guide, planner, filter, criterion, simulator or source of people returned something that cannot be used."""


def dotted_name(thing: Any) -> str:
    """The dotted path of a function, or of the class of an object."""
    named = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{named.__module__}.{named.__qualname__}"


def checked_command(command: object, planner: object) -> Twist:
    """The command of a planner or filter. Raises ReturnedError unless it is a pair of finite numbers."""
    v = omega = math.nan
    if not isinstance(command, str | bytes | Mapping | Set):
        try:
            first, second = command  # type: ignore[misc]  # checked by trying
            if not isinstance(first, _NO_NUMBER) and not isinstance(second, _NO_NUMBER):
                v, omega = float(first), float(second)
        except (TypeError, ValueError, OverflowError):
            pass
    if not (math.isfinite(v) and math.isfinite(omega)):
        raise ReturnedError(
            f"{dotted_name(planner)}.plan returned {_shown(command)}: "
            "must be (v [m/s], omega [rad/s]), both finite numbers"
        )
    return Twist(v, omega)


def checked_guidance(guidance: object, guide: object) -> Guidance:
    """The guidance of a guide, with arrays of floats. Raises ReturnedError unless planners can follow it."""
    source = f"{dotted_name(guide)}.guide"
    if not isinstance(guidance, Guidance):
        raise ReturnedError(f"{source} returned {_shown(guidance)}: must be an lme.Guidance")
    subgoal, path, switched, blocked, points, way = guidance
    for name, flag in (("switched", switched), ("blocked", blocked)):
        if flag is not True and flag is not False and not isinstance(flag, np.bool_):
            raise ReturnedError(f"{source} returned {name}={_shown(flag)}: must be True or False")
    checked = (
        checked_array(subgoal, (2,), f"{source} returned a subgoal", "(x, y) in the robot's frame [m]"),
        None if path is None else _places(path, f"{source} returned a path"),
        None if points is None else _places(points, f"{source} returned points"),
        None if way is None else _places(way, f"{source} returned a way"),
    )
    if path is not None and not len(checked[1]):
        raise ReturnedError(f"{source} returned a path without points: must have one, or be None")
    if all(new is old for new, old in zip(checked, (subgoal, path, points, way), strict=True)):
        return guidance
    return Guidance(checked[0], checked[1], switched, blocked, checked[2], checked[3])


def checked_values(values: object, number: int, criterion: object) -> Floats:
    """The values of a criterion for `number` candidates. Raises ReturnedError unless each is a finite number."""
    return checked_array(
        values, (number,), f"{dotted_name(criterion)} returned values", "a number for each candidate"
    )


def checked_people(observation: object, source: object) -> Observation:
    """The observation of a source of people. Raises ReturnedError unless its pedestrians are (P, 4) finite numbers."""
    name = f"{dotted_name(source)}.seen"
    if not isinstance(observation, Observation):
        raise ReturnedError(f"{name} returned {_shown(observation)}: must be an lme.Observation")
    wanted = "(x [m], y [m], vx [m/s], vy [m/s]) of each person"
    pedestrians = checked_array(observation.pedestrians, (None, 4), f"{name} returned pedestrians", wanted)
    return (
        observation
        if pedestrians is observation.pedestrians
        else observation._replace(pedestrians=pedestrians)
    )


def checked_observation(observation: object, state: Any, simulator: object) -> Observation:
    """The observation of a simulator. Raises ReturnedError unless a navigator can use it and its state is finite.

    state: the `lme.sim.simulator.State` after it.
    """
    name = dotted_name(simulator)
    checked_array(
        (*state.pose, state.time),
        (4,),
        f"{name} has a state",
        "a pose (x [m], y [m], yaw [rad]) and a time [s]",
    )
    if not isinstance(observation, Observation):
        raise ReturnedError(f"{name} returned {_shown(observation)}: must be an lme.Observation")
    scan = observation.scan
    if not isinstance(scan, LaserScan):
        raise ReturnedError(f"{name} returned the scan {_shown(scan)}: must be an lme.LaserScan")
    ranges = np.asarray(scan.ranges)
    if ranges.ndim != 1 or ranges.dtype.kind not in "fiu":
        raise ReturnedError(
            f"{name} returned a scan with ranges {_kind(ranges)}: must be (num_beams,) numbers [m]"
        )
    checked_array(scan[1:], (4,), f"{name} returned a scan with angles and limits", "finite numbers")
    target = checked_array(
        observation.target, (2,), f"{name} returned a target", "(x, y) in the robot's frame [m]"
    )
    checked_array(observation.twist, (2,), f"{name} returned a twist", "(v [m/s], omega [rad/s])")
    checked_array(observation.odometry, (3,), f"{name} returned odometry", "(x [m], y [m], yaw [rad])")
    return observation if target is observation.target else observation._replace(target=target)


def _places(value: object, what: str) -> Floats:
    return checked_array(value, (None, 2), what, "rows of (x, y) in the robot's frame [m]")


def checked_array(value: object, shape: tuple[int | None, ...], what: str, wanted: str) -> Floats:
    """The value as an array of finite floats: itself if it is one. shape: None for any number."""
    if type(value) is np.ndarray and value.dtype == np.float64 and value.flags.c_contiguous:
        array: Floats = value
    else:
        array = _as_floats(value, shape, what, wanted)
    given = array.shape
    if len(given) != len(shape) or any(n not in (None, m) for n, m in zip(shape, given, strict=True)):
        raise ReturnedError(f"{what} of shape {given}: must be {wanted}, of shape {_shape(shape)}")
    if len(given) == 1 and given[0] == 2:
        x, y = array.tolist()  # quicker than NumPy for two numbers
        finite = math.isfinite(x) and math.isfinite(y)
    else:
        finite = bool(np.isfinite(array).all())
    if not finite:
        bad = int(np.count_nonzero(~np.isfinite(array)))
        raise ReturnedError(
            f"{what} of which {bad} of {array.size} are not finite: must be {wanted}, all finite"
        )
    return array


def _as_floats(value: object, shape: tuple[int | None, ...], what: str, wanted: str) -> Floats:
    """Real numbers of any other kind as floats. Strings that spell numbers are none."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):  # rows of different lengths
        array = np.array(None)
    if array.dtype.kind not in _REAL:
        raise ReturnedError(
            f"{what} {_shown(value)}: must be {wanted}, real numbers of shape {_shape(shape)}"
        )
    return np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)


def _shape(shape: tuple[int | None, ...]) -> str:
    return str(tuple("any" if n is None else n for n in shape)).replace("'any'", "N")


def _kind(array: Any) -> str:
    return f"of type {array.dtype} and shape {array.shape}"


def _shown(value: object) -> str:
    """A value for a message: what it is, and no more of it than fits into a line."""
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"an array {_kind(value)}"
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
