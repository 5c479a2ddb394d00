"""Wheels that slide: against the slow twin, the Open Dynamics Engine, published figures and plain mechanics."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.geometry.skid import AXES, GRAVITY, Chassis, WheelState, slide
from lme.types import Twist
from tests import oracles, tolerances
from tests.ode import check_random_commands

SEEDS = st.integers(0, 2**32 - 1)
EACH_AXES = pytest.mark.parametrize("axes", AXES)
LIMITS = (2.0, 4.0, 20.0, 25.0)
NO_ERROR = np.zeros(1)
JACKAL = Chassis(19.531, 0.558, 0.0132, 0.137, 0.37559, 0.262, 0.098, 0.04, 0.5, 1.5)


def at_rest(x=JACKAL.com_x, yaw=0.0, phase=0.0):
    """A base at the origin; phase: angle of all wheels [rad]."""
    state = WheelState(np.zeros(6), np.zeros(4), np.zeros(2), np.zeros(16), np.zeros(2))
    state.body[:3] = x * math.cos(yaw), x * math.sin(yaw), yaw
    state.wheels[2:] = phase
    return state


def drive(commands, axes="wheel", state=None, chassis=JACKAL, period=0.1, kernel=slide):
    """Rows x, y, yaw, vx (ahead), vy (left), ω of the base, one after each command."""
    state, rows = state or at_rest(), []
    for v, omega in commands:
        arguments = (Twist(float(v), float(omega)), LIMITS, (1.0, 1.0), AXES.index(axes), NO_ERROR, period, 1)
        x, y, yaw = kernel(state, chassis, *arguments)[-1]
        cos, sin = math.cos(yaw), math.sin(yaw)
        vx, vy, turning = state.body[3:]
        rows.append((x, y, yaw, vx * cos + vy * sin, vy * cos - vx * sin - turning * chassis.com_x, turning))
    return np.array(rows)


# --- against the twin -------------------------------------------------------------------------------------


@settings(max_examples=10)
@given(SEEDS)
def test_equals_one_contact_at_a_time(seed):
    rng = np.random.default_rng(seed)
    base = rng.choice([0.0, 0.3])
    lengths = (rng.uniform(-0.4, 0.4) * base, rng.uniform(0, 0.2), rng.uniform(0.2, 0.6), base, 0.1, 0.04)
    chassis = Chassis(rng.uniform(1, 40), rng.uniform(0.1, 2), *lengths, rng.uniform(0.1, 1), 1.5)
    chassis = chassis._replace(lag=float(rng.choice([0.0, 0.1])))
    states, ways = [at_rest(), at_rest()], [[], []]
    errors, axes = rng.normal(0, 0.01, 2), int(rng.integers(3))
    for command in rng.uniform((-1, -4), (2, 4), (3, 2)):
        for kernel, state, way in zip((slide, oracles.slide), states, ways, strict=True):
            arguments = (Twist(*command), LIMITS, (1.0, 0.9), axes, errors, 0.02, 4)
            way.append(kernel(state, chassis, *arguments))
    np.testing.assert_allclose(*ways, atol=tolerances.KERNEL)
    for one, twin in zip(*states, strict=True):
        np.testing.assert_allclose(one, twin, atol=1e3 * tolerances.KERNEL)


# --- against Open Dynamics Engine ---------------------------------------------------------------------------


@EACH_AXES
def test_random_commands_as_in_open_dynamics_engine(axes):
    check_random_commands(drive, axes)


# --- against figures measured with the robot's URDF in Gazebo's own engine -----------------------------------

PHASES = np.linspace(
    0, math.pi, 12, endpoint=False
)  # of the wheels at the start: not reported, and it matters


def mean(commands, axes, column, period=0.1):
    """A column of the rows, averaged over the wheels' phase: (K,)."""
    return np.mean(
        [drive(commands, axes, at_rest(phase=p), period=period)[:, column] for p in PHASES], axis=0
    )


@pytest.mark.parametrize(("axes", "measured"), [("wheel", 3.3), ("world", 4.9)])
def test_acceleration_from_rest(axes, measured):
    assert mean([(2, 0)] * 3, axes, 3)[-1] / 0.3 == pytest.approx(
        measured, rel=tolerances.GAZEBO_ACCELERATION
    )


@pytest.mark.parametrize(("axes", "measured"), [("wheel", 9.0), ("world", 10.0)])
def test_turning_in_place_from_rest(axes, measured):
    """With the wheels as the robot is spawned: with friction on the wheel other phases are slower."""
    rate = drive([(0, 4)] * 2, axes)[-1, 5] / 0.2
    assert rate == pytest.approx(measured, rel=tolerances.GAZEBO_ACCELERATION)


@pytest.mark.parametrize(
    ("axes", "least", "most"), [("wheel", 1.31, 1.35), ("world", 1.08, 1.08), ("body", 1.35, 1.36)]
)
@pytest.mark.parametrize("omega", [1.0, 2.0])
def test_steady_turn_rate_per_commanded_one(axes, least, most, omega):
    gain = drive([(0, omega)] * 60, axes)[30:, 5].mean() / omega
    assert least - tolerances.GAZEBO_GAIN <= gain <= most + tolerances.GAZEBO_GAIN


