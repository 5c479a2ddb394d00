"""Check what a guide, planner, filter, criterion, simulator or source of people returns, once, where lme takes it.

Each of them may be a user's own. The message names its class or function by the dotted path, what is wrong, and how
many values are wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Set
from typing import Any, cast

import numpy as np

from lme.errors import InputError
from lme.inputs.user_code import dotted_name
from lme.types import Floats, Guidance, LaserScan, Limits, Observation, Pose, Twist

_NO_NUMBER = (str, bytes, bool, np.bool_)
_PLACES = "rows of (x, y) in the robot's frame [m]"
_FLOAT = np.dtype(np.float64)
_REAL = "fiub"  # kinds of NumPy's dtypes that hold real numbers


class ReturnedError(InputError):
    """A guide, planner, filter, criterion, simulator or source of people returned something that cannot be used."""


def checked_command(command: object, planner: object) -> Twist:
    """Return the command of a planner or filter. Raises ReturnedError unless it is a pair of finite numbers."""
    v = omega = math.nan
    if isinstance(command, tuple) or not isinstance(command, str | bytes | Mapping | Set):
        try:
            first, second = cast(Iterable[Any], command)  # or TypeError, ValueError
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
    """Return the guidance of a guide, with arrays of floats. Raises ReturnedError unless planners can follow it."""
    try:
        return _guidance(guidance)
    except ReturnedError as error:
        raise ReturnedError(f"{dotted_name(guide)}.guide returned {error}") from None


def checked_values(values: object, number: int, criterion: object) -> Floats:
    """Return a criterion's values for `number` candidates. Raises ReturnedError unless each is a finite number."""
    try:
        return checked_array(values, (number,), "values", "a number for each candidate")
    except ReturnedError as error:
        raise ReturnedError(f"{dotted_name(criterion)} returned {error}") from None


def checked_people(observation: object, source: object) -> Observation:
    """Return the observation of a source of people.

    Raises ReturnedError unless its pedestrians are (P, 4) finite numbers.
    """
    try:
        if not isinstance(observation, Observation):
            raise ReturnedError(f"{_shown(observation)}: must be an lme.Observation")
        people = _people(observation)
    except ReturnedError as error:
        raise ReturnedError(f"{dotted_name(source)}.seen returned {error}") from None
    return observation if people is observation.pedestrians else observation._replace(pedestrians=people)


def checked_observation(observation: object, state: Any, simulator: object) -> Observation:
    """Return the observation of a simulator.

    state: the `lme.simulation.simulator.State` after it. Raises ReturnedError unless a navigator can use the
    observation and the state is finite.
    """
    try:
        pose_and_time = (*state.pose, state.time)
        checked_array(pose_and_time, (4,), "a state", "a pose (x [m], y [m], yaw [rad]) and a time [s]")
        return _observation(observation)
    except ReturnedError as error:
        raise ReturnedError(f"{dotted_name(simulator)} returned {error}") from None


def given_observation(observation: object) -> Observation:
    """Return an observation that a user's own program gives to a navigator, as guides and planners take it.

    Lists and other kinds of numbers are converted. Raises ReturnedError for what cannot be used.
    """
    try:
        given = _observation(observation)
        people = _people(given)
        _check_limits(given.limits)
        last_command = given.last_command
        if last_command is not None:
            checked_array(last_command, (2,), "a last_command", "(v [m/s], omega [rad/s])")
            last_command = Twist(*last_command)
    except ReturnedError as error:
        raise ReturnedError(f"the observation has {error}") from None
    scan, ranges = given.scan, np.asarray(given.scan.ranges)
    if ranges.dtype.kind != "f" or ranges is not scan.ranges:
        scan = scan._replace(ranges=ranges.astype(np.float32))
    return given._replace(
        scan=scan,
        twist=Twist(*given.twist),
        odometry=Pose(*given.odometry),
        pedestrians=people,
        last_command=last_command,
    )


