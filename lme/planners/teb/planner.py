"""Timed elastic bands, as teb_local_planner drives them, and its recoveries."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np

from lme.geometry.frames import to_world
from lme.geometry.polyline import stretch
from lme.grids.obstacle_grid import TOUCHING
from lme.mapping.costmap import LocalCostmap
from lme.planners.commands import limited
from lme.planners.teb.band import LocalPath, TebConfig, TimedBand
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Pose, Twist

_HEADING_POINTS = 3  # points of the path after the local goal that say its heading
_MAX_FAILURES = 10  # failures in a row


class Teb:
    """A timed elastic band (Rösmann et al. 2012, 2013, DOI 10.1109/ECMR.2013.6698833) as in teb_local_planner of ROS 1.

    A trajectory of poses and time differences along the path ahead is optimised for time, limits, nonholonomic motion,
    distance to the obstacles of a local costmap, and distance to points of the path. It starts along the path and
    continues from the last solution. The command is its first motion. If its first poses touch obstacles, or if it is
    lost, the robot stops and a new band starts, for some time along a shorter path.
    """

    Config = TebConfig

    def __init__(self, config: TebConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._check_spacing = robot.footprint.inscribed_radius + config.costmap.footprint_padding  # [m]
        self.costmap = LocalCostmap(config.costmap, robot)
        self.band = TimedBand(config, robot.footprint.box)
        self._horizon = Horizon(config, robot.dt)
        self._oscillation = Oscillation(config, robot.dt, config.max_vel_x, config.max_vel_theta)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget map, band and failures; `rng` draws the phase of the map's clock."""
        self.costmap.reset(rng)
        self.band.reset()
        self._horizon.reset()
        self._oscillation.reset()

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        config = self._config
        self.costmap.update(observation)
        if math.hypot(*observation.target) < config.xy_goal_tolerance:
            self.band.reset()
            return limited(0.0, 0.0, observation, self._dt)
        feasible = self._optimize(observation, guidance)
        self._horizon.record(failed=not feasible)
        command = Twist(0.0, 0.0)
        if feasible:
            # The optimisation may exceed the configured limits.
            v, omega = self.band.command()
            v = min(max(v, -config.max_vel_x_backwards), config.max_vel_x)
            command = Twist(v, min(max(omega, -config.max_vel_theta), config.max_vel_theta))
        else:
            self.band.reset()
        self._oscillation.record(command, observation.ramp_start.omega)
        return limited(*command, observation, self._dt)

    def _optimize(self, observation: Observation, guidance: Guidance) -> bool:
        """Adjust the band; return whether it is feasible."""
        pose, limits = observation.odometry, observation.limits
        route = self._route(observation, guidance)
        self.band.follow(route, pose, limits)
        turn = self._oscillation.turn
        total = self.band.optimize(route.via, self._obstacles(pose), observation.ramp_start, limits, turn)
        max_chi_squared = self._config.divergence_detection_max_chi_squared
        return math.isfinite(total) and (max_chi_squared is None or total <= max_chi_squared) and self._free()

    def _route(self, observation: Observation, guidance: Guidance) -> LocalPath:
        """Return the path ahead up to the horizon; a straight line to the subgoal if there is no path."""
        config, line = self._config, guidance.path
        if line is None or len(line) == 0:
            line = np.vstack([np.zeros(2), guidance.subgoal])
        end, spacing = config.max_global_plan_lookahead_dist * self._horizon.share, config.path_spacing
        points = np.vstack([line[:1], stretch(line, 0.0, end, spacing)])
        extension = stretch(line, end, end + _HEADING_POINTS * spacing, spacing)
        direction = extension[-1] - points[-1] if len(extension) else points[-1] - points[-2:][0]
        yaw = observation.odometry.yaw + math.atan2(direction[1], direction[0])
        step = max(round(config.global_plan_viapoint_sep / spacing), 1)
        ahead = to_world(points, observation.odometry)
        return LocalPath(ahead[1:] if len(ahead) > 1 else ahead, ahead[step::step], yaw)

    def _obstacles(self, pose: Pose) -> Floats:
        """Centres (M, 2) of the occupied cells, without those far behind the robot, in the odometry frame [m]."""
        low_i, low_j, cell = self.costmap.grid
        i, j = np.nonzero(self.costmap.costs == TOUCHING)
        points = np.column_stack([(i + low_i) * cell, (j + low_j) * cell])
        dx, dy = points[:, 0] - pose.x, points[:, 1] - pose.y
        ahead = math.cos(pose.yaw) * dx + math.sin(pose.yaw) * dy >= 0.0
        return points[ahead | (np.hypot(dx, dy) <= self._config.costmap_obstacles_behind_robot_dist)]

    def _free(self) -> bool:
        """Return whether the padded outline touches no obstacle at the first poses, nor between them."""
        poses = self.band.poses[: self._config.feasibility_check_no_poses + 1]
        if any(self._touches(pose) for pose in poses):
            return False
        for first_pose, next_pose in pairwise(poses):
            motion = next_pose - first_pose
            motion[2] = math.remainder(motion[2], math.tau)
            count = math.ceil(math.hypot(motion[0], motion[1]) / self._check_spacing)
            if any(self._touches(first_pose + motion * k / count) for k in range(1, count)):
                return False
        return True

    def _touches(self, pose: Floats) -> bool:
        """Return whether the padded outline touches an obstacle at a pose (3,)."""
        return self.costmap.outline_cost(Pose(*pose.tolist())) < 0