@pytest.mark.parametrize(
    ("roll", "ode"), [(0.2, 0.994), (0.25, 1.201), (0.35, 1.313), (0.4, 1.074), (0.45, 0.893)]
)
def test_the_robot_turns_faster_where_left_and_right_wheels_mirror_each_other(roll, ode):
    """Roll ahead at 0.5 m/s for a while, stop, turn at 1 rad/s: benchmarks/ode_jackal.cpp gave these means."""
    state = at_rest()
    drive([(0.5, 0)], state=state, period=roll)
    drive([(0, 0)], state=state, period=0.5)
    rates = drive([(0, 1)] * 600, state=state, period=0.01)[300:, 5]
    assert rates.mean() == pytest.approx(ode, abs=tolerances.GAZEBO_GAIN)


@pytest.mark.parametrize(("axes", "measured"), [("wheel", (0.0, 0.20, 0.83)), ("world", (0.0, 0.55, 1.18))])
def test_while_the_wheels_spin_the_robot_hardly_turns(axes, measured):
    rate = mean([(1, 1)] * 5, axes, 5)[[0, 2, 4]]
    np.testing.assert_allclose(rate, measured, atol=tolerances.GAZEBO_TURN_RATE)


@pytest.mark.parametrize(("axes", "measured"), [("wheel", 1.1), ("world", 0.5)])
def test_at_full_speed_and_2_radps_the_robot_slides_sideways(axes, measured):
    """Within 1.2 s; later still faster with friction on the wheel, here as in Open Dynamics Engine."""
    sideways = np.abs(mean([(2, 2)] * 12, axes, 4))
    assert sideways.max() == pytest.approx(measured, abs=tolerances.GAZEBO_SIDESLIP)


# --- plain mechanics ------------------------------------------------------------------------------------


@EACH_AXES
def test_a_robot_at_rest_stays_there(axes):
    np.testing.assert_array_equal(drive([(0, 0)] * 5, axes), np.tile([0.0, 0, 0, 0, 0, 0], (5, 1)))


@pytest.mark.parametrize("axes", ["world", "body"])
@pytest.mark.parametrize("friction", [0.3, 0.5, 0.8])
def test_the_robot_accelerates_and_brakes_as_friction_allows(axes, friction):
    chassis = JACKAL._replace(friction=friction, com_height=0.0)
    state = at_rest()
    speed = drive([(2, 0)] * 2, axes, state, chassis)[-1, 3]
    assert speed == pytest.approx(friction * GRAVITY * 0.2, rel=0.01)
    speeds = drive([(2, 0)] * 20 + [(0, 0)] * 2, axes, state, chassis)[:, 3]
    assert speeds[-3] - speeds[-1] == pytest.approx(friction * GRAVITY * 0.2, rel=0.01)


def test_with_much_friction_the_robot_follows_its_wheels():
    chassis = JACKAL._replace(friction=50.0, com_height=0.0)
    speeds = drive([(1, 0)] * 3, "body", chassis=chassis)[-1]
    assert speeds[3:] == pytest.approx((1.0, 0.0, 0.0), abs=1e-3)


def test_two_wheels_on_one_axle_turn_without_scrubbing():
    chassis = JACKAL._replace(
        wheel_base=0.0, wheel_width=0.0, com_x=0.0, separation_multiplier=1.0, com_height=0.0
    )
    rate = drive([(0.3, 1.0)] * 10, "body", at_rest(x=0.0), chassis)[-1]
    assert rate[3:] == pytest.approx((0.3, 0.0, 1.0), abs=0.01)


@EACH_AXES
def test_a_mirrored_command_drives_the_mirrored_way(axes):
    commands = np.random.default_rng(3).uniform((-1, -4), (2, 4), (8, 2))
    one, other = drive(commands, axes), drive(commands * (1, -1), axes)
    np.testing.assert_allclose(one * (1, -1, -1, 1, -1, -1), other, atol=tolerances.SWEEPS)


@pytest.mark.parametrize("axes", ["wheel", "body"])
def test_the_start_heading_does_not_matter_unless_friction_is_tied_to_the_world(axes):
    commands = np.random.default_rng(4).uniform((-1, -4), (2, 4), (6, 2))
    one, other = drive(commands, axes), drive(commands, axes, at_rest(yaw=1.0))
    np.testing.assert_allclose(one[:, 3:], other[:, 3:], atol=tolerances.MIRROR)


@EACH_AXES
def test_more_sweeps_would_change_little(axes, monkeypatch):
    """The twin with twenty sweeps in place of two."""
    commands = np.random.default_rng(5).uniform((0, -4), (2, 4), (3, 2))
    monkeypatch.setattr(oracles, "SLIDE_SWEEPS", 20)
    one, other = drive(commands, axes), drive(commands, axes, kernel=oracles.slide)
    np.testing.assert_allclose(one[:, 3:], other[:, 3:], atol=tolerances.SWEEPS)


def test_odometry_is_the_wheels_speed_along_the_measured_yaw():
    state, error = at_rest(), np.array([0.1])
    slide(state, JACKAL, Twist(1.0, 0.0), LIMITS, (1.0, 1.0), 0, error, 1.0, 1)
    rolled = 1.0 - 1.0 / (2 * 20.0)  # the ramp to 1 m/s
    assert state.odometry == pytest.approx(rolled * np.array([math.cos(0.1), math.sin(0.1)]), abs=0.01)
    assert state.body[0] - JACKAL.com_x < rolled - 0.05  # the wheels have spun
