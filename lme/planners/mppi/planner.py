"""Model predictive path integral control (MPPI), as in Nav2's default controller."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_world
from lme.geometry.polyline import stretch
from lme.grids.obstacle_grid import HIGHEST
from lme.mapping.costmap import LocalCostmap, LocalCostmapConfig
from lme.planners.commands import limited
from lme.planners.mppi import kernels
from lme.planners.mppi.kernels import (
    Singles,
    VelocityLimits,
    average,
    charge_controls,
    constrain,
    rollout,
    smooth,
)
from lme.robots import Robot
from lme.types import Floats, Guidance, Limits, Observation, Twist

_REMEMBERED = 4  # commands before the present one, for the filter
_SHORTEST = 10  # [steps] the filter looks at nine of them


@dataclass(slots=True)
class WeightConfig:
    """Critic with nothing but a weight."""

    cost_weight: float


@dataclass(slots=True)
class ThresholdConfig:
    """Critic with a weight that counts only near the target (GoalCritic) or away from it (PreferForwardCritic)."""

    cost_weight: float
    threshold_to_consider: float


@dataclass(slots=True)
class ObstacleCostConfig:
    """CostCritic: costs of the map under the robot."""

    cost_weight: float
    critical_cost: float
    collision_cost: float
    near_goal_distance: float
    trajectory_point_step: int


@dataclass(slots=True)
class PathAlignConfig:
    """PathAlignCritic: distance to the path, at equal path lengths."""

    cost_weight: float
    max_path_occupancy_ratio: float
    trajectory_point_step: int
    threshold_to_consider: float
    offset_from_furthest: int


@dataclass(slots=True)
class PathFollowConfig:
    """PathFollowCritic: distance from the end of a trajectory to a point of the path."""

    cost_weight: float
    offset_from_furthest: int
    threshold_to_consider: float


@dataclass(slots=True)
class PathAngleConfig:
    """PathAngleCritic: angle between the end of a trajectory and a point of the path."""

    cost_weight: float
    offset_from_furthest: int
    threshold_to_consider: float
    max_angle_to_furthest: float


_CRITICS = ("constraint", "cost", "goal", "path_align", "path_follow", "path_angle", "prefer_forward")
_COUNTS = {
    "cost": ("trajectory_point_step", 1),
    "path_align": ("trajectory_point_step", 1),
    "path_follow": ("offset_from_furthest", 0),
    "path_angle": ("offset_from_furthest", 0),
}


@dataclass(slots=True)
class MppiConfig:
    """Samples, limits, path, critics and local costmap."""

    time_steps: int
    model_dt: float
    batch_size: int
    iteration_count: int
    retry_attempt_limit: int
    vx_std: float
    wz_std: float
    vx_max: float
    vx_min: float
    wz_max: float
    ax_max: float
    ax_min: float
    az_max: float
    temperature: float
    gamma: float
    prune_distance: float
    path_spacing: float
    xy_goal_tolerance: float
    constraint: WeightConfig
    cost: ObstacleCostConfig
    goal: ThresholdConfig
    path_align: PathAlignConfig
    path_follow: PathFollowConfig
    path_angle: PathAngleConfig
    prefer_forward: ThresholdConfig
    costmap: LocalCostmapConfig

    def __post_init__(self) -> None:
        for key in ("model_dt", "vx_std", "wz_std", "vx_max", "wz_max", "ax_max", "az_max"):
            require(key, getattr(self, key), above=0.0)
        for key in ("temperature", "prune_distance", "path_spacing"):
            require(key, getattr(self, key), above=0.0)
        for key in ("gamma", "xy_goal_tolerance", "retry_attempt_limit"):
            require(key, getattr(self, key), at_least=0.0)
        for key in ("vx_min", "ax_min"):
            require(key, getattr(self, key), at_most=0.0)
        require("time_steps", self.time_steps, at_least=_SHORTEST, at_most=500)
        require("batch_size", self.batch_size, at_least=1, at_most=50_000)
        require("iteration_count", self.iteration_count, at_least=1)
        for critic in _CRITICS:
            require(f"{critic}.cost_weight", getattr(self, critic).cost_weight, at_least=0.0)
        for critic, (key, minimum) in _COUNTS.items():
            require(f"{critic}.{key}", getattr(getattr(self, critic), key), at_least=minimum)


def draw(rng: np.random.Generator, samples: int, steps: int) -> Singles:
    """Standard normal noise (samples, steps, 2) of velocities and turn rates."""
    return rng.standard_normal((samples, steps, 2), dtype=np.float32)


class Mppi:
    """MPPI (Williams et al. 2017, DOI 10.1109/ICRA.2017.7989202) as in nav2_mppi_controller of ROS 2 Jazzy.

    Noise around the last sequence of controls gives a batch of trajectories. Critics score them on a local costmap, and
    the weighted mean of their controls is the next sequence. If all of them touch obstacles, the sequence begins anew
    from rest, `retry_attempt_limit` times, and then the robot stops. If the control period of the robot is
    longer than a step of the model, a command is the mean of the controls within it.
    """

    Config = MppiConfig

    def __init__(self, config: MppiConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._hold = math.floor(robot.dt / config.model_dt + 1e-6)  # [steps] of the model for one command
        self._hold = min(self._hold, config.time_steps - 1)
        self.costmap = LocalCostmap(config.costmap, robot)
        self._critics = Critics(config, self.costmap, robot)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget map and controls."""
        self._rng = rng
        self.costmap.reset(rng)
        self._forget()

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        self.costmap.update(observation)
        if math.hypot(*observation.target) < self._config.xy_goal_tolerance:
            self._forget()
            return limited(0.0, 0.0, observation, self._dt)
        path = self._path(observation, guidance)
        limits = self._limits(observation.limits)
        for _ in range(self._config.retry_attempt_limit + 1):
            if self._optimize(observation, path, limits):
                return limited(*self._command(limits), observation, self._dt)
            self._forget()
        return limited(0.0, 0.0, observation, self._dt)

    def _forget(self) -> None:
        """Start again from rest."""
        self.sequence = np.zeros((self._config.time_steps, 2))  # of controls [m/s, rad/s]
        self._sent_controls = np.zeros((_REMEMBERED, 2))

    def _path(self, observation: Observation, guidance: Guidance) -> Floats:
        """Return the first `prune_distance` of the path from the robot, in the odometry frame: (P, 2), P ≥ 2."""
        config, line = self._config, guidance.path
        if line is None or len(line) == 0:
            line = np.vstack([np.zeros(2), guidance.subgoal])
        ahead = stretch(line, 0.0, config.prune_distance, config.path_spacing)
        ahead = ahead if len(ahead) else line[-1:]
        return to_world(np.vstack([line[:1], ahead]), observation.odometry)

    def _limits(self, robot: Limits) -> VelocityLimits:
        """Return the configured limits within those of the robot."""
        config = self._config
        return (
            max(config.vx_min, robot.lowest),
            min(config.vx_max, robot.v_max),
            min(config.wz_max, robot.omega_max),
            max(config.ax_min, -robot.alpha_v),
            min(config.ax_max, robot.alpha_v),
            min(config.az_max, robot.alpha_omega),
        )

    def _optimize(self, observation: Observation, path: Floats, limits: VelocityLimits) -> bool:
        """Improve the sequence; return whether some trajectory is free."""
        config, stds = self._config, (self._config.vx_std, self._config.wz_std)
        for _ in range(config.iteration_count):
            noise = draw(self._rng, config.batch_size, config.time_steps)
            controls, speeds, poses = rollout(
                self.sequence,
                noise,
                stds,
                observation.ramp_start,
                observation.odometry,
                limits,
                config.model_dt,
            )
            costs, free = self._critics.score(observation, path, speeds, poses, limits[:2])
            charge_controls(costs, self.sequence, controls, stds, config.gamma)
            self.sequence = average(controls, costs, config.temperature)
            constrain(self.sequence, limits, config.model_dt)
        return free

    def _command(self, limits: VelocityLimits) -> tuple[float, float]:
        """Return the mean of the filtered controls until the next command, and advance the sequence to it."""
        sequence, hold = smooth(self.sequence, self._sent_controls), self._hold
        controls = sequence[1 : hold + 1] if hold else sequence[:1]  # element 0 is the present control
        self._sent_controls = np.vstack([self._sent_controls, controls])[-_REMEMBERED:]
        self.sequence = np.vstack([sequence[hold:], np.repeat(sequence[-1:], hold, axis=0)])
        v, omega = controls.mean(axis=0).tolist()
        return min(max(v, limits[0]), limits[1]), min(max(omega, -limits[2]), limits[2])


