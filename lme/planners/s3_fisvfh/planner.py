"""S3-FISVFH: a vector field histogram with search, smoothing, fuzzy control and a safeguard."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import relative
from lme.perception.scan_points import obstacle_points
from lme.planners.commands import approach, limited
from lme.planners.s3_fisvfh.kernels import Costs, Valleys, histogram, least_clearance, nearest_ahead, search
from lme.robots import Robot
from lme.types import Bools, Floats, Guidance, LaserScan, Observation, Pose, Twist

_ENTRY_PERIOD = 0.1  # [s] period of the entry's smoothing
_MARGIN = 0.01  # [m] least clearance of a command, plus twice the standard deviation of the lidar's noise
_EQUAL = 1e-9  # [m] clearances of two sides that differ by less are equal
_ROOM_MIN = 0.05  # [m] least room for backing up
_INPUTS = 257  # samples of a fuzzy curve, interpolated linearly
_OUTPUTS = 513  # samples of its output sets


@dataclass(slots=True)
class S3FisvfhConfig:
    """Settings of the entry, with angles instead of counts of beams and sectors, and shares of the limits."""

    window: float
    sector: float
    block_distance: float
    size_factor: float
    size_distance: float
    wide_factor: float
    depth: int
    deviation_cost: float
    switch_cost: float
    smoothing: float
    speed: float
    turn: float
    turn_span: float
    look_ahead: float
    clear_ahead: float
    clear_deviation: float
    guard_ahead: float
    guard_clearance: float
    retreat_speed: float
    retreat_turn: float
    retreat_room: float
    check_contact: bool

    def __post_init__(self) -> None:
        for key in ("window", "block_distance", "size_factor", "size_distance", "speed"):
            require(key, getattr(self, key), above=0.0)
        for key in ("deviation_cost", "switch_cost", "guard_clearance", "retreat_room"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("smoothing", "turn"):
            require(key, getattr(self, key), above=0.0, at_most=1.0)
        for key in ("retreat_speed", "retreat_turn"):
            require(key, getattr(self, key), at_least=0.0, at_most=1.0)
        for key in ("turn_span", "look_ahead", "clear_ahead", "clear_deviation", "guard_ahead"):
            require(key, getattr(self, key), above=0.0, at_most=math.pi)
        require("sector", self.sector, at_least=math.radians(0.5), at_most=math.radians(30.0))
        require("wide_factor", self.wide_factor, at_least=1.0)
        require("depth", self.depth, at_least=1, at_most=4)


class S3Fisvfh:
    """Search-Smooth-Safeguard Fuzzy Inference System Vector Field Histogram, winner of BARN's physical round 2025.

    The planner finds the valleys of a polar histogram of the scan (VFH, Borenstein & Koren 1991, DOI
    10.1109/70.88137). A best-first search selects a valley (VFH*, Ulrich & Borenstein 2000, DOI
    10.1109/ROBOT.2000.846405), and its heading is smoothed. Fuzzy rules map the heading to a turn rate and the
    free space ahead to a speed (FISVFH, Balan et al. 2019). A safeguard backs up before obstacles. The LME paper
    describes the entry; its public package gives the values.

    Differences: the entry counts beams and sectors of Jackal's lidar, here they are angles. Turn rates and the
    backing speed are shares of the robot's limits, and sizes follow from the robot. The entry searches the same
    histogram at both steps, which is equivalent to the cheapest first step, `depth: 1`. Added for any robot: it
    stops at the goal and, with `check_contact`, backs up no further than it has driven ahead and never drives into a
    scan point.
    """

    Config = S3FisvfhConfig

    def __init__(self, config: S3FisvfhConfig, robot: Robot) -> None:
        self._config = config
        self._robot = robot
        self._unseen = _unseen(robot, 2 * round(math.pi / config.sector))
        size = 2.0 * robot.r * config.size_factor
        self._contact_margin = _MARGIN + 2.0 * robot.lidar.noise_std
        narrow = 2.0 * math.asin(min(size / (2.0 * config.size_distance), 1.0))
        self._rules = Valleys(
            float(config.window), float(config.block_distance), narrow, config.wide_factor * narrow, narrow
        )
        self._costs = Costs(size, float(config.deviation_cost), float(config.switch_cost), int(config.depth))
        five = np.linspace(0.0, 1.0, 5)
        self._speed = FuzzyCurve(config.window * five, config.speed * five[::-1])
        self._turn = FuzzyCurve(config.turn_span * (2 * five - 1), config.turn * (2 * five - 1))
        self._retention = (1.0 - config.smoothing) ** (robot.dt / _ENTRY_PERIOD)
        half_length, _, rounding = robot.footprint.box
        self._front = half_length + rounding

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the smoothed heading and the room behind."""
        self._heading: float | None = None
        self._pose: Pose | None = None
        self._room = 0.0

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        points = obstacle_points(observation.scan, self._robot.lidar.mount)
        self._note_travel(observation.odometry)
        goal = np.asarray(guidance.subgoal, dtype=np.float64)
        bearing, distance = math.atan2(goal[1], goal[0]), math.hypot(*goal)
        # Obstacles beyond the goal do not count.
        guard = self._front + min(self._config.guard_clearance, distance)
        heading = self._smoothed(self._search_heading(points, goal, bearing, observation.scan))
        if min(nearest_ahead(points, self._config.guard_ahead)) >= guard:
            omega = math.copysign(self._turn(abs(heading)), heading) * observation.limits.omega_max
            v = self._cruise(points, bearing, observation)
            v = self._arrival(v, omega, distance, bearing, observation)
            twist = limited(v, omega, observation, self._robot.dt)
            if self._is_free(twist, points, observation):
                return twist
        return self._retreat(points, guard, heading, observation)

    def _search_heading(self, points: Floats, goal: Floats, bearing: float, scan: LaserScan) -> float:
        """Return the heading of the search [rad]; without one, the goal's bearing limited to the field of view."""
        previous, spacing = bearing if self._heading is None else self._heading, abs(scan.angle_increment)
        heading, success = search(points, self._unseen, goal, previous, spacing, self._rules, self._costs)
        if success:
            return heading
        half, middle = self._robot.lidar.fov / 2, self._robot.lidar.yaw
        deviation = math.remainder(bearing - middle, math.tau)
        return math.remainder(middle + min(max(deviation, -half), half), math.tau)

    def _smoothed(self, heading: float) -> float:
        """Exponential moving average of the headings, on the circle [rad]."""
        if self._heading is not None:
            change = math.remainder(heading - self._heading, math.tau)
            heading = math.remainder(self._heading + (1.0 - self._retention) * change, math.tau)
        self._heading = heading
        return heading

    def _towards(self, bearing: float) -> bool:
        """Return whether the smoothed heading is towards the goal."""
        assert self._heading is not None
        return abs(math.remainder(self._heading - bearing, math.tau)) < self._config.clear_deviation

    def _cruise(self, points: Floats, bearing: float, observation: Observation) -> float:
        """Speed for the clearest sector ahead [m/s]; v_max if all is clear and the heading is towards the goal."""
        config, v_max = self._config, observation.limits.v_max
        clear = min(nearest_ahead(points, config.clear_ahead)) >= config.window
        if clear and self._towards(bearing):
            return v_max
        num_sectors = len(self._unseen)
        spacing = abs(observation.scan.angle_increment)
        density = histogram(points, 0.0, 0.0, spacing, config.window, num_sectors)
        half = max(1, round(config.look_ahead * num_sectors / math.tau))
        middle = num_sectors // 2
        return min(self._speed(float(density[middle - half : middle + half].min())), v_max)

    def _arrival(
        self, v: float, omega: float, distance: float, bearing: float, observation: Observation
    ) -> float:
        """Limit the speed so that the robot can stop at the goal and does not circle it [m/s].

        A robot that turns at ω drives a circle. Above v = ω·d / (2 sin bearing) the circle passes outside the goal.
        """
        limits = observation.limits
        v = min(v, approach(distance, observation.ramp_start.v, limits.v_max, limits.alpha_v, self._robot.dt))
        is_near, deviation = distance <= self._costs.step, abs(bearing)
        if is_near and deviation >= math.pi / 2:
            return 0.0
        if (
            not self._towards(bearing)
            or deviation == 0.0
            or (not is_near and deviation < self._config.clear_deviation)
        ):
            return v
        turning = max(math.copysign(omega, omega * bearing), 0.0)
        return min(v, turning * distance / (2.0 * math.sin(min(deviation, math.pi / 2))))

    def _retreat(self, points: Floats, guard: float, heading: float, observation: Observation) -> Twist:
        """Back up over ground just driven, turning to the clearer side; else turn on the spot; else stop.

        Without `check_contact`, always back up.
        """
        limits, config, dt = observation.limits, self._config, self._robot.dt
        sides = nearest_ahead(points, config.guard_ahead)
        if min(sides) >= guard:  # the obstacle is to the side of the robot
            sides = nearest_ahead(points, math.pi / 2)
        clearer_left = sides[0] - sides[1] if abs(sides[0] - sides[1]) > _EQUAL else heading
        omega = math.copysign(config.retreat_turn * limits.omega_max, clearer_left)
        has_room = not config.check_contact or self._room > _ROOM_MIN
        retreat_v = -config.retreat_speed * limits.v_max if has_room else 0.0
        for v in (retreat_v, 0.0):
            twist = limited(v, omega, observation, dt)
            if self._is_free(twist, points, observation):
                return twist
        return limited(0.0, 0.0, observation, dt)

    def _note_travel(self, pose: Pose) -> None:
        """Update the distance that the robot may back up into the lidar's blind arc [m]."""
        if self._pose is not None:
            ahead = relative(pose, self._pose).x
            self._room = min(max(self._room + ahead, 0.0), self._config.retreat_room)
        self._pose = pose

    def _is_free(self, twist: Twist, points: Floats, observation: Observation) -> bool:
        """Return whether the footprint stays clear of all points during this command and braking.

        Without `check_contact`, every command counts as free.
        """
        if not self._config.check_contact:
            return True
        limits = observation.limits
        braking = max(abs(twist.v) / limits.alpha_v, abs(twist.omega) / limits.alpha_omega) / 2.0
        time = self._robot.dt + braking
        clearance, min_clearance = least_clearance(
            points, self._robot.footprint.box, twist.v, twist.omega, time
        )
        return min_clearance >= min(self._contact_margin, clearance)


