"""The planner E-Band: it follows its band, turns, slows down, remembers, and never rams."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.frames import to_robot, to_world
from lme.geometry.polyline import project, stretch
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.eband.planner import EBand, _thinned
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import observation, room, shipped, stage, task
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)


def planner(robot=None, **settings):
    made = EBand(load_settings("planner/eband", **settings), robot or stage())
    made.reset(np.random.default_rng(0))
    return made


def drive(job, robot, navigator=None):
    navigator = navigator or Navigator(Target(TargetConfig(), robot), planner(robot))
    return run_episode(
        job, navigator, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(0)
    )


def test_eband_first_turns_in_place_when_the_way_leads_back():
    command = planner().plan(observation(target=(-3.0, 1.0)), Guidance(np.array([-3.0, 1.0])))
    assert command.v == 0.0
    assert command.omega > 0.0


def test_small_bubbles_slow_the_robot_down():
    # Walls 0.5 m to either side: a bubble of 0.3 m, 0.6 m/s at most; here the acceleration does not limit it.
    robot = stage(v_max=2.0, alpha_v=50.0, num_beams=2000)
    world = World(segments=np.array([[-20.0, 0.5, 20.0, 0.5], [-20.0, -0.5, 20.0, -0.5]]))
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    view = simulator.reset(task(world, goal=(8.0, 0.0)), np.random.default_rng(0))
    assert planner(robot).plan(view, Guidance(view.target)).v == pytest.approx(0.6, abs=0.01)
    free = planner(robot).plan(observation(target=(8.0, 0.0), robot=robot), Guidance(view.target))
    assert free.v == pytest.approx(0.75, abs=KERNEL)


def test_eband_follows_a_path_through_a_door_that_the_straight_line_misses():
    robot = shipped("jackal")
    wall = World(segments=np.array([[2.0, -4.0, 2.0, 0.6], [2.0, 1.4, 2.0, 4.0]]))
    corners = np.array([[0.0, 0.0], [1.2, 1.0], [2.8, 1.0], [4.0, 0.0]])

    class Doorman:
        def reset(self, rng):
            pass

        def guide(self, observation):
            rest = stretch(corners, project(corners, *observation.odometry[:2])[0], 99.0, 0.05)
            path = to_robot(np.vstack([np.array(observation.odometry[:2]), rest]), observation.odometry)
            return Guidance(path[-1], path)

    done = drive(task(wall), robot, Navigator(Doorman(), planner(robot)))
    assert done.outcome == Outcome.SUCCESS
    assert done.min_clearance > 0.1


def test_eband_remembers_obstacles_that_are_out_of_sight():
    # A pole ahead, then half a turn: behind the robot, in the blind arc.
    robot = shipped("jackal")
    made = planner(robot)
    world = World(circles=np.array([[0.6, 0.0, 0.1]]))
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    for yaw in (0.0, math.pi, math.pi):
        view = simulator.reset(task(world, start=Pose(0.0, 0.0, yaw)), np.random.default_rng(0))
        odometry = Pose(0.0, 0.0, yaw)
        made.plan(view._replace(odometry=odometry), Guidance(view.target))
        nearest = np.hypot(*(made._known - (0.6, 0.0)).T).min()
        assert nearest == pytest.approx(0.1, abs=0.01)
    gone = simulator.reset(task(start=Pose(0.0, 0.0, 0.0)), np.random.default_rng(0))
    made.plan(gone, Guidance(gone.target))
    assert len(made._known) == 0  # seen through: no longer there


def test_the_memory_of_eband_is_bounded():
    # Creeping along a corridor, 4 mm a step, every scan sees other points of what goes out of sight behind.
    robot = shipped("jackal")
    made, simulator = planner(robot), FastSimulator(load_settings("sim/fast"), robot)
    walls = World(segments=np.array([[-9.0, 0.6, 9.0, 0.6], [-9.0, -0.6, 9.0, -0.6]]))
    view = simulator.reset(task(walls, goal=(50.0, 0.0)), np.random.default_rng(0))
    for _ in range(400):
        made.plan(view, Guidance(view.target))
        view = simulator.step(Twist(0.04, 0.0))
    behind = made._known[made._known[:, 0] < simulator.state.pose.x - 0.8]
    assert 0 < len(behind) <= 2 * 2 * 3.3 / 0.05  # two walls, two squares wide, as far as it looks


@given(SEEDS)
def test_thinning_leaves_one_point_per_square_whatever_the_order(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.2, 0.2, (int(rng.integers(0, 60)), 2))
    thin = _thinned(points, 0.05)
    squares = {tuple(square) for square in np.rint(points / 0.05)}
    assert {tuple(square) for square in np.rint(thin / 0.05)} == squares
    assert len(thin) == len(squares)
    np.testing.assert_array_equal(_thinned(rng.permutation(points), 0.05), thin)
    np.testing.assert_array_equal(np.sort(-_thinned(-points, 0.05), axis=0), np.sort(thin, axis=0))


def test_eband_stands_still_at_the_target():
    assert planner().plan(observation(target=(0.0, 0.0)), Guidance(np.zeros(2))) == Twist(0.0, 0.0)


@pytest.mark.parametrize(
    ("start", "side", "least"),
    [
        (Pose(0.0, 0.0, 0.0), 0.84, 0.0),
        (Pose(0.02, 0.01, 0.05), 0.84, 0.0),
        (Pose(0.0, 0.05, 0.0), 1.0, 0.05),
    ],
)
def test_noise_does_not_grind_a_long_robot_into_the_walls(start, side, least):
    # 0.70 m long, 0.77 m corner to corner, 0.02 m of noise, and nowhere to go for a minute.
    robot = shipped("go2")
    done = drive(task(room(side), start=start, goal=(5.0, 0.0), time_limit=60.0), robot)
    assert done.outcome == Outcome.TIMEOUT
    assert done.min_clearance > least


def test_the_band_lives_in_the_odometry_frame():
    # The same scene from another pose of the base: the band stays where it is.
    made = planner()
    goal = np.array([3.0, 1.0])
    made.plan(observation(target=goal), Guidance(goal))
    before = made.band.centres[-1].copy()
    here = Pose(0.1, 0.05, 0.3)
    moved = to_robot(goal, here)
    made.plan(observation(target=moved, odometry=here), Guidance(moved))
    assert made.band.centres[0] == pytest.approx(here[:2], abs=KERNEL)
    assert math.dist(before, made.band.centres[-1]) < 0.2
    assert to_world(moved, here) == pytest.approx(goal, abs=KERNEL)
