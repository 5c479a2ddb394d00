"""A vote of motion tubes: KUL+FM as it drove in the BARN Challenge 2023."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lme.errors import argument_error, require
from lme.planners.commands import limited
from lme.planners.motion_tubes.kernels import Ranges, free_tubes
from lme.planners.motion_tubes.tubes import LidarView, lidar_view
from lme.robots import Robot
from lme.types import Bools, Floats, Guidance, Ints, Observation, Twist

_STRAIGHT = 1e-3  # [rad/s] a mean of votes that turns more slowly is straight


@dataclass(slots=True)
class TubeVoteConfig:
    """Tubes, margins, vote and speeds of the entry."""

    speeds: list[float]
    horizons: list[float]
    radius_max: float
    radius_min: float
    radii: int
    turn_rate_max: float
    sampling: float
    front_margin: float
    side_margin: float
    fast_side_margin: float
    fast_from: float
    waypoint_ahead: float
    waypoint_spacing: float
    cost_max: float
    least_share: float
    fast: float
    fast_above: float
    slow: float
    slow_above: float
    creep: float
    acceleration: float
    turn_above: float
    turn_speed: float
    back_speed: float
    hold_time: float
    rest_within: float

    def __post_init__(self) -> None:
        if not self.speeds or len(self.speeds) != len(self.horizons):
            raise argument_error(
                f"speeds has {len(self.speeds)} values and horizons {len(self.horizons)}: "
                "must be one of each for every set of tubes, and at least one set"
            )
        for key in ("speeds", "horizons"):
            for value in getattr(self, key):
                require(key, value, above=0.0)
        for key in (
            "radius_min",
            "turn_rate_max",
            "waypoint_spacing",
            "cost_max",
            "least_share",
            "acceleration",
        ):
            require(key, getattr(self, key), above=0.0)
        for key in (
            "front_margin",
            "side_margin",
            "fast_side_margin",
            "fast_from",
            "waypoint_ahead",
            "hold_time",
        ):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("fast", "fast_above", "slow", "slow_above", "creep"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("turn_above", "turn_speed", "back_speed", "rest_within"):
            require(key, getattr(self, key), at_least=0.0)
        require("radius_max", self.radius_max, above=self.radius_min)
        require("radii", self.radii, at_least=2)
        require("sampling", self.sampling, at_least=0.001)


class TubeShape(NamedTuple):
    """Shape of all tubes about the lidar: front and sides of the robot with its margins, and spacing of samples [m]."""

    front: float
    half_widths: tuple[float, ...]  # of each set
    sampling: float


class TubeSets(NamedTuple):
    """Tubes of all sets, one set after the other, each from the tightest right turn to the tightest left turn.

    sets (N,): the set of each tube. curvatures (N,) [1/m]. ends (N, 2): middle of the tube's front end from the lidar
    [m]. needs (B, N) and farthest (B,) as in `free_tubes`.
    """

    sets: Ints
    curvatures: Floats
    ends: Floats
    needs: Ranges
    farthest: Ranges
    hidden: Bools  # (N,) none: what is out of view counts as free


class TubeVote:
    """Free motion tubes of many lengths vote on the curvature, and their mean speed selects one of three speeds.

    The barn2023 branch of KU Leuven's free_space_motion_tube: each set holds tubes of one speed and duration and aims
    at a way-point of Navfn's plan, farther away the longer its tubes are. The free tube that ends nearest to the
    way-point is the set's vote, if it ends within `cost_max` of it. Votes that miss by more weigh more.

    What may surprise is the entry's: tubes and way-points are about the lidar, so the lidar turns on the spot
    rather than the base; without a vote the robot turns in place for as long as that lasts, or backs up without
    looking; and without a plan it sends no command, and the base stops. The entry decides with each scan, 50 times a
    second; here it does so once per control period. Added: it rests at the goal, which the entry never reaches, as a
    run of the challenge ends 1 m before it.
    """

    Config = TubeVoteConfig

    def __init__(self, config: TubeVoteConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        half_length, half_width, rounding = robot.footprint.box
        # Sets of fast tubes are wider.
        speeds = np.array(config.speeds, dtype=np.float64)
        sides = config.side_margin + config.fast_side_margin * np.maximum(speeds - config.fast_from, 0.0)
        half_widths = tuple((half_width + rounding + sides).tolist())
        self._shape = TubeShape(half_length + rounding + config.front_margin, half_widths, config.sampling)
        lengths = speeds * config.horizons
        self._curvatures = tuple(_curvatures(config, speed) for speed in config.speeds)
        self._lengths = tuple(lengths.tolist())
        self._speeds = speeds
        ahead = lengths + half_length + rounding + config.front_margin + config.waypoint_ahead
        self._waypoints = config.waypoint_spacing * np.ceil(ahead / config.waypoint_spacing - 1e-9)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last command and the last turn."""
        self._command = Twist(0.0, 0.0)
        self._last_turn = 0.0  # [rad/s] of the last vote
        self._silence = 0.0  # [s] since the last plan

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        config, dt = self._config, self._robot.dt
        if guidance.blocked:
            # The base keeps the last command for a while; the entry will go on from it.
            self._silence += dt
            held = self._command if self._silence <= config.hold_time else Twist(0.0, 0.0)
            return limited(*held, observation, dt)
        self._silence = 0.0
        path = guidance.path
        if path is None or len(path) < 2:
            path = np.vstack((np.zeros(2), guidance.subgoal))
        vote = self._vote(observation, path)
        if math.hypot(*path[-1]) <= config.rest_within:
            self._command = Twist(0.0, 0.0)
        elif vote is not None:
            self._command = self._follow(vote, observation)
            self._last_turn = self._command.omega
        elif abs(self._last_turn) > config.turn_above:
            self._command = Twist(0.0, math.copysign(config.turn_speed, self._last_turn))
        else:
            self._command = Twist(max(-config.back_speed, observation.limits.lowest), 0.0)
        return limited(*self._command, observation, dt)

    def _vote(self, observation: Observation, path: Floats) -> Twist | None:
        """Return the weighted mean of the votes; None without a vote. path: (K, 2), K ≥ 2 [m]."""
        config, mount = self._config, self._robot.lidar.mount
        view, free_ranges = lidar_view(observation.scan, mount)
        tubes = tube_sets(self._curvatures, self._lengths, self._shape, view, observation.scan.range_min)
        free = free_tubes(free_ranges, tubes.needs, tubes.farthest, tubes.hidden)
        # Distance from each free tube's end to the way-point of its set.
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))))
        waypoints = [np.interp(self._waypoints, along, path[:, axis]) - mount[axis] for axis in (0, 1)]
        targets = np.column_stack(waypoints)[tubes.sets]
        costs = np.where(free, np.hypot(*(tubes.ends - targets).T), np.inf)
        # The best tube of each set votes. Its weight is the inverse of how far it stays below the greatest cost.
        starts = np.searchsorted(tubes.sets, np.arange(len(self._lengths) + 1))
        weights, votes = [], []
        for k in range(len(self._lengths)):
            best = int(starts[k] + costs[starts[k] : starts[k + 1]].argmin())
            if costs[best] < config.cost_max:
                weights.append(1.0 / max(config.cost_max - costs[best], config.least_share))
                votes.append((self._speeds[k], self._speeds[k] * tubes.curvatures[best]))
        if not votes:
            return None
        v, omega = np.average(votes, axis=0, weights=weights).tolist()
        return Twist(v, omega)

    def _follow(self, vote: Twist, observation: Observation) -> Twist:
        """Return the command on the arc of the vote, at one of three speeds: upwards by a ramp, downwards at once."""
        config = self._config
        speed = config.creep
        if vote.v > config.fast_above:
            speed = config.fast
        elif vote.v > config.slow_above:
            speed = config.slow
        speed = min(speed, observation.limits.v_max, self._command.v + config.acceleration * self._robot.dt)
        if abs(vote.omega) < _STRAIGHT:
            return Twist(speed, vote.omega)
        radius = vote.v / vote.omega
        turn_rate_max = min(config.turn_rate_max, observation.limits.omega_max)
        omega = min(max(speed / radius, -turn_rate_max), turn_rate_max)
        return Twist(radius * omega, omega)


