"""The vote of motion tubes: shapes and votes worked out by hand, and what the entry does without a vote or a plan.

Jackal's lidar is 0.055 m ahead of its base. Tubes begin there: front 0.21 + 0.10, sides 0.165 + 0.05.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.motion_tubes.kernels import free_tubes
from lme.planners.motion_tubes.tube_vote import TubeVote, edge_samples, tube_sets
from lme.planners.motion_tubes.tubes import lidar_view
from lme.types import Guidance, Twist
from tests.builders import challenge_jackal, observation
from tests.tolerances import KERNEL

JACKAL = challenge_jackal()
FRONT, HALF = 0.31, 0.215
AT_ONCE = 100.0  # [m/s²] no ramp
TWO_SETS = {"speeds": [0.1, 1.0], "horizons": [1.0, 1.0]}


def made(**changes):
    planner = TubeVote(load_settings("planner/tube_vote", **changes), JACKAL)
    planner.reset(np.random.default_rng(0))
    return planner


def command(planner, target=(8.0, 0.0), ranges=None, path=None, last=None):
    """The next command. last: the one before it; without it, the planner's own."""
    last = planner._command if last is None else last
    view = observation(target, ranges, last, JACKAL)
    return planner.plan(view, Guidance(view.target, None if path is None else np.array(path)))


def blocked_everywhere():
    return np.full(JACKAL.lidar.num_beams, 0.2, np.float32)


def test_the_edge_of_a_straight_tube():
    """Tracks of both front corners, and a front as far beyond them as samples are apart."""
    samples = edge_samples(0.0, 0.1, FRONT, HALF, 0.03)
    left, right = samples[samples[:, 1] > HALF - KERNEL], samples[samples[:, 1] < -HALF + KERNEL]
    ticks = [0.31, 0.335, 0.36, 0.385, 0.41, 0.44]  # four steps of 0.025 for 0.1 m, then the front
    assert left[:, 0] == pytest.approx(ticks)
    assert np.sort(right[:, 0]) == pytest.approx(ticks)
    front = samples[np.abs(samples[:, 1]) < HALF - KERNEL]
    assert front[:, 0] == pytest.approx(0.44)
    assert len(front) == 14  # 0.43 m in 15 pieces


