"""What every reactive planner must do, whatever it computes. make: from a robot to a planner that was reset."""

import numpy as np
import pytest

from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.simulation.fast import FastConfig, FastSimulator
from lme.types import Guidance, Twist
from tests.builders import observation, task
from tests.tolerances import KERNEL


def plan(made, view):
    return made.plan(view, Guidance(view.target))


def assert_mirrored(make, robot, arcs, target, twist):
    """A mirrored scene gives the mirrored command. arcs: (12,) ranges [m], each for a twelfth of the beams."""
    lidar, (x, y), (v, omega) = robot.lidar, target, twist
    ranges = np.repeat(np.array(arcs, dtype=np.float32), -(-lidar.num_beams // 12))[: lidar.num_beams]
    shift = lidar.angle_min + lidar.angle_increment * (lidar.num_beams - 1) / 2

    def view(mirrored):
        side = -1 if mirrored else 1
        seen = observation(
            target=(x, side * y),
            ranges=(ranges[::-1] if mirrored else ranges).copy(),
            twist=Twist(v, side * omega),
            robot=robot,
        )
        return seen._replace(scan=seen.scan._replace(angle_min=lidar.angle_min - shift))

    one, other = plan(make(robot), view(False)), plan(make(robot), view(True))
    assert other.v == pytest.approx(one.v, abs=1e-6)
    assert other.omega == pytest.approx(-one.omega, abs=1e-6)


def assert_finite_within_limits(make, robot, value):
    """A scan with this one range [m], which may be no number, gives a command that the robot can follow from rest."""
    made = make(robot)
    for target in [(0.0, 0.0), (3.0, 1.0), (-2.0, 0.0)]:
        ranges = np.full(robot.lidar.num_beams, value, dtype=np.float32)
        command = plan(made, observation(target=target, ranges=ranges, robot=robot))
        assert np.isfinite(command).all()
        assert abs(command.v) <= robot.alpha_v * robot.dt + KERNEL
        assert abs(command.omega) <= min(robot.omega_max, robot.alpha_omega * robot.dt) + KERNEL


def drive(planner, robot, world=None, time_limit=60.0, **changes):
    made = Navigator(Target(TargetConfig(), robot), planner)
    place = task(world, time_limit=time_limit, **changes)
    return run_episode(place, made, FastSimulator(FastConfig(), robot), np.random.default_rng(0))


def assert_straight_to_rest(episode):
    """The robot drives straight to the goal at (10, 0) m, stays there, and stands."""
    track = episode.trajectory
    assert np.abs(track[:, 2]).max() < 0.5
    there = np.argmax(np.hypot(track[:, 1] - 10.0, track[:, 2]) < 0.2)
    assert there > 0
    assert np.hypot(track[there:, 1] - 10.0, track[there:, 2]).max() < 0.2
    assert abs(track[-1, 4]) < 1e-3