class Horizon:
    """Share of the horizon in use: half of it for some time after a failure, a quarter after ten in a row.

    teb_local_planner says the same, but its code then uses three quarters.
    """

    def __init__(self, config: TebConfig, dt: float) -> None:
        """dt: control period [s]."""
        self._periods = round(config.shrink_horizon_min_duration / dt)
        self.reset()

    def reset(self) -> None:
        """Forget all failures."""
        self._in_a_row, self._remaining = 0, 0

    @property
    def share(self) -> float:
        """Share of the horizon to use."""
        if self._remaining == 0:
            return 1.0
        return 0.25 if self._in_a_row >= _MAX_FAILURES else 0.5

    def record(self, *, failed: bool) -> None:
        """Record whether this period failed to give a feasible band."""
        if failed:
            self._in_a_row, self._remaining = self._in_a_row + 1, self._periods
        else:
            self._in_a_row, self._remaining = 0, max(self._remaining - 1, 0)


class Oscillation:
    """Detects commands that waver on the spot, and then keeps the current direction of turns for some time."""

    def __init__(self, config: TebConfig, dt: float, v_max: float, omega_max: float) -> None:
        """dt: control period [s]; v_max [m/s] and omega_max [rad/s]: the limits that commands are measured by."""
        self._config = config
        self._scale = (v_max, omega_max)
        self._size = max(round(config.oscillation_filter_duration / dt), 2)
        self._periods = round(config.oscillation_recovery_min_duration / dt)
        self.reset()

    def reset(self) -> None:
        """Forget all commands."""
        self._commands: deque[tuple[float, float]] = deque(maxlen=self._size)
        self._remaining, self.turn = 0, 0.0  # periods to keep to the direction; 1 left, -1 right, 0 any

    def record(self, command: Twist, omega: float) -> None:
        """Record a command, and the turn rate [rad/s] at which the robot is turning."""
        self._commands.append((command.v / self._scale[0], command.omega / self._scale[1]))
        self._remaining = max(self._remaining - 1, 0)
        if self._wavers():
            if self._remaining == 0:
                self.turn = 1.0 if omega > 0.0 else -1.0
            self._remaining = self._periods
        elif self._remaining == 0:
            self.turn = 0.0

    def _wavers(self) -> bool:
        """Return whether mean velocity and turn rate are near zero, but the turns change sides."""
        commands, config = self._commands, self._config
        if len(commands) < self._size // 2:
            return False
        v = sum(command[0] for command in commands) / len(commands)
        omega = sum(command[1] for command in commands) / len(commands)
        sides = [math.copysign(1.0, command[1]) if command[1] else 0.0 for command in commands]
        changes = sum(side != next_side for side, next_side in pairwise(sides))
        return abs(v) < config.oscillation_v_eps and abs(omega) < config.oscillation_omega_eps and changes > 1
