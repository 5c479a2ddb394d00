"""Dynamic Window Approach: it takes the best velocity in reach, and never one from which it cannot stop."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.dwa import Dwa
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.barn.map_set import Barn
from lme.worlds.world import World
from tests.builders import SHIPPED, observation, room, shipped, stage, task

EAGER = {"clearance": 1.0, "velocity": 1.0}  # gains that make it drive where the textbook's stand still


def plan(target=(4.0, 0.0), ranges=None, twist=Twist(0.0, 0.0), robot=None, **config):  # noqa: B008
    robot = robot or stage()
    view = observation(target, ranges, twist, robot)
    return Dwa(load_settings("planner/dwa", **config), robot).plan(view, Guidance(view.target))


def drive(world, robot=None, goal=(4.0, 0.0), time_limit=20.0, start=Pose(0.0, 0.0, 0.0), **config):  # noqa: B008
    robot = robot or stage()
    return run(task(world, goal=goal, time_limit=time_limit, start=start), robot, **config)


def run(job, robot, **config):
    navigator = Navigator(Target(TargetConfig(), robot), Dwa(load_settings("planner/dwa", **config), robot))
    return run_episode(
        job, navigator, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(0)
    )


@pytest.mark.parametrize("name", SHIPPED)
def test_dwa_brakes_before_a_wall_at_full_speed(name):
    # From 5 m and at rest, towards a target behind it; noise and blind arcs included.
    wall = World(segments=np.array([[5.0, -30.0, 5.0, 30.0]]))
    episode = drive(wall, shipped(name), goal=(9.0, 0.0), time_limit=20.0, velocity=10.0, clearance=0.0)
    assert episode.outcome is Outcome.TIMEOUT
    assert episode.trajectory[:, 4].max() == pytest.approx(shipped(name).v_max, abs=1e-6)
    assert episode.min_clearance < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_a_disc_that_sees_all_round_touches_nothing(seed):
    rng = np.random.default_rng(seed)
    at = rng.uniform(-4, 4, (25, 2))
    circles = np.column_stack((at, rng.uniform(0.05, 0.3, 25)))[np.hypot(*at.T) > 0.7]
    world = World(circles=circles, segments=room(9.0).segments)
    episode = drive(world, goal=tuple(rng.uniform(-4, 4, 2)), time_limit=30.0, **EAGER)
    assert episode.outcome is not Outcome.COLLISION


@pytest.mark.parametrize("gap", [0.45, 0.6])
@pytest.mark.parametrize(("config", "aside"), [({}, 0.1), (EAGER, 0.3)])
def test_jackal_passes_a_gap_little_wider_than_itself(gap, config, aside):
    posts = np.array([[2.0, side * (gap / 2 + 0.075), 0.075] for side in (-1, 1)])
    episode = drive(World(circles=posts), shipped("jackal"), start=Pose(0.0, aside, 0.0), **config)
    assert episode.outcome is Outcome.SUCCESS


def test_a_gap_narrower_than_itself_is_not_tried():
    posts = np.array([[2.0, y, 0.075] for y in np.arange(-33.0, 33.1, 0.44)])  # gaps of .29 m; jackal: .31 m
    episode = drive(World(circles=posts), shipped("jackal"), time_limit=10.0, **EAGER)
    assert episode.outcome is Outcome.TIMEOUT


def test_a_faster_robot_keeps_further_from_walls():
    # 10 cm to each side of a rectangle .31 wide: full speed takes 0.02 + 2 · 0.05 = 12 cm.
    walls = World(segments=np.array([[1.0, y, 9.0, y] for y in (-0.255, 0.255)]))
    careful = drive(walls, shipped("jackal"), goal=(6.0, 0.0))
    bold = drive(walls, shipped("jackal"), goal=(6.0, 0.0), margin_time=0.0)
    assert careful.outcome is bold.outcome is Outcome.SUCCESS
    inside = careful.trajectory[(careful.trajectory[:, 1] > 1.5) & (careful.trajectory[:, 1] < 5.0)]
    assert inside[:, 4].max() < 2.0 == pytest.approx(bold.trajectory[:, 4].max())


@pytest.mark.parametrize(
    ("robot", "config"), [(stage(), {}), (shipped("jackal"), EAGER)], ids=["stage", "jackal"]
)
def test_a_dead_end_holds_it(robot, config):
    # 2 × 2 m, open to the start, the target behind its bottom: a local minimum of the objective.
    dead_end = World(segments=np.array([[1, -1, 3, -1], [3, -1, 3, 1], [3, 1, 1, 1]], dtype=float))
    assert drive(dead_end, robot, goal=(6.0, 0.0), time_limit=40.0, **config).outcome is Outcome.TIMEOUT


def test_dwa_turns_away_from_the_nearest_obstacle_where_no_arc_is_free():
    # A half ring 1 cm before a disc: no way ahead. The nearer part is on its right, so it turns left; and drives on.
    robot = stage()
    ranges = np.full(540, 0.215, np.float32)
    ranges[: 540 // 2] = 0.212  # bearings below 0 are on the right
    assert plan((4.0, 0.0), ranges, robot=robot).omega > 0.0
    assert plan((4.0, 0.0), ranges[::-1].copy(), robot=robot).omega < 0.0
    assert plan((4.0, 0.0), ranges, Twist(0.0, -0.3), robot).omega < -0.3
    assert plan((4.0, 0.0), ranges, robot=robot).v == 0.0


def test_dwa_stands_still_when_its_corners_are_hemmed_in():
    robot = shipped("jackal")
    ranges = np.full(720, 0.16, np.float32)  # within the corners' 0.26 m wherever it turns, outside its sides
    command = plan((4.0, 0.0), ranges, robot=robot)
    assert command == (0.0, 0.0)


def test_ranges_inside_the_footprint_stop_it():
    assert plan(ranges=np.full(540, 0.1, np.float32), twist=Twist(0.3, 0.0)) == (0.0, 0.0)


def test_the_subgoal_is_followed_not_the_target():
    robot = stage()
    view = observation((4.0, 0.0), robot=robot)
    planner = Dwa(load_settings("planner/dwa"), robot)
    assert planner.plan(view, Guidance(np.array([0.0, 2.0]))).omega > 0.0
    assert planner.plan(view, Guidance(np.array([0.0, -2.0]))).omega < 0.0


def test_heading_looks_as_far_ahead_as_configured():
    # A target 0.5 rad to the left: after one period at most a full turn rate is right, after a second half of it.
    robot = shipped("jackal")
    target = (4.0 * math.cos(0.5), 4.0 * math.sin(0.5))
    soon = plan(target, robot=robot, velocity=0.0, clearance=0.0)
    late = plan(target, robot=robot, velocity=0.0, clearance=0.0, heading_time=1.0)
    assert soon.omega > 2.0 > 0.6 > late.omega > 0.2


@pytest.mark.parametrize("number", [1000, 1002])
def test_dwa_drives_through_a_barn_world(number):
    robot = shipped("jackal")
    job = Barn(load_settings("map/barn", subset="fresh", count=10)).task(number)
    assert run(job, robot, **EAGER).outcome is Outcome.SUCCESS


def test_a_robot_that_settles_late_slows_down_earlier():
    """Before a wall 0.8 m ahead: 0.5 s more to stop are 0.25 m more at 0.5 m/s."""
    wall = np.repeat(np.array([0.8], dtype=np.float32), 540)
    robots = [stage(), stage(settling_time=0.5), stage(settling_time=1.5)]
    seen = [observation(ranges=wall, twist=Twist(0.5, 0.0), robot=robot) for robot in robots]
    fastest = [
        max(v for v, cost in zip(weighed.commands[:, 0], weighed.costs, strict=True) if np.isfinite(cost))
        for weighed in (
            Dwa(load_settings("planner/dwa"), robot).weighed(each, Guidance(each.target))
            for robot, each in zip(robots, seen, strict=True)
        )
    ]
    assert fastest == sorted(fastest, reverse=True)
    assert fastest[0] > fastest[-1]
