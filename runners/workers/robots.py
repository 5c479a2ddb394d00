"""Robots that differ from episode to episode."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace

import numpy as np

from lme.errors import InputError, require
from lme.robots import Footprint, Robot
from runners.config.schema import RobotRanges

_SIDES = ("length", "width")


def check_ranges(ranges: RobotRanges) -> None:
    """Raise InputError for an invalid range, and for one side of a footprint without the other."""
    for key in ranged_keys(ranges):
        found = getattr(ranges, key)
        if len(found) != 2 or found[0] > found[1]:
            raise InputError(f"robots.{key} is {found}: must be [lowest, highest]")
        require(f"robots.{key}", found[0], above=0.0)
    if (ranges.length is None) != (ranges.width is None):
        raise InputError("robots.length and robots.width: must both be ranges, or both null")


def draw_robot(robot: Robot, ranges: RobotRanges, rng: np.random.Generator) -> Robot:
    """The robot with values drawn from the ranges, uniformly in the logarithm."""
    drawn_values = {
        key: float(np.exp(rng.uniform(*np.log(getattr(ranges, key))))) for key in ranged_keys(ranges)
    }
    return robot_with(robot, drawn_values)


def extremes(robot: Robot, ranges: RobotRanges) -> tuple[Robot, Robot]:
    """The robots with the lowest and with the highest values of the ranges."""
    lowest, highest = ({key: getattr(ranges, key)[end] for key in ranged_keys(ranges)} for end in (0, 1))
    return robot_with(robot, lowest), robot_with(robot, highest)


def robot_with(robot: Robot, values: Mapping[str, float]) -> Robot:
    """The robot with these values of `RobotRanges`; both sides of a footprint, or neither."""
    limits = {key: value for key, value in values.items() if key not in _SIDES}
    if len(limits) == len(values):
        return replace(robot, **limits)  # type: ignore[arg-type]
    footprint = Footprint(length=values["length"], width=values["width"])
    return replace(robot, **limits, footprint=footprint, contact=None, collision_radius=None)  # type: ignore[arg-type]


def ranged_keys(ranges: RobotRanges) -> list[str]:
    """The keys of the ranges that are not None."""
    return [field.name for field in fields(ranges) if getattr(ranges, field.name) is not None]
