"""Motion tubes: swept areas, the ranges that free beams must exceed, and selection of a tube and its speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_robot, to_world
from lme.planners.motion_tubes.kernels import (
    Ranges,
    arc_pose,
    choose,
    free_ranges,
    free_tubes,
    points_along,
    swept_ranges,
)
from lme.robots import Robot
from lme.types import Bools, Floats, Guidance, Ints, LaserScan, Pose, Twist

Box = tuple[float, float, float]  # half_length, half_width, rounding [m]
_ALONG = 0.03  # [m] between placements of the outline along a tube
_CORNER_SIDES = 8  # of the polygon that approximates a rounded corner
_WHISKER_SAMPLES = 3
_LATTICE = 0.05  # [m] between samples behind the robot
_AT_GOAL = 1  # [bins] greatest miss of a tube that reaches the path's end, so the robot does not circle it


class LidarView(NamedTuple):
    """Origin and directions of a scan's beams in the base frame; the increment is positive."""

    x: float  # [m]
    y: float  # [m]
    first: float  # [rad] bearing of the first beam
    increment: float  # [rad]
    num_beams: int


class TubeSpec(NamedTuple):
    """Specification of a set of tubes; equal specifications share one set."""

    length: float  # [m] distance driven by the base
    heading_max: float  # [rad] at the end of the most curved tube
    heading_step: float  # [rad]
    box: Box
    margins: tuple[float, float]  # [m] in front, at each side
    whiskers: tuple[float, float]  # [m] in front, at each side, beyond the margins


class Tubes(NamedTuple):
    """Tubes of one length for one lidar: the straight one first, then left and right alternately.

    curvatures (N,) [1/m]; needs (B, N) [m], farthest (B,) [m] and hidden (N,) as in `free_tubes` of `kernels.py`;
    whisker_beams and whisker_ranges (3, N, S): samples of the outer, front and inner whisker.
    """

    length: float
    curvatures: Floats
    needs: Ranges
    farthest: Ranges
    hidden: Bools
    whisker_beams: Ints
    whisker_ranges: Ranges


def lidar_view(scan: LaserScan, mount: Pose) -> tuple[LidarView, Ranges]:
    """Return the scan's beams in the base frame, anticlockwise, and the free range of each (B,) [m]."""
    free = free_ranges(scan.ranges, scan.range_min, scan.range_max)
    first, increment, count = scan.angle_min, scan.angle_increment, len(free)
    if increment < 0.0:
        first, increment, free = first + (count - 1) * increment, -increment, np.ascontiguousarray(free[::-1])
    return LidarView(mount.x, mount.y, mount.yaw + first, increment, count), free


@lru_cache(maxsize=16)
def forward_tubes(spec: TubeSpec, view: LidarView) -> Tubes:
    """Return the forward tubes."""
    curvatures = _curvatures(spec)
    outline = grown_outline(spec.box, *spec.margins)
    front = spec.box[0] + spec.box[2] + spec.margins[0]
    steps = max(1, math.ceil(spec.length / _ALONG))
    lidar = (view.x, view.y, view.first)
    needed, hidden = swept_ranges(
        curvatures, spec.length, steps, outline, front, lidar, view.increment, view.num_beams
    )
    beams, ranges = _whiskers(spec, curvatures, view)
    needs = np.ascontiguousarray(needed.T)
    return Tubes(spec.length, curvatures, needs, needs.max(axis=1), hidden, beams, ranges)


def grown_outline(box: Box, front: float, side: float) -> Floats:
    """Grow the footprint at front and sides; corners are circumscribed and anticlockwise: (V, 2) [m]."""
    half_length, half_width, rounding = box
    turns = np.array([0.0])
    if rounding > 0.0:
        turns = np.linspace(0.0, 0.5 * math.pi, _CORNER_SIDES + 1)
        rounding /= math.cos(0.25 * math.pi / _CORNER_SIDES)
    x, y = half_length + front, half_width + side
    middles = ((x, y), (-half_length, y), (-half_length, -y), (x, -y))
    parts = [
        np.array(middle) + rounding * np.column_stack((np.cos(turns + start), np.sin(turns + start)))
        for middle, start in zip(middles, 0.5 * math.pi * np.arange(4), strict=True)
    ]
    return np.vstack(parts)


def _curvatures(spec: TubeSpec) -> Floats:
    """Curvatures: 0, then left and right alternately, rising: (N,) [1/m]."""
    count = max(1, math.floor(spec.heading_max / spec.heading_step + 1e-9))
    left = spec.heading_step * np.arange(1, count + 1) / spec.length
    return np.concatenate(([0.0], np.column_stack((left, -left)).ravel()))