def _unseen(robot: Robot, num_sectors: int) -> Bools:
    """Return whether each sector's middle is outside the field of view: (num_sectors,)."""
    lidar = robot.lidar
    middles = -math.pi + (np.arange(num_sectors) + 0.5) * math.tau / num_sectors
    off_axis = np.abs(np.remainder(middles - lidar.yaw + math.pi, math.tau) - math.pi)
    return np.asarray(off_axis > lidar.fov / 2 + lidar.angle_increment / 2)


class FuzzyCurve:
    """Mamdani inference for rules "if the input is about a_k, then the output is about b_k".

    Each set is a triangle between its neighbours' peaks. Output sets are clipped at the membership of the input
    (min) and joined (max); the output is the centroid of the result. Inputs beyond the outermost peaks belong to
    the outermost sets. The outermost sets are half triangles, so the outermost outputs are not quite reached.
    Source: Mamdani & Assilian 1975, DOI 10.1016/S0020-7373(75)80002-2.
    """

    def __init__(self, inputs: Floats, outputs: Floats) -> None:
        """Peaks (K,) of the input sets, rising, and of the output sets, rising or falling."""
        rows, peaks = np.eye(len(outputs)), outputs
        if outputs[0] > outputs[-1]:  # sort the output peaks, and keep the pairs
            rows, peaks = rows[::-1], peaks[::-1]
        self._at = np.linspace(inputs[0], inputs[-1], _INPUTS)
        universe = np.linspace(peaks[0], peaks[-1], _OUTPUTS)
        covered = np.zeros((_INPUTS, _OUTPUTS))
        for membership, degrees in zip(np.eye(len(inputs)), rows, strict=True):
            degree = np.interp(self._at, inputs, membership)
            shape = np.interp(universe, peaks, degrees)
            np.maximum(covered, np.minimum(degree[:, None], shape), out=covered)
        # Centroid by the trapezoidal rule.
        trapezoid = np.ones(_OUTPUTS)
        trapezoid[[0, -1]] = 0.5
        weights = covered * trapezoid
        self._values = (weights @ universe) / weights.sum(axis=1)

    def __call__(self, value: float) -> float:
        """Return the output for one input."""
        return float(np.interp(value, self._at, self._values))
