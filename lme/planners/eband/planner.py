"""Elastic bands: deform the path in real time and follow it with a speed limited by the free space."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.collision import sweep
from lme.geometry.frames import to_robot, to_world
from lme.geometry.polyline import exit_point, project, stretch
from lme.perception.scan_points import obstacle_points
from lme.planners.commands import approach, limited, until_rest
from lme.planners.eband.kernels import bubble_radii, covered, hidden, mend, relax
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Twist

_CAPACITY = 256  # [bubbles] useful bands have far fewer
_NO_EDGES = np.empty((0, 4))
_AT_REST = np.zeros((1, 3))
_ARRIVED = 0.02  # [m] the robot stops if the aim is nearer
_MAX_STEP = 0.025  # [m] between two poses of a motion in the contact check
_RELIEF = 0.005  # [m] least gain of clearance if it is below the margin
_SLOWER = (1.0, 0.5, 0.25, 0.0)  # shares of the velocity tried before backing off


@dataclass(slots=True)
class EBandConfig:
    """Settings of the bubbles and forces of the band, and of the controller."""

    horizon: float
    spacing: float
    min_radius: float
    max_radius: float
    overlap: float
    internal_gain: float
    external_gain: float
    influence: float
    min_force: float
    iterations: int
    recursion: int
    v_max: float
    v_min: float
    omega_max: float
    bubble_velocity: float
    heading_gain: float
    rotation_threshold: float
    margin: float

    def __post_init__(self) -> None:
        for key in ("horizon", "spacing", "max_radius"):
            require(key, getattr(self, key), above=0.0)
        require("min_radius", self.min_radius, at_least=0.0, at_most=self.max_radius)
        require("overlap", self.overlap, above=0.0, at_most=1.0)
        for key in ("internal_gain", "external_gain", "influence", "min_force", "recursion"):
            require(key, getattr(self, key), at_least=0.0)
        require("iterations", self.iterations, at_least=1)
        for key in ("v_max", "omega_max", "bubble_velocity", "heading_gain", "rotation_threshold"):
            require(key, getattr(self, key), above=0.0)
        for key in ("v_min", "margin"):
            require(key, getattr(self, key), at_least=0.0)
        require("v_min", self.v_min, at_most=self.v_max)


class Band:
    """Bubbles from the robot along a path, in the odometry frame (Quinlan & Khatib 1993, §3).

    centres: (N, 2) [m], the first at the robot. radii: (N,) [m]. chain: number of bubbles, from the first one
    on, that are joined one to the next; less than N if the band is torn.
    """

    def __init__(self, config: EBandConfig, inner: float) -> None:
        """inner: radius of the inscribed disc of the robot's outline [m]."""
        self._config = config
        self._inner = inner
        self.reset()

    def reset(self) -> None:
        """Forget the band."""
        self.centres: Floats = np.empty((0, 2))
        self.radii: Floats = np.empty(0)
        self.chain = 0
        self._path: Floats = np.empty((0, 2))

    @property
    def torn(self) -> bool:
        """Return whether some neighbours do not join even after insertion of bubbles."""
        return self.chain < len(self.centres)

    def update(self, path: Floats, robot: Floats, points: Floats, *, planned: bool) -> None:
        """Update the band for the robot's position and the path, then apply the forces.

        path (K, 2), K ≥ 1, robot (2,), points (M, 2): odometry frame [m]. The band keeps its route even if the
        path changes, so that the robot does not oscillate between two paths of equal length. A torn band is
        rebuilt if the path is `planned` around obstacles, and otherwise left to the forces. A path to another
        end always gives a new band.
        """
        spacing = self._config.spacing
        leads_elsewhere = len(self.centres) == 0 or math.dist(path[-1], self._path[-1]) > spacing
        if leads_elsewhere or (self.torn and planned and self._differs(path)):
            self._path, self.centres = path, robot[None]
        elif self._fits(path, robot):
            self._path = path
        self._advance(robot)
        self._deform(np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1]))

    def _differs(self, path: Floats) -> bool:
        """Return whether the path differs from the path of the band within the horizon."""
        spacing = self._config.spacing
        old = np.vstack([self._path[:1], stretch(self._path, 0.0, math.inf, spacing)])
        new = stretch(path, 0.0, self._config.horizon, spacing)
        return not covered(new, old, np.zeros(len(old)), spacing)

    def _fits(self, path: Floats, robot: Floats) -> bool:
        """Return whether the path runs through the bubbles to the band's end."""
        reach = self._config.spacing
        start = project(path, robot[0], robot[1])[0]
        end, distance, _ = project(path, *self.centres[-1])
        samples = stretch(path, start, end, reach)
        return distance <= max(self.radii[-1], reach) and covered(samples, self.centres, self.radii, reach)

    def _advance(self, robot: Floats) -> None:
        """Drop the bubbles that the robot has passed, and extend the band along the path."""
        num_passed = project(self.centres, robot[0], robot[1])[2]
        start = project(self._path, robot[0], robot[1])[0]
        end = project(self._path, *self.centres[-1])[0] if len(self.centres) > 1 else start
        ahead = stretch(self._path, end, start + self._config.horizon, self._config.spacing)
        self.centres = np.vstack([robot, self.centres[num_passed + 1 :], ahead])
        if math.dist(self.centres[-1], self._path[-1]) <= self._config.spacing:
            self.centres[-1] = self._path[-1]

    def _deform(self, xs: Floats, ys: Floats) -> None:
        """Move the bubbles by the forces of the points (xs, ys) and of their neighbours."""
        config = self._config
        shape = (self._inner, config.max_radius, config.spacing)
        forces = (config.internal_gain, config.external_gain, config.influence, config.min_force)
        self.radii = bubble_radii(self.centres, xs, ys, self._inner, config.max_radius)
        self._mend(xs, ys, shape)
        relax(self.centres, self.radii, xs, ys, shape, forces, (config.iterations, config.recursion))
        self._mend(xs, ys, shape)

    def _mend(self, xs: Floats, ys: Floats, shape: tuple[float, float, float]) -> None:
        joint = (self._config.overlap, self._config.min_radius)
        self.centres, self.radii, self.chain = mend(self.centres, self.radii, xs, ys, shape, joint, _CAPACITY)


