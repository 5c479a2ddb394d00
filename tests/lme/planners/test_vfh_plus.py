"""VFH+: what it does in scenes worked out by hand, and where it is known to fail."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.vfh_plus import VfhPlus
from lme.types import Outcome, Twist
from lme.worlds.world import World
from tests.builders import observation, stage
from tests.lme.planners import drives
from tests.lme.planners.drives import plan

ALPHA = math.radians(5.0)


def wrapped(angle):
    return math.remainder(angle, math.tau)


def planner(robot=None, **settings):
    made = VfhPlus(load_settings("planner/vfh_plus", **settings), robot or stage())
    made.reset(np.random.default_rng(0))
    return made


def ranges_of(robot, shape):
    """Ranges where `shape` gives one for a bearing."""
    lidar = robot.lidar
    bearings = lidar.angle_min + lidar.angle_increment * np.arange(lidar.num_beams)
    return np.array([min(shape(b), lidar.range_max) for b in bearings], dtype=np.float32)


def wall_with_gap(bearing, half_width=0.6, distance=0.9):
    """A ring around the robot, open towards `bearing`."""
    return lambda b: math.inf if abs(wrapped(b - bearing)) < half_width else distance


@pytest.mark.parametrize("bearing", [1.2, -1.2, 2.5])
def test_vfh_plus_turns_towards_the_only_gap(bearing):
    robot = stage()
    view = observation(ranges=ranges_of(robot, wall_with_gap(bearing)), robot=robot)
    made = planner()
    command = plan(made, view)
    assert command.v == 0.0
    assert math.copysign(1.0, command.omega) == math.copysign(1.0, bearing)
    assert made._previous * ALPHA == pytest.approx(
        bearing % math.tau, abs=ALPHA
    ) or made._previous * ALPHA == (pytest.approx(bearing, abs=ALPHA))


def test_a_sector_between_the_thresholds_keeps_its_state():
    robot = stage()
    made, fresh = (planner(density_low=1.0, density_high=30.0) for _ in range(2))
    dense = observation(ranges=ranges_of(robot, lambda b: 0.5 if abs(b) < 0.5 else math.inf), robot=robot)
    thin = observation(ranges=ranges_of(robot, lambda b: 1.5 if abs(b) < 0.1 else math.inf), robot=robot)
    free = observation(robot=robot)
    for view in (dense, thin):
        held = plan(made, view)
    assert plan(fresh, thin) == plan(planner(), free) != held
    plan(made, free)
    assert plan(made, thin) == plan(fresh, thin)


def test_obstacles_behind_the_subgoal_block_nothing():
    robot = stage()
    ranges = ranges_of(robot, lambda b: 1.2 / math.cos(b) if abs(b) < 1.2 else math.inf)
    near = plan(planner(), observation(target=(0.7, 0.0), ranges=ranges, robot=robot))
    far = plan(planner(), observation(target=(4.0, 0.0), ranges=ranges, robot=robot))
    assert near.v > 0.0
    assert near.omega == 0.0
    assert far.omega != 0.0


def test_vfh_plus_stands_still_when_boxed_in():
    robot = stage()
    view = observation(ranges=ranges_of(robot, lambda b: 0.4), robot=robot)
    assert plan(planner(), view) == (0.0, 0.0)


def test_denser_ahead_is_slower():
    robot = stage()

    def speed(distance):
        post = ranges_of(robot, lambda b: distance if abs(b) < 0.3 else math.inf)
        view = observation(target=(1.6, 0.0), ranges=post, robot=robot, twist=Twist(0.2, 0.0))
        return plan(planner(density_high=1000.0), view).v

    assert speed(0.8) < speed(1.2) < speed(3.0)


def drive(robot, world=None, **changes):
    return drives.drive(VfhPlus(load_settings("planner/vfh_plus"), robot), robot, world, **changes)


def box(half_x, half_y):
    corners = np.array([[-half_x, -half_y], [half_x, -half_y], [half_x, half_y], [-half_x, half_y]])
    return World(segments=np.hstack([corners, np.roll(corners, -1, axis=0)]))


def test_vfh_plus_goes_round_a_post():
    posts = World(circles=np.array([[2.0, 0.05, 0.3]]))
    assert drive(stage(), posts).outcome == Outcome.SUCCESS


def test_vfh_plus_does_not_get_out_of_a_u():
    # The method's known limit: a pocket 2 m deep and wide, open towards the start, deeper than the window.
    u = World(segments=np.array([[3.0, -1.0, 3.0, 1.0], [1.0, 1.0, 3.0, 1.0], [1.0, -1.0, 3.0, -1.0]]))
    episode = drive(stage(), u, goal=(6.0, 0.0), time_limit=90.0)
    assert episode.outcome == Outcome.TIMEOUT
