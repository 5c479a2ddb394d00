"""Usual values of robots, maps, people and simulators, in one place: any other is probably in another unit.

A value outside the usual range gets a warning, and one that no robot can have is an error. Both name the value, its
unit and the usual range. A value that makes no sense at all, such as a negative length, is refused where it is read.
"""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, NamedTuple

from lme.errors import InputError, config_key


class UsualRange(NamedTuple):
    """The usual range of a quantity, ends included, and the possible one. hint: the likely mistake."""

    unit: str
    low: float
    high: float
    least: float = -math.inf
    most: float = math.inf
    hint: str = ""


_MM = "is it in millimetres or centimetres?"
_DEGREES = "is it in degrees?"
_MS = "is it in milliseconds?"
_TURN = 2 * math.pi
_DELAY = UsualRange("s", 0.0, 2.0, most=60.0, hint=_MS)
_SHARE = UsualRange("", 0.0, 1.0, most=10.0)
_GAIN = UsualRange("", 0.3, 1.5, 0.01, 100.0)
_ANGLE = UsualRange("rad", -_TURN, _TURN, hint=_DEGREES)
_WALK = UsualRange("m/s", 0.02, 5.0, 1e-4, 1e3, _MM)
_BEYOND, _FAR = 0.2, 10.0  # [m] past the outline: the end of a boom, and where nothing can be mounted

USUAL: Mapping[str, UsualRange] = {  # by the last part of the key
    # robots
    "v_max": UsualRange("m/s", 0.02, 10.0, 1e-3, 100.0, _MM),
    "v_min": UsualRange("m/s", -10.0, 0.0, -100.0, 0.0, _MM),
    "omega_max": UsualRange("rad/s", 0.05, 12.0, 1e-3, 1e3, _DEGREES),
    "alpha_v": UsualRange("m/s²", 0.05, 50.0, 1e-4, 1e6),
    "alpha_omega": UsualRange("rad/s²", 0.05, 100.0, 1e-4, 1e6, _DEGREES),
    "settling_time": UsualRange("s", 0.0, 5.0, most=60.0, hint=_MS),
    "control_rate": UsualRange("Hz", 1.0, 200.0, 0.1, 1000.0, "is it a period in seconds?"),
    "radius": UsualRange("m", 0.02, 6.0, 1e-3, 100.0, _MM),
    "length": UsualRange("m", 0.02, 12.0, 1e-3, 100.0, _MM),
    "width": UsualRange("m", 0.02, 6.0, 1e-3, 100.0, _MM),
    "collision_radius": UsualRange("m", 0.02, 7.0, 1e-3, 200.0, _MM),
    "dt": UsualRange("s", 1e-3, 10.0, hint=_MS),
    # lidars
    "fov": UsualRange("rad", 0.2, _TURN + 1e-6, 0.01),
    "range_min": UsualRange("m", 0.0, 1.0, hint=_MM),
    "range_max": UsualRange("m", 0.5, 300.0, 0.01, hint=_MM),
    "angle_increment": UsualRange("rad", 1e-4, 0.1, hint=_DEGREES),
    "noise_std": UsualRange("m", 0.0, 0.3, most=100.0, hint=_MM),
    "yaw": _ANGLE,
    "roll": _ANGLE,
    "pitch": _ANGLE,
    "height": UsualRange("m", 0.02, 5.0, most=100.0, hint=_MM),
    "min_height": UsualRange("m", -2.0, 3.0, -100.0, 100.0, _MM),
    "max_height": UsualRange("m", 0.0, 10.0, -100.0, 1e6, _MM),
    "duration": UsualRange("s", 0.005, 2.0, 1e-4, 60.0, _MS),
    # drivetrains, and measured responses
    "mass": UsualRange("kg", 0.05, 3000.0, 1e-3, 1e6, "is it in grams?"),
    "inertia": UsualRange("kg m²", 1e-5, 5000.0, 1e-9, 1e9),
    "track": UsualRange("m", 0.02, 6.0, 1e-3, 100.0, _MM),
    "wheel_base": UsualRange("m", 0.0, 6.0, most=100.0, hint=_MM),
    "wheel_radius": UsualRange("m", 0.005, 1.0, 1e-3, 100.0, _MM),
    "wheel_width": UsualRange("m", 0.0, 1.0, most=100.0, hint=_MM),
    "com_height": UsualRange("m", 0.0, 3.0, most=100.0, hint=_MM),
    "chassis_length": UsualRange("m", 0.02, 12.0, 1e-3, 100.0, _MM),
    "chassis_width": UsualRange("m", 0.02, 6.0, 1e-3, 100.0, _MM),
    "roll_inertia": UsualRange("kg m²", 1e-5, 5000.0, 1e-9, 1e9),
    "pitch_inertia": UsualRange("kg m²", 1e-5, 5000.0, 1e-9, 1e9),
    "wheel_mass": UsualRange("kg", 0.005, 500.0, 1e-4, 1e5, "is it in grams?"),
    "wheel_inertia": UsualRange("kg m²", 1e-7, 100.0, 1e-10, 1e6),
    "friction": UsualRange("", 0.05, 2.0, 1e-3, 100.0),
    "separation_multiplier": UsualRange("", 0.5, 4.0, 0.01, 100.0),
    "timeout": UsualRange("s", 0.02, 5.0, 1e-3, hint=_MS),
    "gain_v": _GAIN,
    "gain_omega": _GAIN,
    "delay_v": _DELAY,
    "delay_omega": _DELAY,
    # simulators
    "latency": _DELAY,
    "odometry_age": _DELAY,
    "lag": _DELAY,
    "natural_frequency_v": UsualRange("rad/s", 0.0, 100.0, most=1000.0),
    "natural_frequency_omega": UsualRange("rad/s", 0.0, 100.0, most=1000.0),
    "ripple_v": UsualRange("m/s", 0.0, 1.0, most=100.0, hint=_MM),
    "ripple_omega": UsualRange("rad/s", 0.0, 2.0, most=100.0, hint=_DEGREES),
    "tilt": UsualRange("rad", 0.0, 0.3, most=1.0, hint=_DEGREES),
    "slip": _SHARE,
    "odometry_error": _SHARE,
    "scan_noise": UsualRange("m", 0.0, 0.5, most=100.0, hint=_MM),
    "goal_noise": UsualRange("m", 0.0, 5.0, most=1e4, hint=_MM),
    "goal_noise_yaw": UsualRange("rad", 0.0, 1.0, most=100.0, hint=_DEGREES),
    "yaw_noise": UsualRange("rad", 0.0, 0.5, most=100.0, hint=_DEGREES),
    "goal_rate": UsualRange("Hz", 0.0, 1000.0, most=1e6),
    "scan_rate": UsualRange("Hz", 0.5, 200.0, 0.1, 1e4),
    "grip": UsualRange("", 0.05, 2.0, 1e-4, 1e6),
    "max_step": UsualRange("m", 1e-4, 0.2, 1e-6, hint=_MM),
    "substep": UsualRange("s", 1e-4, 0.1, 1e-5, hint=_MS),
    "check_time": UsualRange("s", 1e-4, 0.1, 1e-5, hint=_MS),
    # drivers of robots
    "stale": UsualRange("s", 0.02, 5.0, most=60.0, hint=_MS),
    "time_jump": UsualRange("s", 0.02, 60.0, hint=_MS),
    # maps and people
    "resolution": UsualRange("m per cell", 1e-3, 1.0, 1e-5, 1e3, _MM),
    "goal_tolerance": UsualRange("m", 1e-3, 10.0, hint=_MM),
    "time_limit": UsualRange("s", 0.1, 1e5, hint=_MS),
    "walking_speed": _WALK,
    "speed": _WALK,
    "body_radius": UsualRange("m", 0.05, 1.0, 1e-3, 100.0, _MM),
}


