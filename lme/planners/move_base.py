"""State machine of ROS move_base around a local planner."""

from __future__ import annotations

import math
from enum import Enum, auto
from typing import Protocol

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_world, wrap_angle
from lme.geometry.polyline import stretch
from lme.mapping.costmap import LocalCostmap
from lme.planners.commands import limited
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Pose, Twist

_STOP = Twist(0.0, 0.0)
_STEP = 0.017  # [rad] between the checks of a turn; rotate_recovery's sim_granularity


class MoveBaseConfig(Protocol):
    """Settings of move_base, and of rotate_recovery, which reads those of TrajectoryPlannerROS."""

    xy_goal_tolerance: float
    planner_patience: float
    controller_patience: float
    yaw_goal_tolerance: float
    acc_lim_theta: float
    min_in_place_vel_theta: float
    max_vel_theta: float


def check_move_base(config: MoveBaseConfig) -> None:
    """Raise InputError unless the settings are possible."""
    for key in ("xy_goal_tolerance", "planner_patience", "controller_patience", "min_in_place_vel_theta"):
        require(key, getattr(config, key), at_least=0.0)
    for key in ("acc_lim_theta", "max_vel_theta"):
        require(key, getattr(config, key), above=0.0)
    require("yaw_goal_tolerance", config.yaw_goal_tolerance, above=0.0, at_most=1.0)


class LocalPlanner(Protocol):
    """A local planner of move_base (nav_core's BaseLocalPlanner). Paths and poses are in the odometry frame."""

    def reset(self) -> None:
        """Start a new episode."""

    def set_plan(self, path: Floats, pose: Pose) -> bool:
        """Take a new plan (K, 2), K ≥ 1 [m], that begins at the robot's pose. False: the robot gives up."""

    def command(self, observation: Observation) -> Twist | None:
        """Return a velocity along the plan; None if there is none."""


class _State(Enum):
    PLANNING = auto()  # there is no plan yet, or none that the robot could follow
    CONTROLLING = auto()
    CLEARING = auto()  # a recovery is due or under way
    ABORTED = auto()


class MoveBase:
    """move_base (Marder-Eppstein et al. 2010, DOI 10.1109/ROBOT.2010.5509725) with the BARN Challenge's recoveries.

    The algorithm is that of github.com/ros-planning/navigation. Without a plan for `planner_patience`, or without a
    velocity for `controller_patience`, recoveries follow: two turns on the spot, each after a reset of the costmaps.
    Then the robot gives up. BARN's resets name no layer of BARN's costmaps and clear nothing, so a reset is only
    another wait here. A blocked guide has no plan.
    """

    def __init__(
        self,
        config: MoveBaseConfig,
        robot: Robot,
        costmap: LocalCostmap,
        local_planner: LocalPlanner,
        spacing: float | None = None,
    ) -> None:
        """spacing: greatest distance between the points of a plan [m]; None: a plan has the guide's points."""
        self._settings = config
        self._dt = robot.dt
        self._costmap = costmap
        self._local_planner = local_planner
        self._spacing = spacing

    def reset(self, rng: np.random.Generator) -> None:
        """Forget map, plan and recoveries."""
        self._costmap.reset(rng)
        self._local_planner.reset()
        self._state = _State.PLANNING
        self._plan_end = (math.nan, math.nan)  # in the odometry frame [m]
        self._time = self._planned = self._controlled = 0.0  # [s] now, at the last plan, at the last velocity
        self._no_plan = True  # whether the last recovery was due to the lack of a plan
        self._recovery = 0  # number of the next recovery
        self._turn: _Turn | None = None

    def plan(self, observation: Observation, guidance: Guidance) -> Twist:
        """Return the command for one control period."""
        self._time += self._dt
        self._costmap.update(observation)
        v, omega = self._cycle(observation, guidance) or _STOP
        return limited(v, omega, observation, self._dt)

    def _cycle(self, observation: Observation, guidance: Guidance) -> Twist | None:
        """Run one cycle of the state machine; None means stop."""
        if self._turn is not None:
            return self._keep_turning(observation.odometry)
        self._take_plan(observation, guidance)
        if self._state is _State.CONTROLLING:
            return self._control(observation)
        if self._state is _State.CLEARING:
            self._recover(observation.odometry)
        return None

    def _take_plan(self, observation: Observation, guidance: Guidance) -> None:
        """Take a new plan; without one, keep the old plan while the robot can follow it, but not forever."""
        if self._state is _State.ABORTED:
            return
        if not guidance.blocked:
            path = guidance.path if guidance.path is not None else np.vstack([np.zeros(2), guidance.subgoal])
            if self._spacing is not None:  # the ends stay
                path = np.vstack([path[:1], stretch(path, 0.0, math.inf, self._spacing)])
            plan = to_world(path, observation.odometry)
            if not self._local_planner.set_plan(plan, observation.odometry):
                self._state = _State.ABORTED
                return
            self._plan_end = (float(plan[-1, 0]), float(plan[-1, 1]))
            self._planned, self._state = self._time, _State.CONTROLLING
            if self._no_plan:
                self._recovery = 0
        elif self._state is _State.PLANNING and self._time - self._planned > self._settings.planner_patience:
            self._state, self._no_plan = _State.CLEARING, True

    def _control(self, observation: Observation) -> Twist | None:
        """Follow the plan."""
        if math.dist(self._plan_end, observation.odometry[:2]) <= self._settings.xy_goal_tolerance:
            self._controlled = self._time
            return None
        command = self._local_planner.command(observation)
        if command is not None:
            self._controlled = self._time
            if not self._no_plan:
                self._recovery = 0
        elif self._time - self._controlled > self._settings.controller_patience:
            self._state, self._no_plan = _State.CLEARING, False
        else:
            self._planned, self._state = self._time, _State.PLANNING
        return command

    def _recover(self, pose: Pose) -> None:
        """Begin the next recovery; after the last one give up."""
        self._recovery += 1
        self._planned, self._state = self._time, _State.PLANNING
        if self._recovery in (2, 4):
            self._turn = _Turn(self._settings, pose)
        elif self._recovery > 4:
            self._state = _State.ABORTED

    def _keep_turning(self, pose: Pose) -> Twist | None:
        """Turn on the spot; return None at the end of the turn."""
        assert self._turn is not None
        omega = self._turn.rate(pose, self._costmap)
        if omega is None:
            self._turn = None
            self._planned = self._time
            return None
        return Twist(0.0, omega)


class _Turn:
    """Full turn on the spot to the left: move_base's rotate_recovery."""

    def __init__(self, config: MoveBaseConfig, pose: Pose) -> None:
        self._config = config
        self._begin = pose.yaw
        self._half_done = False

    def rate(self, pose: Pose, costmap: LocalCostmap) -> float | None:
        """Turn rate [rad/s]; None if the turn is complete or an obstacle is in the way."""
        config = self._config
        past = abs(wrap_angle(pose.yaw - self._begin))
        if self._half_done and past <= config.yaw_goal_tolerance:
            return None
        remaining = past if self._half_done else 2.0 * math.pi - past
        self._half_done = self._half_done or math.pi - past < config.yaw_goal_tolerance
        headings = (pose.yaw + k * _STEP for k in range(math.ceil(remaining / _STEP)))
        if any(costmap.outline_cost(pose._replace(yaw=yaw)) < 0 for yaw in headings):
            return None
        fastest = math.sqrt(2.0 * config.acc_lim_theta * remaining)
        return min(max(fastest, config.min_in_place_vel_theta), config.max_vel_theta)