def test_the_edge_of_a_tube_that_turns_left():
    """A quarter turn about (0, 1): the axle's left end is 0.785 m from there, the front's right corner 1.254 m."""
    samples = edge_samples(1.0, 0.5 * math.pi, FRONT, HALF, 0.03)
    away = np.hypot(samples[:, 0], samples[:, 1] - 1.0)
    assert samples[0] == pytest.approx([0.0, HALF])
    assert away.min() == pytest.approx(0.785)
    assert away.max() == pytest.approx(math.hypot(1.0 + HALF, FRONT))
    # Its front is where the robot then stands: at (1, 1), facing +y.
    assert samples[:, 1].max() == pytest.approx(1.0 + FRONT)
    assert np.hypot(*np.diff(samples[:-1], axis=0).T)[: len(samples) // 2].max() < 0.03 + KERNEL
    mirrored = edge_samples(-1.0, 0.5 * math.pi, FRONT, HALF, 0.03)
    assert mirrored == pytest.approx(samples * [1.0, -1.0])


def test_tubes_of_a_set_turn_no_faster_than_the_limit_and_fast_ones_are_wider():
    planner = made()
    assert [len(part) for part in planner._curvatures][::13] == [87, 45]
    for speed, part in zip(planner._speeds, planner._curvatures, strict=True):
        assert max(part) * speed <= 0.5 * math.pi
        assert sorted(part) == list(part)
        assert 0.0 in part
    assert planner._shape.half_widths[0] == pytest.approx(0.215)  # up to 0.25 m/s
    assert planner._shape.half_widths[-1] == pytest.approx(0.365)  # 0.1 m more per m/s, at 1.75 m/s


@given(st.integers(0, 10**6), st.sampled_from([0, 3, 9, 13]))
def test_a_tube_is_free_if_each_sample_is_nearer_than_the_beam_that_meets_it(seed, k):
    planner, rng = made(), np.random.default_rng(seed)
    ranges = np.repeat(rng.uniform(0.05, 3.0, 24), 30).astype(np.float32)
    scan = observation(ranges=ranges, robot=JACKAL).scan
    view, free_ranges = lidar_view(scan, JACKAL.lidar.mount)
    tubes = tube_sets(planner._curvatures, planner._lengths, planner._shape, view, scan.range_min)
    free = free_tubes(free_ranges, tubes.needs, tubes.farthest, tubes.hidden)
    for n in np.flatnonzero(tubes.sets == k)[::7]:
        expected = True
        shape = planner._shape
        for x, y in edge_samples(
            tubes.curvatures[n], planner._lengths[k], shape.front, shape.half_widths[k], shape.sampling
        ):
            beam, away = round((math.atan2(y, x) - scan.angle_min) / scan.angle_increment), math.hypot(x, y)
            if not 0 <= beam < len(ranges) or away <= scan.range_min:
                continue
            if scan.range_min <= ranges[beam] < np.float32(away):
                expected = False
        assert free[n] == expected


def test_votes_that_miss_by_more_weigh_more():
    """The goal is 1 m ahead, 0.945 m from the lidar.

    The short set's tube ends at 0.425 m, 0.045 m before its way-point at 0.525 − 0.055 m; the long set's ends at
    1.325 m, 0.38 m beyond the goal. So the mean is (0.1 / 0.455 + 1.0 / 0.12) / (1 / 0.455 + 1 / 0.12) = 0.81 m/s.
    With the opposite weights it would be 0.29 m/s.
    """
    planner = made(**TWO_SETS, acceleration=AT_ONCE)
    vote = planner._vote(observation((1.0, 0.0), robot=JACKAL), np.array([(0.0, 0.0), (1.0, 0.0)]))
    assert vote == pytest.approx(Twist(0.8122, 0.0), abs=1e-4)
    assert command(planner, (1.0, 0.0)) == pytest.approx(Twist(0.8, 0.0))


@pytest.mark.parametrize(("mean", "speed"), [(0.31, 0.8), (0.3, 0.2), (0.21, 0.2), (0.2, 0.05), (0.1, 0.05)])
def test_the_mean_speed_selects_one_of_three(mean, speed):
    planner = made(speeds=[mean], horizons=[0.25 / mean], acceleration=AT_ONCE)
    assert command(planner) == pytest.approx(Twist(speed, 0.0))


def test_the_speed_rises_by_a_ramp_and_falls_at_once():
    planner = made()
    speeds = [command(planner).v for _ in range(3)]
    assert speeds == pytest.approx([0.015, 0.03, 0.045])  # 0.3 m/s² at 20 Hz
    planner = made(**TWO_SETS)
    planner._command = Twist(0.8, 0.0)
    wall = np.full(JACKAL.lidar.num_beams, 0.5, np.float32)  # the tubes of 1 m are not free
    assert command(planner, ranges=wall) == pytest.approx((0.05, 0.0))


def test_a_tight_turn_is_driven_as_slowly_as_its_curvature_needs():
    twist = made(acceleration=AT_ONCE)._follow(Twist(0.5, -1.2), observation(robot=JACKAL))
    assert twist == pytest.approx(
        (0.5 * math.pi * 0.5 / 1.2, -0.5 * math.pi)
    )  # 0.8 m/s would need 1.92 rad/s


def test_without_a_vote_the_robot_backs_up_or_turns_without_end():
    planner = made()
    assert command(planner, ranges=blocked_everywhere()) == Twist(-0.3, 0.0)
    for side in (1, -1):
        planner = made(acceleration=AT_ONCE)
        assert side * command(planner, (1.0, side * 1.0)).omega > 0.1
        turns = [command(planner, ranges=blocked_everywhere()) for _ in range(50)]
        assert turns[-1] == Twist(0.0, side * 0.75)
        assert turns[0].omega == turns[-1].omega


def test_after_backing_up_the_robot_still_backs_up_along_the_arc_of_the_vote():
    """The ramp starts from −0.3 m/s, and the arc is kept, so the robot turns the other way."""
    planner = made()
    command(planner, ranges=blocked_everywhere())
    twist = command(planner, (1.0, 1.0))
    assert twist.v == pytest.approx(-0.285)
    assert twist.omega < 0.0


def test_without_a_plan_the_base_stops_after_a_while_and_then_goes_on_at_the_same_speed():
    planner = made()
    for _ in range(20):
        last = command(planner)
    view = observation((8.0, 0.0), None, last, JACKAL)
    held = [planner.plan(view, Guidance(np.zeros(2), blocked=True)) for _ in range(7)]
    assert [twist.v for twist in held] == pytest.approx([0.3] * 5 + [0.0] * 2)  # 0.25 s
    assert command(planner, last=Twist(0.0, 0.0)).v == pytest.approx(0.315)


def test_the_robot_rests_at_the_goal():
    assert command(made(), (0.05, 0.05)) == Twist(0.0, 0.0)