def check(name: str, value: float) -> None:
    """Warn of a value outside the usual range of its name; raise InputError for one outside the possible range.

    name: for messages; its last part, or word, is a key of `USUAL`.
    """
    usual = USUAL[re.split(r"[. -]", name)[-1]]
    if usual.low <= value <= usual.high:
        return
    hint = f"; {usual.hint}" if usual.hint else ""
    statement = f"{name} is {_with_unit(value, usual)}"
    normal = f"usually {_between(usual.low, usual.high, usual)}{hint}"
    if not usual.least <= value <= usual.most:
        raise InputError(f"{statement}: must be {_between(usual.least, usual.most, usual)}, and is {normal}")
    warnings.warn(f"{statement}: it is {normal}", stacklevel=2)


def check_fields(values: Any) -> None:
    """Check every number of a dataclass whose name is a key of `USUAL`."""
    for field in fields(values):
        value = getattr(values, field.name)
        if field.name in USUAL and isinstance(value, int | float):
            check(config_key(field.name), value)


def check_mount(argument: str, x: float, y: float, reach: float) -> None:
    """Check a sensor's place on a robot. reach: from the base to the farthest point of the outline [m]."""
    distance, usual, max_distance = math.hypot(x, y), reach + _BEYOND, reach + _FAR
    mounted = f"{config_key(argument)} is mounted {distance:.3g} m"
    statement = f"{mounted} from the base of a robot that ends at {reach:.3g} m"
    if distance > max_distance:
        raise InputError(
            f"{statement}: must be at most {max_distance:.3g} m from it, and is usually at most {usual:.3g} m; {_MM}"
        )
    if distance > usual:
        warnings.warn(f"{statement}: it is usually at most {usual:.3g} m from it; {_MM}", stacklevel=2)


def _with_unit(value: float, usual: UsualRange) -> str:
    return f"{value:.6g} {usual.unit}".rstrip()


def _between(low: float, high: float, usual: UsualRange) -> str:
    if math.isinf(low):
        return f"at most {_with_unit(high, usual)}"
    if math.isinf(high):
        return f"at least {_with_unit(low, usual)}"
    return f"from {low:.4g} to {high:.4g} {usual.unit}".rstrip()
