"""Selection of a motion tube and its speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.planners.motion_tubes.kernels import Ranges, choose, free_tubes, points_along
from lme.planners.motion_tubes.tubes import LidarView, Tubes, TubeSpec, forward_tubes
from lme.robots import Robot
from lme.types import Bools, Floats, Guidance, Twist

_AT_GOAL = 1  # [bins] greatest miss of a tube that reaches the path's end, so the robot does not circle it
_POSITIVE = (
    "long_length",
    "short_length",
    "near_length",
    "heading_max",
    "goal_bin",
    "heading_bin",
    "heading_span",
    "long_speed",
    "short_speed",
    "near_speed",
)
_NOT_NEGATIVE = ("front_margin", "side_margin", "front_whisker", "side_whisker", "wide_radius")


@dataclass(slots=True)
class TubeChoiceConfig:
    """Geometry of the forward tubes, selection rules and speeds."""

    long_length: float = 2.0  # [m]
    short_length: float = 0.9  # [m]
    near_length: float = 0.25  # [m]
    heading_max: float = math.pi / 2.0  # [rad]
    heading_step: float = math.radians(0.5)  # [rad]
    front_margin: float = 0.10  # [m]
    side_margin: float = 0.05  # [m]
    front_whisker: float = 0.05  # [m]
    side_whisker: float = 0.1  # [m]
    goal_bin: float = 0.2  # [m]
    goal_bins: int = 6
    heading_bin: float = math.radians(20.0)  # [rad]
    heading_span: float = 0.25  # [m]
    long_speed: float = 1.75  # [m/s]
    short_speed: float = 1.0  # [m/s]
    near_speed: float = 0.25  # [m/s]
    free_low: float = 0.2  # [-]
    free_high: float = 0.75  # [-]
    wide_radius: float = 2.0  # [m]

    def __post_init__(self) -> None:
        for key in _POSITIVE:
            require(f"planner.{key}", getattr(self, key), above=0.0)
        for key in _NOT_NEGATIVE:
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        require("planner.near_length", self.near_length, at_most=self.short_length)
        require("planner.short_length", self.short_length, at_most=self.long_length)
        require("planner.heading_max", self.heading_max, at_most=math.pi / 2.0 + 1e-9)
        require("planner.heading_step", self.heading_step, at_least=1e-3, at_most=self.heading_max)
        require("planner.goal_bins", self.goal_bins, at_least=0)
        require("planner.free_low", self.free_low, at_least=0.0, at_most=1.0)
        require("planner.free_high", self.free_high, above=self.free_low)


class Route(NamedTuple):
    """Path (K, 2), K ≥ 2, in the robot frame [m], and its remaining length from the robot [m]."""

    path: Floats
    left: float


class TubeGoal(NamedTuple):
    """Desired pose on a tube: position [m] and heading [rad] at the distance `reach` [m] along it."""

    x: float
    y: float
    heading: float
    reach: float


class ChosenTube(NamedTuple):
    """Curvature of a tube [1/m], speed [m/s], bin of its distance to the goal, and share of free tubes in its set."""

    curvature: float
    speed: float
    bin: int
    share: float


class TubeChoice:
    """Selects the free tube that follows a path best."""

    def __init__(self, config: TubeChoiceConfig, robot: Robot) -> None:
        self._config = config
        self._margins = (config.front_margin, config.side_margin)
        self._whiskers = (config.front_whisker, config.side_whisker)
        self._box = robot.footprint.box
        lengths = (config.long_length, config.short_length, config.near_length)
        self._long, self._short, self._near = (self.spec(length, config.heading_step) for length in lengths)

    def spec(self, length: float, heading_step: float) -> TubeSpec:
        """Return the specification of a set of tubes with the margins and whiskers of the forward tubes."""
        return TubeSpec(
            length, self._config.heading_max, heading_step, self._box, self._margins, self._whiskers
        )

    def route(self, guidance: Guidance) -> Route:
        """Return the guide's path, or the straight line to its subgoal if it has none."""
        path = guidance.path
        if path is None or len(path) < 2:
            path = np.vstack((np.zeros(2), guidance.subgoal))
        path = np.ascontiguousarray(path, dtype=np.float64)
        _, remaining = points_along(path, np.empty(0), self._config.long_length)
        return Route(path, max(remaining, math.hypot(*path[-1])))

    def ahead(self, route: Route, twist: Twist, view: LidarView, free_ranges: Ranges) -> ChosenTube | None:
        """Return the best long tube if all long tubes are free, else the best short one, else the best near one.

        Returns None if no tube is suitable. view, free_ranges: see `lme.planners.motion_tubes.tubes.lidar_view`.
        """
        config = self._config
        for spec in (self._long, self._short, self._near):
            tubes = forward_tubes(spec, view)
            free = free_tubes(free_ranges, tubes.needs, tubes.spans, tubes.hidden)
            if spec is self._long and not free.all():
                continue
            index, bin_ = self._choose(route, twist, tubes, free, free_ranges)
            if index < 0:
                continue
            curvature, fraction = float(tubes.curvatures[index]), float(free.mean())
            if spec is self._short:
                return ChosenTube(curvature, self._short_speed(curvature, fraction), bin_, fraction)
            return ChosenTube(
                curvature, config.long_speed if spec is self._long else config.near_speed, bin_, fraction
            )
        return None

    def goal(self, route: Route, length: float) -> TubeGoal:
        """Return the path's point at `length` [m], or its end, and its direction there."""
        reach = min(length, route.left)
        distances = np.array([max(reach - self._config.heading_span, 0.0), reach])
        (previous, point), _ = points_along(route.path, distances, self._config.long_length)
        heading = _bearing(point - previous) if (point != previous).any() else _bearing(point)
        return TubeGoal(float(point[0]), float(point[1]), heading, reach)

    def bearing(self, route: Route) -> float:
        """Direction of the path at its start [rad]."""
        (point,), _ = points_along(
            route.path, np.array([self._config.heading_span]), self._config.long_length
        )
        return _bearing(point)

    def _choose(
        self, route: Route, twist: Twist, tubes: Tubes, free: Bools, free_ranges: Ranges
    ) -> tuple[int, int]:
        config, goal = self._config, self.goal(route, tubes.length)
        distance_bin = config.goal_bin * min(1.0, goal.reach / config.short_length)
        max_bins = config.goal_bins if goal.reach == tubes.length else min(config.goal_bins, _AT_GOAL)
        bins = (distance_bin, float(config.heading_bin), int(max_bins))
        target, rates = (goal.x, goal.y, goal.heading), (float(twist.v), float(twist.omega))
        whiskers = (tubes.whisker_beams, tubes.whisker_ranges)
        return choose(free, tubes.curvatures, goal.reach, target, bins, rates, free_ranges, *whiskers)

    def _short_speed(self, curvature: float, fraction: float) -> float:
        """Speed of a short tube [m/s]: near_speed to short_speed, rising with the share of free tubes."""
        config = self._config
        if fraction < config.free_low:
            return config.near_speed
        if fraction > config.free_high or abs(curvature) * config.wide_radius < 1.0:
            return config.short_speed
        blend = (fraction - config.free_low) / (config.free_high - config.free_low)
        return config.near_speed + blend * (config.short_speed - config.near_speed)


def _bearing(point: Floats) -> float:
    return math.atan2(point[1], point[0])