def _curvatures(config: TubeVoteConfig, speed: float) -> tuple[float, ...]:
    """Curvatures [1/m] of a set, rising: geometric radii to both sides, but none that needs too high a turn rate."""
    left = 1.0 / np.geomspace(config.radius_max, config.radius_min, config.radii)
    left = left[speed * left <= config.turn_rate_max]
    return (*(-left[::-1]).tolist(), 0.0, *left.tolist())


@lru_cache(maxsize=16)
def tube_sets(
    curvatures: tuple[tuple[float, ...], ...],
    lengths: tuple[float, ...],
    shape: TubeShape,
    view: LidarView,
    range_min: float,
) -> TubeSets:
    """Return the tubes of all sets. A beam that meets a sample of a tube's edge must be longer than that is far.

    curvatures: of each set [1/m]; lengths: of each set [m]. Samples out of view or nearer than `range_min` [m] do not
    count.
    """
    sets = np.repeat(np.arange(len(lengths)), [len(part) for part in curvatures])
    flat = np.concatenate(curvatures)
    ends, needs = np.empty((len(flat), 2)), np.zeros((view.num_beams, len(flat)), np.float32)
    for n, (k, curvature) in enumerate(zip(sets, flat, strict=True)):
        middle = np.array([shape.front + 0.5 * shape.sampling, 0.0])
        ends[n] = _carried(middle, curvature, np.array([lengths[k]]))[0]
        samples = edge_samples(curvature, lengths[k], shape.front, shape.half_widths[k], shape.sampling)
        ranges = np.hypot(*samples.T)
        beams = np.rint(
            ((np.arctan2(samples[:, 1], samples[:, 0]) - view.first) % math.tau) / view.increment
        ).astype(np.int64)
        counts = (beams < view.num_beams) & (ranges > range_min)
        np.maximum.at(needs[:, n], beams[counts], ranges[counts].astype(np.float32))
    return TubeSets(sets, flat, ends, needs, needs.max(axis=1), np.zeros(len(flat), np.bool_))


