"""State machine of ROS move_base around its local planner."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_world, wrap_angle
from lme.geometry.polyline import stretch
from lme.mapping.costmap import LocalCostmap
from lme.planners.commands import limited
from lme.planners.ros_dwa.trajectories import TrajectoriesConfig, TrajectorySearch
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation, Pose, Twist

_STOP = Twist(0.0, 0.0)
_STEP = 0.017  # [rad] between the checks of a turn; rotate_recovery's sim_granularity


@dataclass(slots=True)
class RosDwaConfig(TrajectoriesConfig):
    """Settings of move_base and TrajectoryPlannerROS, with the names and the BARN Challenge's values of ROS."""

    xy_goal_tolerance: float
    yaw_goal_tolerance: float
    planner_patience: float
    controller_patience: float

    def __post_init__(self) -> None:
        TrajectoriesConfig.__post_init__(self)
        for key in ("xy_goal_tolerance", "planner_patience", "controller_patience"):
            require(key, getattr(self, key), at_least=0.0)
        require("yaw_goal_tolerance", self.yaw_goal_tolerance, above=0.0, at_most=1.0)


class _State(Enum):
    PLANNING = auto()  # there is no plan yet, or none that the robot could follow
    CONTROLLING = auto()
    CLEARING = auto()  # a recovery is due or under way
    ABORTED = auto()


class RosDwa:
    """move_base with base_local_planner's TrajectoryPlannerROS, DWA mode (Marder-Eppstein et al. 2010).

    E. Marder-Eppstein et al., "The Office Marathon", ICRA 2010, DOI 10.1109/ROBOT.2010.5509725; the algorithm is
    that of github.com/ros-planning/navigation. Velocities are simulated on a local costmap and scored by distance
    to the path, distance to its end on the map, and the highest cost on the way. Without a plan for
    `planner_patience`, or without a velocity for `controller_patience`, recoveries follow: two turns on the spot,
    each after a reset of the costmaps. Then the robot gives up. BARN's resets name no layer of BARN's costmaps and
    clear nothing, so a reset is only another wait here. A blocked guide has no plan.
    """

    Config = RosDwaConfig

    def __init__(self, config: RosDwaConfig, robot: Robot) -> None:
        self._config = config
        self._dt = robot.dt
        self._costmap = LocalCostmap(config.costmap, robot)
        self._search = TrajectorySearch(config, robot, self._costmap)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget map, plan and recoveries."""
        self._costmap.reset(rng)
        self._search.reset()
        self._state = _State.PLANNING
        self._path: Floats | None = None  # (K, 2) in the odometry frame [m]
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
            return self._control(observation, guidance)
        if self._state is _State.CLEARING:
            self._recover(observation.odometry)
        return None

    def _take_plan(self, observation: Observation, guidance: Guidance) -> None:
        """Take a new plan; without one, keep the old plan while the robot can follow it, but not forever."""
        if self._state is _State.ABORTED:
            return
        if not guidance.blocked:
            path = guidance.path if guidance.path is not None else np.vstack([np.zeros(2), guidance.subgoal])
            # Points at most a cell apart; the ends stay.
            ahead = stretch(path, 0.0, math.inf, self._config.costmap.cell_size)
            self._path = to_world(np.vstack([path[:1], ahead]), observation.odometry)
            self._planned, self._state = self._time, _State.CONTROLLING
            if self._no_plan:
                self._recovery = 0
        elif self._state is _State.PLANNING and self._time - self._planned > self._config.planner_patience:
            self._state, self._no_plan = _State.CLEARING, True

    def _control(self, observation: Observation, guidance: Guidance) -> Twist | None:
        """Follow the plan."""
        assert self._path is not None
        if math.dist(self._path[-1], observation.odometry[:2]) <= self._config.xy_goal_tolerance:
            self._controlled = self._time
            return None
        command = self._search.command(observation, self._path)
        if command is not None:
            self._controlled = self._time
            if not self._no_plan:
                self._recovery = 0
        elif self._time - self._controlled > self._config.controller_patience:
            self._state, self._no_plan = _State.CLEARING, False
        else:
            self._planned, self._state = self._time, _State.PLANNING
        return command

    def _recover(self, pose: Pose) -> None:
        """Begin the next recovery; after the last one give up."""
        self._recovery += 1
        self._planned, self._state = self._time, _State.PLANNING
        if self._recovery in (2, 4):
            self._turn = _Turn(self._config, pose)
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

    def __init__(self, config: RosDwaConfig, pose: Pose) -> None:
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
