"""ROS's local planner: its map follows the robot, its rules hold, it recovers as move_base does, and it drives."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.frames import to_robot
from lme.grids.obstacle_grid import INSCRIBED, TOUCHING
from lme.mapping.costmap import LocalCostmap
from lme.planners.ros_dwa.planner import RosDwa
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import shipped, task
from tests.lme.planners.drives import drive, plan
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
JACKAL = shipped("jackal")
JACKAL.control_rate = 20.0
LOST = Guidance(np.zeros(2), blocked=True)


def planner(robot=JACKAL, **changes):
    made = RosDwa(load_settings("planner/ros_dwa", **changes), robot)
    made.reset(np.random.default_rng(0))
    return made


def seen(world=None, pose=Pose(0.0, 0.0, 0.0), twist=Twist(0.0, 0.0), target=(4.0, 0.0), robot=JACKAL):  # noqa: B008
    """What the robot sees at a pose, which is also that of its odometry."""
    view = FastSimulator(load_settings("sim/fast"), robot).reset(
        task(world, start=pose), np.random.default_rng(0)
    )
    return view._replace(odometry=pose, twist=twist, target=to_robot(np.array(target), pose))


def occupied(costmap):
    """Centres (K, 2) of the occupied cells in the odometry frame [m]."""
    return (np.argwhere(costmap.costs == TOUCHING) + np.array(costmap.grid[:2])) * costmap.grid[2]


POST = World(circles=np.array([[1.2, 0.3, 0.1]]))


def test_the_map_moves_with_the_robot_and_forgets_what_leaves_it():
    costmap = LocalCostmap(load_settings("planner/ros_dwa").costmap, JACKAL)
    costmap.update(seen(POST))
    first = occupied(costmap)
    assert len(first) > 0
    assert np.hypot(first[:, 0] - 1.2, first[:, 1] - 0.3).max() < 0.15
    nothing = seen()
    nothing.scan.ranges[:] = np.nan  # tells nothing, not even that a cell is free
    costmap.update(nothing._replace(odometry=Pose(-3.0, 1.0, 2.0)))
    np.testing.assert_array_equal(occupied(costmap), first)
    costmap.update(nothing._replace(odometry=Pose(-4.5, 1.0, 2.0)))
    assert len(occupied(costmap)) == 0
    costmap.update(nothing)
    assert len(occupied(costmap)) == 0


def test_a_cell_is_free_as_soon_as_a_beam_passes_it_or_the_robot_stands_on_it():
    wall = World(segments=np.array([[2.0, -2.0, 2.0, 2.0]]))
    costmap = LocalCostmap(load_settings("planner/ros_dwa").costmap, JACKAL)
    costmap.update(seen(World(circles=POST.circles, segments=wall.segments)))
    costmap.update(seen(wall))
    assert (occupied(costmap)[:, 0] > 1.9).all()
    costmap.update(seen(POST))
    assert (occupied(costmap)[:, 0] < 1.4).any()
    nothing = seen()
    nothing.scan.ranges[:] = np.nan
    costmap.update(nothing._replace(odometry=Pose(1.0, 0.3, 0.0)))
    assert not (np.abs(occupied(costmap) - [1.2, 0.3]) < 0.15).all(axis=1).any()


def test_a_map_on_its_own_clock_keeps_what_the_robot_has_driven_over_since():
    """At 2 m/s the front of the padded outline, 0.31 m ahead, is 0.1 m farther after a step of 0.05 s.

    The post's near side is at x = 0.35. A map that is rebuilt halfway is cleared up to x = 0.36 or less, so the post's
    rest stays under the outline of the pose that is planned from; one that is rebuilt there is cleared up to 0.41.
    """
    post, there = World(circles=np.array([[0.4, 0.0, 0.05]])), Pose(0.1, 0.0, 0.0)
    seed = next(k for k in range(100) if 0.2 < np.random.default_rng(k).spawn(1)[0].uniform() < 0.5)
    costs = []
    for config in (
        load_settings("planner/ros_dwa", costmap={"update_rate": 20.0}).costmap,
        load_settings("planner/ros_dwa").costmap,
    ):
        costmap = LocalCostmap(config, JACKAL)
        costmap.reset(np.random.default_rng(seed))
        costmap.update(seen(post))
        costmap.update(seen(post, pose=there)._replace(scan_pose=there))
        costs.append(costmap.outline_cost(there))
    assert costs[0] == -1
    assert costs[1] >= 0


def test_costs_forbid_the_centre_within_the_inscribed_radius():
    costmap = LocalCostmap(load_settings("planner/ros_dwa").costmap, JACKAL)
    costmap.update(seen(POST))
    away = np.hypot(*(occupied(costmap)[0] - np.array([0.05 * 30, 0.0])))
    assert away > 0.255
    cells = np.argwhere(costmap.costs >= INSCRIBED)
    near = (cells + np.array(costmap.grid[:2])) * 0.05
    distance = np.hypot(*(near[:, None] - occupied(costmap)[None]).transpose(2, 0, 1)).min(axis=1)
    assert distance.max() <= 0.155 + 0.1 + KERNEL


def test_an_empty_world_is_crossed_straight():
    episode = drive(planner(), JACKAL, goal=(10.0, 0.0), goal_tolerance=0.0, time_limit=30.0)
    track = episode.trajectory
    assert np.abs(track[:, 2]).max() < 0.2
    assert np.hypot(track[-1, 1] - 10.0, track[-1, 2]) <= 0.25
    assert abs(track[-1, 4]) < 1e-3


def test_ros_dwa_never_drives_faster_than_configured():
    episode = drive(planner(max_vel_x=0.3), JACKAL, goal=(3.0, 0.0), goal_tolerance=0.3, time_limit=15.0)
    assert episode.outcome is Outcome.SUCCESS
    assert episode.trajectory[:, 4].max() <= 0.3 + KERNEL


@settings(max_examples=10)
@given(SEEDS)
def test_ros_dwa_drives_around_posts_on_a_free_path(seed):
    rng = np.random.default_rng(seed)
    world = World(
        circles=np.array([[rng.uniform(1.5, 3.0), rng.choice([-1, 1]) * rng.uniform(0.7, 1.0), 0.1]])
    )
    episode = drive(planner(), JACKAL, world, goal=(5.0, 0.0), goal_tolerance=0.3, time_limit=40.0)
    assert episode.outcome is Outcome.SUCCESS


def test_a_robot_that_cannot_turn_or_drive_ahead_backs_up_and_then_not_ahead_at_once():
    around = np.column_stack(
        [0.45 * np.cos(np.linspace(-2.0, 2.0, 30)), 0.45 * np.sin(np.linspace(-2.0, 2.0, 30))]
    )
    made = planner()
    view = seen(World(circles=np.column_stack([around, np.full(30, 0.02)])))
    assert plan(made, view).v < 0.0
    after = seen(pose=Pose(-0.04, 0.0, 0.0))
    assert plan(made, after).v <= 0.0
    far = seen(pose=Pose(-0.2, 0.0, 0.0))
    plan(made, far)
    assert plan(made, far).v > 0.0


def test_two_turns_on_the_spot_to_one_side_forbid_the_other_until_the_robot_drives():
    made = planner()
    for _ in range(3):
        assert plan(made, seen(target=(-1.0, 2.0))).omega > 0.0
    assert plan(made, seen(target=(-1.0, -2.0))).omega >= 0.0
    assert plan(made, seen(pose=Pose(0.1, 0.0, 0.0))).v > 0.0
    assert plan(made, seen(pose=Pose(0.1, 0.0, 0.0), target=(-1.0, -2.0))).omega < 0.0


def recoveries(made, seconds):
    """Turn rates of a robot on the spot, whose guide finds no plan: one a period."""
    yaw, omegas = 0.0, []
    for _ in range(round(seconds * JACKAL.control_rate)):
        omegas.append(made.plan(seen(pose=Pose(0.0, 0.0, yaw)), LOST).omega)
        yaw = math.remainder(yaw + omegas[-1] * JACKAL.dt, math.tau)
    return np.array(omegas)


def test_without_a_plan_ros_dwa_waits_turns_around_twice_and_gives_up():
    made = planner()
    omegas = recoveries(made, 40.0)
    turning = omegas > 0.0
    starts = np.flatnonzero(np.diff(turning.astype(int)) == 1) * JACKAL.dt
    assert len(starts) == 2
    assert starts[0] == pytest.approx(10.0, abs=0.3)  # two waits of planner_patience
    for k in range(2):
        turned = omegas[round(starts[k] * 20) : round((starts[k] + 6.0) * 20)].sum() * JACKAL.dt
        assert turned == pytest.approx(math.tau, abs=0.2)
    assert not turning[round((starts[1] + 6.0) * 20) :].any()
    assert made.plan(seen(), Guidance(np.array([4.0, 0.0]))) == (0.0, 0.0)


def test_a_plan_ends_the_wait_and_an_old_plan_serves_while_there_is_no_new_one():
    made = planner()
    assert not recoveries(made, 7.0).any()
    assert plan(made, seen()).v > 0.0
    assert made.plan(seen(), LOST).v > 0.0


def test_a_recovery_turn_touches_nothing():
    made = planner()
    beside = World(circles=np.array([[0.0, 0.38, 0.03]]))
    for _ in range(round(12.0 * JACKAL.control_rate)):
        assert made.plan(seen(beside), LOST).omega == 0.0


def test_a_path_is_followed_rather_than_the_subgoal():
    corner = np.array([[0.0, 0.0], [0.0, 2.0], [4.0, 2.0]])
    command = [planner().plan(seen(), Guidance(np.array([4.0, 0.0]), path)) for path in (None, corner)]
    assert command[0].omega == 0.0
    assert command[1].omega > 0.0
