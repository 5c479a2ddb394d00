"""Limits of commands, and what a robot would touch."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.live.pilot import predict, touches
from lme.robots import Footprint, reachable
from lme.types import Limits, Pose, Twist
from tests import builders

HERE, STILL = Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0)
SPEEDS = st.floats(-20.0, 20.0)


@given(SPEEDS, SPEEDS, st.floats(-2.0, 2.0), st.floats(-4.0, 4.0), st.floats(0.01, 1.0))
def test_commands_stay_within_velocity_and_acceleration(v, omega, last_v, last_omega, dt):
    limits, last = Limits(2.0, 4.0, 1.5, 3.0), Twist(last_v, last_omega)
    sent = reachable(v, omega, last, limits, dt)
    assert abs(sent.v) <= 2.0
    assert abs(sent.omega) <= 4.0
    assert abs(sent.v - last_v) <= 1.5 * dt + 1e-12
    assert abs(sent.omega - last_omega) <= 3.0 * dt + 1e-12


def test_a_command_within_the_limits_is_not_changed():
    assert reachable(0.3, -0.2, Twist(0.2, 0.1), Limits(2.0, 4.0, 1.5, 3.0), 0.2) == Twist(0.3, -0.2)


def ahead(distance):
    return np.array([[distance, 0.0]])


def test_touches_foresees_contact_within_the_braking_distance_only():
    """0.5 m/s, 2 m/s²: 0.1 m in the period of 0.2 s, and 0.0625 m to brake, beside the radius of 0.2 m."""
    robot, moving = builders.stage(), Twist(0.5, 0.0)
    assert touches(ahead(0.36), HERE, moving, moving, robot)
    assert not touches(ahead(0.37), HERE, moving, moving, robot)
    assert not touches(ahead(0.27), HERE, moving, STILL, robot)
    assert not touches(ahead(-0.21), HERE, moving, moving, robot)


def test_the_robot_has_moved_since_the_scan():
    robot, moving = builders.stage(), Twist(0.5, 0.0)
    assert touches(ahead(0.41), Pose(0.05, 0.0, 0.0), moving, moving, robot)
    assert not touches(ahead(0.41), HERE, moving, moving, robot)
    aside = Pose(0.05, 0.0, math.pi / 2)
    assert not touches(ahead(0.41), aside, moving, moving, robot)


def test_after_its_last_pose_the_robot_has_followed_its_last_command():
    """From rest at 2 m/s²: 0.5 m/s after 0.25 s and 0.0625 m, then 0.05 s at that speed."""
    pose, twist = predict(HERE, STILL, Twist(0.5, 0.0), 0.3, builders.stage())
    assert pose == pytest.approx((0.0875, 0.0, 0.0))
    assert twist == pytest.approx((0.5, 0.0))
    assert predict(HERE, Twist(0.3, 0.1), STILL, 0.0, builders.stage()) == (HERE, (0.3, 0.1))


def test_a_long_robot_touches_with_its_corners_when_it_turns():
    robot = builders.stage(footprint=Footprint(length=0.8, width=0.3))
    beside = np.array([[0.35, 0.17]])
    assert touches(beside, HERE, STILL, Twist(0.0, 1.5), robot)
    assert not touches(beside, HERE, STILL, Twist(0.0, -0.1), robot)
    assert not touches(beside, HERE, STILL, STILL, robot)


@pytest.mark.parametrize("moving", [STILL, Twist(0.5, 1.0)])
def test_nothing_seen_is_nothing_touched(moving):
    assert not touches(np.empty((0, 2)), HERE, moving, moving, builders.stage())