def _whiskers(spec: TubeSpec, curvatures: Floats, view: LidarView) -> tuple[Ints, Ranges]:
    """Samples of the whiskers at the end of each tube, (3, N, S); a straight tube's outer and inner are equal."""
    half_length, half_width, rounding = spec.box
    x, y = half_length + spec.margins[0], half_width + spec.margins[1]
    across = y + rounding + spec.whiskers[1] * np.arange(1, _WHISKER_SAMPLES + 1) / _WHISKER_SAMPLES
    left = np.column_stack((np.full(_WHISKER_SAMPLES, x), across))
    ahead = np.full(_WHISKER_SAMPLES, x + rounding + spec.whiskers[0])
    front = np.column_stack((ahead, np.linspace(-y, y, _WHISKER_SAMPLES)))
    right = left * (1.0, -1.0)
    both_sides = np.vstack((left, right))
    sides = {0.0: (both_sides, both_sides), 1.0: (right, left), -1.0: (left, right)}
    samples = np.empty((3, len(curvatures), 2 * _WHISKER_SAMPLES, 2))
    for n, curvature in enumerate(curvatures):
        outer, inner = sides[float(np.sign(curvature))]
        pose = Pose(*arc_pose(curvature, spec.length))
        for k, whisker in enumerate((outer, front, inner)):
            samples[k, n] = np.resize(to_world(whisker, pose), (2 * _WHISKER_SAMPLES, 2))
    return _beams(samples, view)


def _beams(points: Floats, view: LidarView) -> tuple[Ints, Ranges]:
    """Return the beam nearest to each point (..., 2), −1 if out of view, and the point's range [m]."""
    dx, dy = points[..., 0] - view.x, points[..., 1] - view.y
    bearings = ((np.arctan2(dy, dx) - view.first) % math.tau) / view.increment
    beams = np.where(bearings >= math.tau / view.increment - 0.5, 0, np.rint(bearings))
    beams = np.where(beams < view.num_beams, beams, -1)
    return beams.astype(np.int64), np.hypot(dx, dy).astype(np.float32)


class BackwardTubes(NamedTuple):
    """Tubes behind the robot, from the greatest curvature to the least.

    curvatures (N,) [1/m]; ends (N, 2) of the base [m]; samples (P, 2) [m]; inside (N, P): whether a tube contains a
    sample.
    """

    curvatures: Floats
    ends: Floats
    samples: Floats
    inside: Bools


@lru_cache(maxsize=16)
def backward_tubes(spec: TubeSpec) -> BackwardTubes:
    """Return the tubes driven backwards, with the front margin at the rear and without whiskers."""
    curvatures = np.sort(_curvatures(spec))
    half_length, half_width, rounding = spec.box
    grown = (half_length + spec.margins[0], half_width + spec.margins[1], rounding)
    reach = spec.length + math.hypot(*grown[:2]) + rounding
    ticks = _LATTICE * np.arange(-math.ceil(reach / _LATTICE), math.ceil(reach / _LATTICE) + 1)
    lattice = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    lattice = lattice[~_within(lattice, grown, Pose(0.0, 0.0, 0.0))]
    inside = np.zeros((len(curvatures), len(lattice)), np.bool_)
    steps = max(1, math.ceil(spec.length / _LATTICE))
    for n, curvature in enumerate(curvatures):
        for k in range(1, steps + 1):
            inside[n] |= _within(lattice, grown, Pose(*arc_pose(curvature, -spec.length * k / steps)))
    is_covered = inside.any(axis=0)
    ends = np.array([arc_pose(curvature, -spec.length)[:2] for curvature in curvatures])
    return BackwardTubes(curvatures, ends, lattice[is_covered], np.ascontiguousarray(inside[:, is_covered]))


def _within(points: Floats, box: Box, pose: Pose) -> Bools:
    """Return whether each of the points (P, 2) lies in the rounded rectangle at `pose`: (P,)."""
    beside = np.maximum(np.abs(to_robot(points, pose)) - box[:2], 0.0)
    is_inside: Bools = np.hypot(beside[:, 0], beside[:, 1]) <= box[2] + 1e-9
    return is_inside


@dataclass(slots=True)
class TubeChoiceConfig:
    """Geometry of the forward tubes, selection rules and speeds."""

    long_length: float
    short_length: float
    near_length: float
    heading_max: float
    heading_step: float
    front_margin: float
    side_margin: float
    front_whisker: float
    side_whisker: float
    goal_bin: float
    goal_bins: int
    heading_bin: float
    heading_span: float
    long_speed: float
    short_speed: float
    near_speed: float
    free_low: float
    free_high: float
    wide_radius: float

    def __post_init__(self) -> None:
        for key in ("long_length", "short_length", "near_length", "heading_max", "goal_bin", "heading_bin"):
            require(key, getattr(self, key), above=0.0)
        for key in ("heading_span", "long_speed", "short_speed", "near_speed"):
            require(key, getattr(self, key), above=0.0)
        for key in ("front_margin", "side_margin", "front_whisker", "side_whisker", "wide_radius"):
            require(key, getattr(self, key), at_least=0.0)
        require("near_length", self.near_length, at_most=self.short_length)
        require("short_length", self.short_length, at_most=self.long_length)
        require("heading_max", self.heading_max, at_most=math.pi / 2.0 + 1e-9)
        require("heading_step", self.heading_step, at_least=1e-3, at_most=self.heading_max)
        require("goal_bins", self.goal_bins, at_least=0)
        require("free_low", self.free_low, at_least=0.0, at_most=1.0)
        require("free_high", self.free_high, above=self.free_low)


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

        Returns None if no tube is suitable. view, free_ranges: see `lidar_view`.
        """
        config = self._config
        for spec in (self._long, self._short, self._near):
            tubes = forward_tubes(spec, view)
            free = free_tubes(free_ranges, tubes.needs, tubes.farthest, tubes.hidden)
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