class Critics:
    """Adds up the costs that the critics assign to each trajectory.

    Nav2's GoalAngleCritic is missing: goals here have no heading. The critics that the challenge does not use are, too.
    """

    def __init__(self, config: MppiConfig, costmap: LocalCostmap, robot: Robot) -> None:
        self._config = config
        self._costmap = costmap
        inscribed = robot.footprint.inscribed_radius + config.costmap.footprint_padding
        self._possible = _cost_at_corner(config, costmap.outline, inscribed)

    def score(
        self,
        observation: Observation,
        path: Floats,
        speeds: Singles,
        poses: Singles,
        bounds: tuple[float, float],
    ) -> tuple[Floats, bool]:
        """Return the costs (N,) of the trajectories, and whether some trajectory is free.

        path (P, 2), P ≥ 2, from the robot on, and poses (N, T, 3) are in the odometry frame; speeds (N, T); bounds of
        the velocity (v_min, v_max) [m/s].
        """
        config, map_, dt = self._config, self._costmap, self._config.model_dt
        target_distance = math.hypot(*observation.target)
        costs = np.zeros(len(poses))
        # Critics of velocity and obstacles, for every distance to the target.
        kernels.constraint(costs, speeds, bounds, dt, config.constraint.cost_weight)
        cost = config.cost
        collide = kernels.obstacles(
            costs,
            poses,
            cost.trajectory_point_step,
            map_.costs,
            map_.grid,
            map_.outline,
            self._possible,
            (cost.collision_cost, cost.critical_cost, cost.cost_weight),
            target_distance < cost.near_goal_distance,
        )
        # Critics that count only near the target, or only away from it.
        if target_distance < config.goal.threshold_to_consider:
            x, y = to_world(observation.target, observation.odometry)
            kernels.goal(costs, poses, (float(x), float(y)), config.goal.cost_weight)
        self._along_path(costs, observation, path, poses, target_distance)
        if target_distance >= config.prefer_forward.threshold_to_consider:
            kernels.prefer_forward(costs, speeds, dt, config.prefer_forward.cost_weight)
        return costs, not collide

    def _along_path(
        self, costs: Floats, observation: Observation, path: Floats, poses: Singles, target_distance: float
    ) -> None:
        """Apply the critics of the path. target_distance: distance to the target [m]."""
        config, map_ = self._config, self._costmap
        # Points of the path that are free, and the furthest one that some trajectory reaches.
        free = kernels.free_points(path, map_.costs, map_.grid)
        furthest = kernels.furthest_reached(poses, path)
        align, follow, angle = config.path_align, config.path_follow, config.path_angle
        if target_distance >= align.threshold_to_consider:
            kernels.path_align(
                costs,
                poses,
                path,
                free,
                furthest,
                align.trajectory_point_step,
                align.offset_from_furthest,
                align.max_path_occupancy_ratio,
                align.cost_weight,
            )
        if target_distance >= follow.threshold_to_consider:
            kernels.path_follow(
                costs, poses, path, free, furthest, follow.offset_from_furthest, follow.cost_weight
            )
        if target_distance >= angle.threshold_to_consider:
            index = min(furthest + angle.offset_from_furthest, len(path) - 1)
            max_angle, weight = angle.max_angle_to_furthest, angle.cost_weight
            kernels.path_angle(costs, poses, path, observation.odometry, index, max_angle, weight)


def _cost_at_corner(config: MppiConfig, outline: Floats, inscribed: float) -> float:
    """Least cost at which a corner of the outline (P, 2) may touch an obstacle; 0 if the inflation ends before."""
    corner = float(np.hypot(*outline.T).max())
    if config.costmap.inflation_radius < corner:
        return 0.0
    return math.floor(HIGHEST * math.exp(-config.costmap.cost_scaling_factor * (corner - inscribed)))
