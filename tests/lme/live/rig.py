"""A live driver with its clock, a robot that stands at the origin, and a guide and planner that obey."""

import math

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.live.config import LiveConfig
from lme.live.driver import LiveDriver
from lme.live.step import LiveState
from lme.navigation.navigator import Navigator
from lme.types import Guidance, Pose, Twist
from tests import builders
from tests.live_loop import BEGAN
from tests.made_bags import SECOND, BagMaker

CRUISE = Twist(0.3, 0.1)
PERIOD = SECOND // 5
FAR = (10.0, 0.0)


class Puppet:
    """Guide and planner in one. Its command is given; it notes what it sees and how often it is reset."""

    def __init__(self):
        self.command, self.seen, self.resets = CRUISE, [], 0

    def reset(self, rng):
        self.resets += 1

    def guide(self, observation):
        return Guidance(observation.target)

    def plan(self, observation, guidance):
        self.seen.append(observation)
        if isinstance(self.command, Exception):
            raise self.command
        return self.command() if callable(self.command) else self.command


class Rig:
    """A driver, the clock, and a robot that stands at the origin of odom with walls 3 m away."""

    def __init__(self, frames=None, robot=None, scan=None, measured_twists=True, navigator=None, **config):
        self.puppet, self.make = Puppet(), BagMaker()
        self.now, self.wall = BEGAN, 0
        self.robot = robot or builders.stage()
        self.driver = LiveDriver(
            navigator or (lambda robot: Navigator(self.puppet, self.puppet)),
            self.robot,
            LiveConfig(**config),
            scan,
            frames=frames,
            wall=lambda: self.wall,
            measured_twists=measured_twists,
        )

    def scan(self, stamp=None, ranges=None):
        ranges = np.full(540, 3.0) if ranges is None else ranges
        stamp = self.now if stamp is None else stamp
        increment = 2 * math.pi / max(len(ranges), 1)
        self.driver.take_scan(self.make.scan(stamp, ranges, -math.pi, increment, (0.02, 15.0)), self.now)

    def odometry(self, stamp=None, pose=Pose(0.0, 0.0, 0.0), v=0.0, omega=0.0):  # noqa: B008 - immutable
        stamp = self.now if stamp is None else stamp
        self.driver.take_odometry(self.make.odometry(stamp, pose, v, omega), self.now)

    def transform(self, frame, child, pose=Pose(0.0, 0.0, 0.0), static=False):  # noqa: B008 - immutable
        self.driver.take_transforms(
            self.make.transform(self.now, frame, child, pose), self.now, static=static
        )

    def pass_time(self, seconds=0.2):
        self.now += round(seconds * SECOND)
        self.wall += round(seconds * SECOND)

    def tick(self):
        return self.driver.tick(self.now)

    def sense(self):
        self.odometry()
        self.scan()

    def period(self):
        """One control period with fresh data."""
        self.pass_time()
        self.sense()
        return self.tick()

    def drive(self):
        """Set off."""
        self.sense()
        self.tick()  # prepares
        self.driver.set_goal(FAR, "odom", self.now)
        return self.period()


def stands(step, reason, state=LiveState.STOPPED):
    assert step.command == Twist(0.0, 0.0)
    assert reason in step.reason, step.reason
    assert step.state is state
    return True


def drives(step):
    assert step.state is LiveState.DRIVING, step.reason
    assert step.reason == ""
    assert step.command.v > 0.0
    return True
