"""The elastic band along the plan, and the velocity along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import wrap_angle
from lme.mapping.costmap import LocalCostmap, LocalCostmapConfig
from lme.planners.ros_eband.kernels import Rules, expand, expansion, optimize, overlaps, refine
from lme.types import Floats, Observation, Pose, Twist

_SHARE = 0.7  # of a bubble's expansion, in speeds and angles
_NEAR_GOAL_M, _SLOWEST_M_S, _SLOW_M_S = (
    0.75,
    0.15,
    0.3,
)  # half as fast nearer to the goal, but not if slow anyway


@dataclass(slots=True)
class BandConfig:
    """Settings of the band and of the controller, with the names of eband_local_planner."""

    eband_min_relative_overlap: float
    eband_tiny_bubble_distance: float
    eband_tiny_bubble_expansion: float
    eband_internal_force_gain: float
    eband_external_force_gain: float
    num_iterations_eband_optimization: int
    eband_equilibrium_approx_max_recursion_depth: int
    eband_equilibrium_relative_overshoot: float
    eband_significant_force_lower_bound: float
    costmap_weight: float
    max_vel_lin: float
    min_vel_lin: float
    max_vel_th: float
    k_prop: float
    bubble_velocity_multiplier: float
    rotation_threshold_multiplier: float
    plan_yaw: float
    costmap: LocalCostmapConfig

    def __post_init__(self) -> None:
        for key in (
            "eband_min_relative_overlap",
            "eband_tiny_bubble_expansion",
            "costmap_weight",
            "max_vel_lin",
        ):
            require(key, getattr(self, key), above=0.0)
        for key in ("max_vel_th", "k_prop", "bubble_velocity_multiplier", "rotation_threshold_multiplier"):
            require(key, getattr(self, key), above=0.0)
        for key in ("eband_tiny_bubble_distance", "eband_internal_force_gain", "eband_external_force_gain"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("eband_equilibrium_relative_overshoot", "eband_significant_force_lower_bound"):
            require(key, getattr(self, key), at_least=0.0)
        require("num_iterations_eband_optimization", self.num_iterations_eband_optimization, at_least=1)
        depth = self.eband_equilibrium_approx_max_recursion_depth
        require("eband_equilibrium_approx_max_recursion_depth", depth, at_least=1)
        require("min_vel_lin", self.min_vel_lin, at_least=0.0, at_most=self.max_vel_lin)
        require("plan_yaw", self.plan_yaw, at_least=-math.pi, at_most=math.pi)


class ElasticBand:
    """EBandPlannerROS of eband_local_planner 0.4.0, with the controller for differential drives.

    Based on Quinlan & Khatib 1993, DOI 10.1109/ROBOT.1993.291936; source: github.com/utexas-bwi/eband_local_planner.
    The band is made anew from each plan: all of it on the map. If one of its poses is forbidden, all obstacles of the
    local costmap are forgotten, and the band is made on the empty map. The robot aims at the centre of the next
    bubble, and turns on the spot towards one that is far off its heading. No footprint is checked. The last
    orientation of a goal is not turned to.
    """

    def __init__(self, config: BandConfig, costmap: LocalCostmap) -> None:
        self._config = config
        self._costmap = costmap
        self._reach = config.costmap.size / 2.0
        self._rules = Rules(
            config.costmap_weight,
            config.eband_min_relative_overlap,
            config.eband_tiny_bubble_distance,
            config.eband_tiny_bubble_expansion,
            config.eband_internal_force_gain,
            config.eband_external_force_gain,
            config.num_iterations_eband_optimization,
            config.eband_equilibrium_approx_max_recursion_depth,
            config.eband_equilibrium_relative_overshoot,
            config.eband_significant_force_lower_bound,
            float(np.hypot(*costmap.outline.T).max()),
        )

    def reset(self) -> None:
        """Forget plan and band."""
        self._plan: Floats = np.empty((0, 2))
        self._end = 0  # index of the first pose of the plan that is not in the band
        self.band: Floats = np.empty((0, 4))

    def set_plan(self, path: Floats, pose: Pose) -> bool:
        """Make the band of a path (K, 2) in the odometry frame [m]; False if there is none even on an empty map."""
        self._plan, self._end = path, 0
        self._end = self._window_end(pose)
        bubbles = self._bubbles(0, max(self._end, 2))
        if len(bubbles) < 2:
            return False
        band = self._on_map(bubbles)
        if len(band) == 0:
            self._costmap.forget()
            band = self._on_map(bubbles)
        if len(band) == 0:
            return False
        self.band = self._optimized(band)
        return True

    def command(self, observation: Observation) -> Twist | None:
        """Return the velocity from the robot's pose along the band; None if the band is broken."""
        if not (self._connect(observation.odometry) and self._extend(observation.odometry)):
            return None
        costmap = self._costmap
        band = optimize(costmap.costs, costmap.grid, self.band, self._rules)
        if len(band) == 0:
            return None
        self.band = band
        return self._velocity(band)

    def _window_end(self, pose: Pose) -> int:
        """Index after the first pose of the plan that is beyond the map, from those in the band on."""
        away = np.hypot(self._plan[self._end :, 0] - pose.x, self._plan[self._end :, 1] - pose.y)
        beyond = np.flatnonzero(away > self._reach)
        return self._end + int(beyond[0]) + 1 if len(beyond) else len(self._plan)

    def _bubbles(self, begin: int, end: int) -> Floats:
        """Bubbles at poses of the plan, which all have the same yaw: (N, 4)."""
        points = self._plan[begin:end]
        return np.column_stack(
            [points, np.full((len(points), 1), self._config.plan_yaw), np.zeros(len(points))]
        )

    def _on_map(self, bubbles: Floats) -> Floats:
        """Band of bubbles on the current map; empty if one is forbidden or a gap cannot be filled."""
        costmap = self._costmap
        if not expand(costmap.costs, costmap.grid, bubbles, self._rules):
            return bubbles[:0]
        return refine(costmap.costs, costmap.grid, bubbles, self._rules)

    def _optimized(self, band: Floats) -> Floats:
        """Return the band after the forces, or as it is if they break it."""
        costmap = self._costmap
        optimized = optimize(costmap.costs, costmap.grid, band, self._rules)
        return optimized if len(optimized) else band

    def _connect(self, pose: Pose) -> bool:
        """Begin the band at the robot: join it to the last bubble that it overlaps, or else to the first one."""
        costmap, rules = self._costmap, self._rules
        radius = expansion(costmap.costs, costmap.grid, pose.x, pose.y, rules.costmap_weight)
        if radius <= 0.0:
            return False
        robot = np.array([*pose, radius])
        for k in range(len(self.band) - 1, -1, -1):
            if overlaps(robot, self.band[k], rules):
                self.band = np.vstack([robot, self.band[k:]])
                return True
        bridge = refine(costmap.costs, costmap.grid, np.vstack([robot, self.band[:1]]), rules)
        if len(bridge) == 0:
            return False
        self.band = np.vstack([bridge, self.band[1:]])
        return True

    def _extend(self, pose: Pose) -> bool:
        """Append the poses of the plan that have come on the map; False if they do not join the band."""
        costmap, rules = self._costmap, self._rules
        end = self._window_end(pose)
        if end <= self._end:
            return True
        added = self._bubbles(self._end, end)
        if not expand(costmap.costs, costmap.grid, added, rules):
            return False
        joined = next((k for k in range(len(self.band) - 1) if overlaps(added[0], self.band[k], rules)), None)
        if joined is None:
            bridge = refine(costmap.costs, costmap.grid, np.vstack([self.band[-1:], added[:1]]), rules)
            if len(bridge) == 0:
                return False
            self.band = np.vstack([self.band, bridge[1:-1], added])
        else:
            self.band = np.vstack([self.band[: joined + 1], added])
        self._end = end
        return True

    def _velocity(self, band: Floats) -> Twist:
        """Velocity of the controller for differential drives along a band (N, 4), N ≥ 2, that begins at the robot."""
        config = self._config
        (x, y, yaw, radius), (next_x, next_y, _, next_radius) = band[0].tolist(), band[1].tolist()
        distance = math.hypot(next_x - x, next_y - y)
        error = wrap_angle(math.atan2(next_y - y, next_x - x) - yaw)
        omega = min(max(config.k_prop * error, -config.max_vel_th), config.max_vel_th)
        threshold = config.rotation_threshold_multiplier * math.atan2(_SHARE * next_radius, distance)
        if abs(error) > threshold:
            return Twist(0.0, omega)
        fastest = config.max_vel_lin
        if math.dist(band[-1, :2], (x, y)) < _NEAR_GOAL_M:
            fastest = _SLOWEST_M_S if fastest < _SLOW_M_S else fastest / 2.0
        v = config.bubble_velocity_multiplier * _SHARE * radius * fastest * math.cos(error)
        return Twist(min(max(v, config.min_vel_lin), config.max_vel_lin), omega)