def edge_samples(curvature: float, length: float, front: float, half_width: float, spacing: float) -> Floats:
    """Points (S, 2) on the edge of the tube that a robot sweeps along an arc, at most `spacing` apart [m].

    Outside of the turn the edge is the track of the front corner, inside that of the end of the axle, which is at
    the origin. A straight tube has the tracks of both front corners, and is longer by `spacing`.
    """
    side = -1.0 if curvature < 0.0 else 1.0
    bend = abs(curvature)
    inner, outer = np.array([front, half_width]), np.array([front, -half_width])
    outside = _track(outer, bend, length, spacing)
    if bend == 0.0:
        inside = _track(inner, bend, length, spacing)
        shift = np.array([spacing, 0.0])
        across = _segment(inside[-1] + shift, outside[-1] + shift, spacing)
    else:
        axle = _track(np.array([0.0, half_width]), bend, length, spacing)
        corner = _carried(inner, bend, np.array([length]))[0]
        inside = np.vstack((axle, _segment(axle[-1], corner, spacing)))
        across = _segment(corner, outside[-1], spacing)
    return np.vstack((inside, across, outside)) * (1.0, side)


def _track(point: Floats, curvature: float, length: float, spacing: float) -> Floats:
    """Samples of the track of a point (2,) that is carried along an arc of `length` [m]: (S, 2) [m]."""
    path_length = length * math.hypot(curvature * point[0], 1.0 - curvature * point[1])
    return _carried(point, curvature, np.linspace(0.0, length, math.ceil(path_length / spacing - 1e-9) + 1))


def _segment(a: Floats, b: Floats, spacing: float) -> Floats:
    count = math.ceil(math.dist(a, b) / spacing - 1e-9) + 1
    return np.linspace(a, b, count)


def _carried(point: Floats, curvature: float, lengths: Floats) -> Floats:
    """Positions (L, 2) of a point (2,) of the robot after the lengths (L,) along an arc from the origin [m]."""
    turn = curvature * lengths
    # sin(κ s)/κ and (1 − cos(κ s))/κ, also for κ = 0.
    x = lengths * np.sinc(turn / np.pi)
    y = lengths * 0.5 * turn * np.sinc(0.5 * turn / np.pi) ** 2
    return np.column_stack(
        (
            x + np.cos(turn) * point[0] - np.sin(turn) * point[1],
            y + np.sin(turn) * point[0] + np.cos(turn) * point[1],
        )
    )