class EBand:
    """Elastic bands (Quinlan & Khatib 1993, DOI 10.1109/ROBOT.1993.291936), for a differential drive.

    The robot steers to the point where the band leaves the bubble around the robot, since it may drive straight
    that far. The bubble's radius limits the speed. The robot slows down, or finally backs up, if its outline could
    not stop clear of every known obstacle point. Known points are those of the current scan, and earlier ones that
    are hidden now, behind others or in the blind arc.
    """

    Config = EBandConfig

    def __init__(self, config: EBandConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._margin = config.margin + 2.0 * robot.lidar.noise_std
        # [m] of known points
        self._reach = config.horizon + config.max_radius + robot.footprint.circumscribed_radius
        self.band = Band(config, robot.footprint.inscribed_radius)
        self._known: Floats = np.empty((0, 2))  # obstacle points near the robot, odometry frame [m]

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the band and the known points."""
        self.band.reset()
        self._known = np.empty((0, 2))

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        odometry = observation.odometry
        points = self._update_obstacles(observation)
        planned = guidance.path is not None and len(guidance.path) > 0
        path = guidance.path if planned else np.vstack([np.zeros(2), guidance.subgoal])
        assert path is not None
        self.band.update(to_world(path, odometry), np.array(odometry[:2]), self._known, planned=planned)
        v, omega = self._follow(observation)
        return self._safe_command(v, omega, points, observation)

    def _update_obstacles(self, observation: Observation) -> Floats:
        """Return the visible obstacle points, and earlier ones that are hidden now: (M, 2), robot frame [m]."""
        odometry, scan, mount = observation.odometry, observation.scan, self._robot.lidar.mount
        visible = obstacle_points(scan, mount)
        visible = visible[np.hypot(visible[:, 0], visible[:, 1]) < self._reach]
        earlier = to_robot(self._known, odometry)
        angles, limits = (scan.angle_min, scan.angle_increment), (scan.range_min, scan.range_max)
        out_of_sight = hidden(to_robot(earlier, mount), scan.ranges, angles, limits, self._config.spacing)
        in_reach = np.hypot(earlier[:, 0], earlier[:, 1]) < self._reach
        remembered = _thinned(self._known[out_of_sight & in_reach], self._config.spacing)
        self._known = np.vstack([to_world(visible, odometry), remembered])
        return np.vstack([visible, to_robot(remembered, odometry)])

    def _follow(self, observation: Observation) -> tuple[float, float]:
        """Velocity and turn rate along the band."""
        config, limits, dt = self._config, observation.limits, self._robot.dt
        # Aim at the point where the band leaves the bubble around the robot; `remaining` is the length of the band to
        # its end or tear. A band that is torn at the robot still includes the next bubble.
        line = to_robot(self.band.centres[: max(self.band.chain, 2)], observation.odometry)
        x, y, remaining = exit_point(line, max(self.band.radii[0], self._robot.footprint.inscribed_radius))
        if math.hypot(x, y) < _ARRIVED:
            return 0.0, 0.0
        error, omega_max = math.atan2(y, x), min(config.omega_max, limits.omega_max)
        max_turn = min(config.heading_gain * abs(error), omega_max)
        turn = approach(error, observation.ramp_start.omega, omega_max, limits.alpha_omega, dt)
        turn = math.copysign(min(abs(turn), max_turn), turn)
        if abs(error) > config.rotation_threshold:
            return 0.0, turn
        fastest = min(self._allowed(), limits.v_max)
        if error != 0.0:  # so that the arc at this turn rate reaches the aim
            fastest = min(fastest, max_turn * math.hypot(x, y) / (2.0 * math.sin(abs(error))))
        return approach(remaining, observation.ramp_start.v, fastest, limits.alpha_v, dt), turn

    def _allowed(self) -> float:
        """Velocity limit in the bubble around the robot [m/s]; v_min if the band is torn there."""
        config, band = self._config, self.band
        if band.torn and band.chain < 2:
            return config.v_min
        return min(config.v_max, max(config.bubble_velocity * float(band.radii[0]), config.v_min))

    def _safe_command(self, v: float, omega: float, points: Floats, observation: Observation) -> Twist:
        """Return the first safe command, as given, slower or backwards; else brake."""
        circles = np.column_stack([points, np.zeros(len(points))])
        clearance = self._clearance(_AT_REST, circles)
        ahead = [(factor * v, omega) for factor in _SLOWER]
        backwards = [(-self._config.v_min, omega), (-self._config.v_min, 0.0)]
        for pair in ahead + backwards:
            command = limited(*pair, observation, self._robot.dt)
            motions = [
                until_rest(command, twist, observation.limits, self._robot, _MAX_STEP)
                for twist in observation.twists
            ]
            if clearance > self._margin:
                clear = all(self._clearance(motion, circles) > self._margin for motion in motions)
            else:  # possibly by noise: only motions that gain clearance are safe
                clear = all(self._clearance(motion[-1:], circles) > clearance + _RELIEF for motion in motions)
            if clear:
                return command
        return limited(0.0, 0.0, observation, self._robot.dt)

    def _clearance(self, poses: Floats, circles: Floats) -> float:
        """Least distance of the outline at the (K, 3) poses to the obstacle points [m]."""
        clearance, _ = sweep(poses, self._robot.footprint.box, circles, _NO_EDGES)
        return clearance


def _thinned(points: Floats, spacing: float) -> Floats:
    """Return the point nearest to the centre of each grid cell, independently of the order of the points."""
    cells = np.rint(points / spacing)
    offset = np.abs(points - cells * spacing).sum(axis=1)
    order = np.lexsort((offset, cells[:, 1], cells[:, 0]))
    cells = cells[order]
    first = np.ones(len(points), np.bool_)
    first[1:] = (cells[1:] != cells[:-1]).any(axis=1)
    return points[order[first]]
