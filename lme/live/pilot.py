"""Decisions of guide and planner, which are built for the lidar in use, with commands kept within the limits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lme.geometry.frames import relative, to_robot
from lme.geometry.motion import drive
from lme.live.messages import SECOND
from lme.live.poses import Posture, StampedMotion
from lme.live.scan_source import ScanSource
from lme.live.sensors import LiveSight
from lme.live.step import STILL, LiveState, LiveStep
from lme.navigation.navigator import Explanations, Navigator
from lme.perception.scan_points import obstacle_points
from lme.planners.safety.check import StoppingCheck, StoppingState
from lme.robots import Robot, reachable
from lme.types import Floats, Pose, Twist

_STEP = 0.02  # [m] no point of the outline moves further between two poses
_WARM_UPS = 3  # decisions; the first ones load compiled code, which takes seconds
_WARM_UP_PERIOD = SECOND // 2  # [ns] between two of them, after which every part of a tracker has run
_AHEAD = np.array([1.0, 0.0])  # [m] the target of these decisions


def predict(pose: Pose, twist: Twist, command: Twist, time: float, robot: Robot) -> tuple[Pose, Twist]:
    """Pose and twist of the robot after following a command for `time` [s]."""
    poses, moving = drive(
        pose, twist, command, robot.limits.bounds, time, _STEP, robot.footprint.circumscribed_radius
    )
    return Pose(*poses[-1].tolist()), Twist(*moving)


def touches(points: Floats, pose: Pose, twist: Twist, command: Twist, robot: Robot) -> bool:
    """Return whether the robot would touch a point if it followed the command for a control period and then braked.

    points: (M, 2) in the frame in which `pose` is given [m]. twist: present twist of the robot.
    """
    state = StoppingState(to_robot(points, pose), (twist,), robot.limits, ramp_start=command)
    return not StoppingCheck(robot.footprint, robot.dt).stops(command, state)


class Pilot:
    """A navigator for the robot of a scan source. seed: seed of its random numbers. wall: monotonic time [ns]."""

    def __init__(self, source: ScanSource, navigator: Navigator, seed: int, wall: Callable[[], int]) -> None:
        self.source, self.robot = source, source.robot
        self._navigator, self._seed, self._wall = navigator, seed, wall
        self._number = 0  # of the goal that the navigator was reset for
        self._explanations = Explanations(navigator)

    def warm_up(self, scan: Any, posture: Posture | None = None) -> None:
        """Make a few decisions on a scan, and discard them.

        posture: posture of the base at the stamp of a cloud. Each decision has a later stamp than the last, since a
        tracker of people does nothing with a scan that is not newer.
        """
        self._navigator.reset(np.random.default_rng(self._seed))
        for k in range(_WARM_UPS):
            motion = StampedMotion(k * _WARM_UP_PERIOD, Pose(0.0, 0.0, 0.0), STILL)
            step = self.decide(LiveSight(scan, motion, motion, posture), _AHEAD, self._number, STILL, 0)
            self.leads_into_contact(step, STILL)

    def decide(
        self, sight: LiveSight, target: Floats, number: int, last_command: Twist, now_ns: int
    ) -> LiveStep:
        """Decide on a step that drives. Raises whatever guide or planner raise.

        target: (2,) in the robot frame at the stamp of the scan [m]; it is goal `number`. last_command: the one before.
        """
        navigator, robot = self._navigator, self.robot
        if self._number != number:
            navigator.reset(goal_rng(self._seed, number))
            self._number = number
        observation = self.source.observation(sight.scan, sight.motion, target, last_command, sight.posture)
        start_ns = self._wall()
        twist = navigator.act(observation, sight.motion.stamp / SECOND)
        assert navigator.observation is not None
        return LiveStep(
            now_ns,
            LiveState.DRIVING,
            "",
            reachable(*twist, navigator.observation.ramp_start, robot.limits, robot.dt),
            number,
            navigator.observation,
            navigator.guidance,
            self._explanations.new(),
            twist,
            decision_us=(self._wall() - start_ns) / 1000.0,
            motion=sight.newest,
            people=None if navigator.people is None else navigator.people.tracks,
            people_us=0.0 if navigator.people is None else navigator.people.spent_us,
            taken=sight.motion.stamp,
        )

    def leads_into_contact(self, step: LiveStep, last_command: Twist) -> bool:
        """Return whether the robot would touch what it sees if it followed the command of a driving step.

        Since the scan and since its latest pose, it has moved on with the command `last_command`.
        """
        assert step.observation is not None
        assert step.motion is not None
        observation, newest = step.observation, step.motion
        points = obstacle_points(observation.scan, self.robot.lidar.mount)
        age = max(step.stamp - newest.stamp, 0) / SECOND
        # Predict from the latest pose, in the robot frame of the scan, to the time of the tick.
        pose = relative(newest.pose, observation.odometry)
        return any(
            touches(points, *predict(pose, twist, last_command, age, self.robot), step.command, self.robot)
            for twist in observation._replace(twist=newest.twist).twists
        )


def goal_rng(seed: int, number: int) -> np.random.Generator:
    """The random generator of the navigator on the way to goal `number`: as for an episode in world `number`."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, 0])).spawn(2)[0]