def checked_array(value: object, shape: tuple[int | None, ...], subject: str, requirement: str) -> Floats:
    """Return the value as an array of finite floats: the value itself if it is one.

    shape: with None for any number. subject, requirement: what the value is and must be, for a ReturnedError.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.flags.c_contiguous:
        array: Floats = value
    else:
        array = _as_floats(value, shape, subject, requirement)
    array_shape = array.shape
    if array_shape != shape and (
        len(array_shape) != len(shape)
        or any(n not in (None, m) for n, m in zip(shape, array_shape, strict=True))
    ):
        raise ReturnedError(
            f"{subject} of shape {array_shape}: must be {requirement}, of shape {_shape(shape)}"
        )
    if array_shape == (2,):
        x, y = array.tolist()  # quicker than NumPy for two numbers
        finite = math.isfinite(x) and math.isfinite(y)
    else:
        finite = bool(np.isfinite(array).all())
    if not finite:
        num_bad = int(np.count_nonzero(~np.isfinite(array)))
        numbers = f"{num_bad} of {array.size} numbers are not finite"
        raise ReturnedError(f"{subject} of which {numbers}: must be {requirement}, all finite")
    return array


def _guidance(guidance: object) -> Guidance:
    """Return guidance with arrays of floats. Raises a ReturnedError that does not name the guide."""
    if not isinstance(guidance, Guidance):
        raise ReturnedError(f"{_shown(guidance)}: must be an lme.Guidance")
    subgoal, path, switched, blocked, points, way = guidance
    for name, flag in (("switched", switched), ("blocked", blocked)):
        if flag is not True and flag is not False and not isinstance(flag, np.bool_):
            raise ReturnedError(f"{name}={_shown(flag)}: must be True or False")
    checked = checked_array(subgoal, (2,), "a subgoal", "(x, y) in the robot's frame [m]")
    if checked is not subgoal:
        guidance = guidance._replace(subgoal=checked)
    for name, points_array in (("path", path), ("points", points), ("way", way)):
        if points_array is not None:
            checked = checked_array(points_array, (None, 2), f"the {name}", _PLACES)
            if checked is not points_array:
                guidance = guidance._replace(**{name: checked})  # type: ignore[arg-type]
    if guidance.path is not None and not len(guidance.path):
        raise ReturnedError("a path without points: must have one, or be None")
    return guidance


def _observation(observation: object) -> Observation:
    """Return an observation with a target of floats. Raises a ReturnedError that does not name the simulator."""
    if not isinstance(observation, Observation):
        raise ReturnedError(f"{_shown(observation)}: must be an lme.Observation")
    scan = observation.scan
    if not isinstance(scan, LaserScan):
        raise ReturnedError(f"the scan {_shown(scan)}: must be an lme.LaserScan")
    ranges = np.asarray(scan.ranges)
    if ranges.ndim != 1 or ranges.dtype.kind not in "fiu":
        raise ReturnedError(f"a scan with ranges {_kind(ranges)}: must be (num_beams,) numbers [m]")
    limits = "(angle_min, angle_increment [rad], range_min, range_max [m])"
    checked_array(scan[1:], (4,), "a scan with angles and limits", limits)
    target = checked_array(observation.target, (2,), "a target", "(x, y) in the robot's frame [m]")
    checked_array(observation.twist, (2,), "a twist", "(v [m/s], omega [rad/s])")
    checked_array(observation.odometry, (3,), "an odometry", "(x [m], y [m], yaw [rad])")
    return observation if target is observation.target else observation._replace(target=target)


def _check_limits(limits: object) -> None:
    if (
        not isinstance(limits, Limits)
        or not all(0.0 <= value < math.inf for value in limits.bounds)
        or not limits.v_min <= 0.0
    ):
        raise ReturnedError(
            f"limits {_shown(limits)}: must be an lme.Limits, whose v_max [m/s], omega_max [rad/s], alpha_v [m/s²] and "
            "alpha_omega [rad/s²] are finite and at least 0, and whose v_min [m/s] is at most 0"
        )


def _people(observation: Observation) -> Floats:
    requirement = "(x [m], y [m], vx [m/s], vy [m/s]) of each person"
    return checked_array(observation.pedestrians, (None, 4), "pedestrians", requirement)


def _as_floats(value: object, shape: tuple[int | None, ...], subject: str, requirement: str) -> Floats:
    """Convert real numbers of any other kind to floats. Strings that spell numbers do not count as numbers."""
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):  # rows of different lengths
        array = np.array(None)
    if array.dtype.kind not in _REAL:
        raise ReturnedError(
            f"{subject} {_shown(value)}: must be {requirement}, real numbers of shape {_shape(shape)}"
        )
    return np.ascontiguousarray(array, dtype=np.float64).reshape(array.shape)


def _shape(shape: tuple[int | None, ...]) -> str:
    return str(tuple("any" if n is None else n for n in shape)).replace("'any'", "N")


def _kind(array: Any) -> str:
    return f"of type {array.dtype} and shape {array.shape}"


def _shown(value: object) -> str:
    """Describe a value for a message, with no more of it than fits into a line."""
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"an array {_kind(value)}"
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."
