"""What ends a motion, and when a clock starts, against slow twins; limits for an even ramp."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.collision import first_event
from lme.geometry.motion import drive, even_limits, time_beyond
from tests import oracles
from tests.tolerances import KERNEL


def motion(rng):
    """A random walk of some poses among some obstacles, with a goal."""
    poses = np.cumsum(rng.normal(0.0, 0.15, (rng.integers(1, 30), 3)), axis=0)
    circles = np.column_stack([rng.uniform(-2, 2, (4, 2)), rng.uniform(0.05, 0.3, 4)])
    return poses, rng.uniform(-1, 1, 2), circles, rng.uniform(-2, 2, (2, 4))


@given(st.integers(0, 2**32 - 1))
def test_the_first_of_contact_and_arrival_ends_a_motion(seed):
    rng = np.random.default_rng(seed)
    poses, goal, circles, edges = motion(rng)
    box, tolerance = (0.2, 0.1, 0.05), 0.3
    near = np.hypot(*(poses[:, :2] - goal).T) <= tolerance
    arrival = int(near.argmax()) if near.any() else len(poses)
    clearance, contact = oracles.sweep(poses[: arrival + 1], box, circles, edges)
    passed, least, touched, arrived = first_event(poses, goal, tolerance, box, circles, edges)
    assert touched == (contact >= 0)
    assert arrived == (near.any() and not touched)
    assert passed == (contact + 1 if touched else min(arrival + 1, len(poses)))
    assert least == pytest.approx(clearance, abs=KERNEL)


@given(st.integers(0, 2**32 - 1))
def test_the_clock_starts_with_the_first_pose_that_is_far_enough(seed):
    rng = np.random.default_rng(seed)
    poses, start, _, _ = motion(rng)
    far = np.hypot(*(poses[:, :2] - start).T) >= 0.8
    times = np.linspace(2.0, 3.0, len(poses) + 1)[1:]  # equal parts of the motion from 2 to 3 s
    expected = times[far.argmax()] if far.any() else math.nan
    assert time_beyond(poses, start, 0.8, 2.0, 3.0) == pytest.approx(expected, abs=KERNEL, nan_ok=True)


def test_an_even_ramp_takes_the_whole_period_unless_the_robot_is_too_weak():
    limits = even_limits((0.0, 0.0), (0.5, 9.0), (1.0, 2.0, 20.0, 4.0), 0.1)
    assert limits == pytest.approx((1.0, 2.0, 5.0, 4.0))  # 0.5 m/s in 0.1 s; ω can only do 4 rad/s²
    _, twist = drive((0.0, 0.0, 0.0), (0.0, 0.0), (0.5, 9.0), limits, 0.1, 0.025, 0.3)
    assert twist == pytest.approx((0.5, 0.4))
