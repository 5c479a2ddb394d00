"""Potential field: the force against a slow twin, what it does by hand, and where it is known to fail."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.apf import Apf, repulsion
from lme.types import Outcome, Pose
from lme.worlds.world import World
from tests.builders import observation, shipped, stage
from tests.lme.planners import drives
from tests.lme.planners.drives import plan
from tests.tolerances import KERNEL

R, REACH, CLOSEST, SPREAD = 0.2, 0.5, 0.01, 0.35
POINTS = st.lists(st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)), max_size=30).map(
    lambda pairs: np.array(pairs, dtype=float).reshape(-1, 2)
)


def slow_repulsion(points):
    """Every pair looked at."""
    found = []
    for x, y in points:
        clearance = max(math.hypot(x, y) - R, CLOSEST)
        if clearance < REACH:
            push = (1 / clearance - 1 / REACH) / clearance**2
            found.append(
                (math.atan2(y, x), push, x / max(math.hypot(x, y), 1e-12), y / max(math.hypot(x, y), 1e-12))
            )
    force = np.zeros(2)
    for bearing, push, x, y in found:
        crowd = 0.0
        for other, strength, *_ in found:
            apart = abs(math.remainder(other - bearing, math.tau))
            crowd += max(1 - apart / SPREAD, 0.0) * min(1.0, strength / push)
        force -= push / crowd * np.array([x, y])
    return force


def force_of(points):
    return np.array(repulsion(np.array(points, dtype=float).reshape(-1, 2), R, REACH, CLOSEST, SPREAD))


@settings(max_examples=200)
@given(POINTS)
def test_repulsion_is_that_of_every_pair(points):
    slow = slow_repulsion(points)
    assert force_of(points) == pytest.approx(slow, abs=1e-9 * (1 + np.abs(slow).max()), rel=1e-7)


def test_one_point_repels_with_the_force_of_firas():
    # Clearance 0.25 m: (1/0.25 − 1/0.5) / 0.25² = 32.
    assert force_of([[0.45, 0.0]]) == pytest.approx([-32.0, 0.0], abs=KERNEL)
    assert force_of([[0.0, -0.45]]) == pytest.approx([0.0, 32.0], abs=KERNEL)
    assert force_of([[0.71, 0.0]]) == pytest.approx([0.0, 0.0], abs=KERNEL)  # beyond 0.2 + 0.5 m


def planner(robot=None, **settings):
    made = Apf(load_settings("planner/apf", **settings), robot or stage())
    made.reset(np.random.default_rng(0))
    return made


def test_the_attraction_is_conic_far_off_and_parabolic_near():
    """The speed is the share of the force ahead, and here the robot reaches any in a period."""
    robot = stage(alpha_v=50.0, alpha_omega=50.0)
    for target, ahead, bearing in (
        ((3.0, 4.0), 0.6, 0.9273),
        ((0.3, 0.4), 0.3, 0.9273),
        ((0.4, 0.3), 0.4, 0.6435),
    ):
        command = plan(planner(robot, turn_gain=1.0), observation(target=target, robot=robot))
        assert command == pytest.approx((ahead * robot.v_max, bearing), abs=1e-4)


def test_attraction_and_repulsion_balance_where_they_should():
    # 0.01 · (1/ρ − 2) / ρ² = 5 N: at ρ = 0.1154 m.
    robot = stage()
    for rho, drives_on in [(0.11, False), (0.12, True)]:
        ranges = np.full(robot.lidar.num_beams, robot.lidar.range_max, dtype=np.float32)
        ranges[robot.lidar.num_beams // 2] = R + rho
        assert (plan(planner(), observation((5.0, 0.0), ranges, robot=robot)).v > 0.0) == drives_on


def test_only_the_ratio_of_the_gains_matters():
    robot = stage()
    ranges = np.full(robot.lidar.num_beams, 0.6, dtype=np.float32)
    ranges[:200] = 2.0
    view = observation(ranges=ranges, robot=robot)
    assert plan(planner(attraction=10.0, repulsion=0.02), view) == pytest.approx(
        plan(planner(attraction=5.0, repulsion=0.01), view), abs=KERNEL
    )


def drive(robot, world=None, **changes):
    return drives.drive(Apf(load_settings("planner/apf"), robot), robot, world, **changes)


def test_apf_goes_round_a_post_off_its_line():
    episode = drive(stage(), World(circles=np.array([[2.0, 0.15, 0.2]])))
    assert episode.outcome == Outcome.SUCCESS


def test_a_u_is_a_local_minimum():
    # Attraction and repulsion balance before the goal: it stays inside the U.
    u = World(segments=np.array([[3.0, -1.0, 3.0, 1.0], [1.0, 1.0, 3.0, 1.0], [1.0, -1.0, 3.0, -1.0]]))
    episode = drive(stage(), u, goal=(6.0, 0.0), time_limit=60.0)
    late = episode.trajectory[len(episode.trajectory) // 2 :]
    assert episode.outcome == Outcome.TIMEOUT
    assert late[:, 1].min() > 1.0
    assert late[:, 1].max() < 3.0
    assert np.ptp(late[:, 1]) < 0.5


def test_a_wall_across_the_way_is_a_local_minimum():
    episode = drive(stage(), World(segments=np.array([[2.0, -2.0, 2.0, 2.0]])))
    assert episode.outcome == Outcome.TIMEOUT


def test_apf_wavers_in_a_narrow_passage():
    # The other limit that Koren & Borenstein 1991 name (DOI 10.1109/ROBOT.1991.131810): between walls 0.7 m
    # apart it swings from side to side, 2.5 m apart it does not.
    def swings(width):
        walls = np.array([[1.0, s * width / 2, 6.0, s * width / 2] for s in (-1, 1)])
        episode = drive(shipped("jackal"), World(segments=walls), start=Pose(0, 0.15, 0.2), goal=(7.0, 0.0))
        omega = episode.trajectory[episode.trajectory[:, 1] > 1.0, 5]
        return np.count_nonzero(np.diff(np.sign(np.round(omega, 1))))

    assert swings(0.7) >= 10
    assert swings(2.5) <= 3
