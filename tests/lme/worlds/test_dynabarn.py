"""DynaBARN's setting with our own motion: what is published stands, and cylinders move as described."""

import functools
import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.navigation.episode import run_episode
from lme.simulation.crowd import Crowd
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Pose
from lme.worlds.check import check_task, point_clearance
from lme.worlds.dynabarn import DIFFICULTIES, RADIUS, Dynabarn, crossing
from tests.builders import SHIPPED, navigator, shipped
from tests.tolerances import KERNEL

FAR = Pose(1000.0, 0.0, 0.0)  # of a robot that nobody heeds
TIGHTEST_M = 1.2  # radius of a turn, the ends of a crossing apart


def tasks(difficulty="medium", worlds=None, **keys):
    chosen = Dynabarn(load_settings("map/dynabarn", difficulty=difficulty, worlds=worlds, **keys))
    return [chosen.task(number) for number in chosen.numbers]


all_tasks = functools.cache(tasks)


def turns(legs):
    """Angles between one leg (L, 2) and the next [rad]."""
    heading = np.arctan2(legs[:, 1], legs[:, 0])
    return np.abs((np.diff(heading) + math.pi) % (2 * math.pi) - math.pi)


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_start_goal_and_clock_are_the_published_ones(difficulty):
    found = all_tasks(difficulty)
    assert [task.number for task in found] == list(range(60))
    for task in found:
        assert task.start == (11.0, 0.0, math.pi)
        assert math.dist(task.start[:2], task.goal) == task.shortest_path_length == 20.0
        assert task.goal.tolist() == [-9.0, 0.0]  # straight ahead
        assert (task.time_limit, task.goal_tolerance) == (100.0, 1.0)
        assert task.optimal_time == 10.0
        assert task.map_name == f"dynabarn_{difficulty}"


def test_three_walls_and_an_open_side():
    world = tasks(worlds=[0])[0].world
    sizes = sorted(np.ptp(polygon, axis=0).tolist() for polygon in world.polygons)
    middles = sorted(polygon.mean(axis=0).tolist() for polygon in world.polygons)
    assert sizes == [[0.5, 20.0], [20.0, 0.5], [20.0, 0.5]]
    assert middles == [[-10.0, 0.0], [0.0, -10.0], [0.0, 10.0]]
    assert point_clearance(world, np.array([10.0, 0.0])) == 9.75


def test_five_to_twenty_four_cylinders_more_and_faster_with_difficulty():
    counts = {kind: [len(task.world.movers) for task in all_tasks(kind)] for kind in DIFFICULTIES}
    assert (min(counts["easy"]), max(counts["hard"])) == (5, 24)
    assert max(counts["easy"]) < min(counts["medium"]) <= max(counts["medium"]) < min(counts["hard"])
    speeds = [np.mean([task.measures["mean_speed_mps"] for task in all_tasks(kind)]) for kind in DIFFICULTIES]
    assert speeds == sorted(speeds)
    for task in tasks("hard", worlds=[7]):
        assert task.measures["cylinders"] == len(task.world.movers)
        assert {mover.radius for mover in task.world.movers} == {0.5}


@pytest.mark.parametrize("difficulty", DIFFICULTIES)
def test_cylinders_stay_inside_and_never_touch_a_wall(difficulty):
    for task in all_tasks(difficulty):
        for mover in task.world.movers:
            assert np.abs(mover.path[:, :2]).max() <= 9.75 - RADIUS + KERNEL


@pytest.mark.parametrize("bends", [1, 2, 4])
def test_a_crossing_leads_smoothly_from_border_to_border(bends):
    rng = np.random.default_rng(bends)
    for _ in range(50):
        curve = crossing(rng, bends)
        assert np.abs(curve[[0, -1]]).max(axis=1) == pytest.approx([9.25, 9.25])
        assert math.dist(curve[0], curve[-1]) >= 10.0
        legs = np.diff(curve, axis=0)
        lengths = np.hypot(*legs.T)
        assert lengths.max() <= 0.1 + KERNEL
        assert turns(legs).max() <= lengths.max() / TIGHTEST_M


def test_a_path_is_the_same_way_there_and_back():
    for mover in tasks("hard", worlds=[0])[0].world.movers:
        path = mover.path[:, :2]
        ends = np.flatnonzero(turns(np.vstack([path, path[:2]])[1:] - np.vstack([path, path[:1]])) > 3.0)
        assert len(ends) == 2  # turns back twice
        there = np.roll(path, -(ends[0] + 1), axis=0)
        np.testing.assert_array_equal(there[1:], there[:0:-1])


def test_cylinders_move_at_their_speed_and_come_round():
    task = tasks("medium", worlds=[5])[0]
    crowd, dt = Crowd(task.world.movers), 0.05
    before = crowd.circles.copy()
    crowd.advance(FAR, dt)
    moved = np.hypot(*(crowd.circles - before)[:, :2].T)
    speeds = np.array([mover.speed for mover in task.world.movers])
    assert (moved <= speeds * dt + KERNEL).all()
    assert np.median(moved / (speeds * dt)) > 0.99  # less only where one turns back
    mover = task.world.movers[0]
    ring = np.vstack([mover.path, mover.path[:1]])
    period = np.hypot(*np.diff(ring[:, :2], axis=0).T).sum() / mover.speed
    crowd.advance(FAR, period - dt)
    assert crowd.circles[0] == pytest.approx(before[0], abs=1e-6)


@pytest.mark.parametrize("robot", SHIPPED)
def test_every_robot_can_begin(robot):
    machine = shipped(robot)
    check_task(all_tasks("hard")[0], machine)  # walls and start are the same in all
    for task in all_tasks("hard"):
        for mover in task.world.movers:
            assert (
                math.dist(mover.path[0, :2], task.start[:2]) > RADIUS + machine.footprint.circumscribed_radius
            )


def test_a_number_means_the_same_whatever_else_is_chosen():
    def paths(difficulty="medium", **keys):
        return [mover.path for mover in tasks(difficulty, **keys)[-1].world.movers]

    for one, two in zip(paths(worlds=[800, 3]), paths(worlds=[3]), strict=True):
        np.testing.assert_array_equal(one, two)
    assert paths(worlds=[3])[0].tolist() != paths(worlds=[4])[0].tolist()
    assert paths(worlds=[3])[0].tolist() != paths(worlds=[3], motion_seed=1)[0].tolist()


def test_the_simulated_robot_meets_the_cylinders():
    """Heading straight for the goal, it is hit in some hard world, and there by a cylinder."""
    robot = shipped("jackal")
    simulator, driver = FastSimulator(load_settings("sim/fast"), robot), navigator(robot, "target")
    hit = []
    for task in tasks("hard", worlds=list(range(12))):
        episode = run_episode(task, driver, simulator, np.random.default_rng(task.number))
        assert episode.outcome in (Outcome.SUCCESS, Outcome.COLLISION)
        if episode.outcome is Outcome.COLLISION:
            hit.append(point_clearance(task.world, simulator.state.pose[:2]))
    assert len(hit) >= 3
    assert min(hit) > robot.footprint.circumscribed_radius  # no wall is near


@pytest.mark.parametrize(
    "keys",
    [
        {"difficulty": "extreme"},
        {"worlds": []},
        {"motion_seed": -1},
        {"speed": 0.0},
        {"time_limit": math.nan},
    ],
    ids=str,
)
def test_a_mistake_is_one_line(keys, says):
    with says.raises(InputError):
        load_settings("map/dynabarn", **keys)
