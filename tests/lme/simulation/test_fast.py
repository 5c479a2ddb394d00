"""The kinematic simulator: what it lets a robot see, how it lets it move, and when it stops it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.frames import to_robot
from lme.robots import Footprint, Lidar
from lme.simulation.fast import FastSimulator
from lme.types import Pose, Twist
from lme.worlds.world import World
from tests import oracles
from tests.builders import room, shipped, stage, task
from tests.tolerances import KERNEL, RANGE

SEEDS = st.integers(0, 2**32 - 1)
SIGNED = st.floats(-1.0, 1.0)


def started(world=None, robot=None, seed=0, max_step=0.025, even_ramp=False, **job):
    """A simulator at the start of a task, and its first observation."""
    simulator = FastSimulator(
        load_settings("sim/fast", max_step=max_step, even_ramp=even_ramp), robot or stage()
    )
    return simulator, simulator.reset(task(world, **job), np.random.default_rng(seed))


def noisy(std, num_beams=720, range_max=15.0):
    return stage(lidar=Lidar(num_beams, 2 * math.pi, 0.02, range_max, noise_std=std))


def fast_disc(radius=0.2, rate=10.0):
    """A disc that does 2 m/s at once."""
    return stage(
        footprint=Footprint(radius=radius),
        v_max=2.0,
        alpha_v=1000.0,
        omega_max=4.0,
        alpha_omega=1000.0,
        control_rate=rate,
    )


# --- what it sees -------------------------------------------------------------------------------------


def test_ranges_are_float32_and_range_max_means_no_return():
    for std in (0.0, 0.1):
        _, seen = started(robot=noisy(std))
        assert seen.scan.ranges.dtype == np.float32
        assert (seen.scan.ranges == np.float32(15.0)).all()


def test_the_scan_says_how_it_was_taken():
    robot = shipped("jackal")
    _, seen = started(robot=robot)
    lidar = robot.lidar
    assert seen.scan[1:] == (lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)
    assert seen.scan.ranges.shape == (lidar.num_beams,)
    assert seen.limits == robot.limits


@given(SEEDS)
def test_ranges_are_those_from_the_mounted_lidar(seed):
    rng = np.random.default_rng(seed)
    mount = {"x": rng.uniform(-0.3, 0.3), "y": rng.uniform(-0.3, 0.3), "yaw": rng.uniform(-3, 3)}
    lidar = Lidar(60, rng.uniform(1, 6), 0.02, 6.0, **mount)
    world = World(circles=np.array([[2.0, 1.0, 0.5], [-1.5, 0.5, 0.3]]), segments=room(7.0).segments)
    start = Pose(*rng.uniform(-0.5, 0.5, 2), rng.uniform(-math.pi, math.pi))
    _, seen = started(world, stage(lidar=lidar), start=start)
    cos, sin = math.cos(start.yaw), math.sin(start.yaw)
    x = start.x + cos * mount["x"] - sin * mount["y"]
    y = start.y + sin * mount["x"] + cos * mount["y"]
    pose = (x, y, start.yaw + mount["yaw"])
    angles = (lidar.angle_min, lidar.angle_increment, 60)
    expected = oracles.cast(pose, angles, 6.0, world.circles, world.edges)
    assert seen.scan.ranges == pytest.approx(expected, abs=10 * RANGE)


def test_target_and_twist_are_the_robots_own():
    # Goal (4, 0), robot at (1, 2) facing +y: 2 m behind, 3 m to the right.
    simulator, seen = started(start=Pose(1.0, 2.0, math.pi / 2))
    assert seen.target == pytest.approx([-2.0, -3.0], abs=KERNEL)
    assert seen.twist == Twist(0.0, 0.0)
    seen = simulator.step(Twist(0.3, 0.1))
    assert seen.twist == simulator.state.twist == pytest.approx((0.3, 0.1), abs=KERNEL)
    assert seen.target == pytest.approx(to_robot(np.array([4.0, 0.0]), simulator.state.pose), abs=KERNEL)


def residuals(std, seed=0, periods=14):
    simulator, first = started(room(8.0), noisy(std), seed)
    clean = started(room(8.0), noisy(0.0))[1].scan.ranges
    scans = [first.scan.ranges] + [simulator.step(Twist(0.0, 0.0)).scan.ranges for _ in range(periods)]
    return (np.array(scans, dtype=float) - clean).ravel()


@pytest.mark.parametrize("std", [0.01, 0.05])
def test_noise_has_the_deviation_asked_for_and_no_bias(std):
    # n = 15 · 720: mean off by std/√n, deviation by std/√(2n); five times that is a miracle.
    off = residuals(std)
    assert abs(off.mean()) < 5 * std / math.sqrt(len(off))
    assert abs(off.std() - std) < 5 * std / math.sqrt(2 * len(off))
    # Gaussian: 68.3 % within one deviation.
    assert (np.abs(off) < std).mean() == pytest.approx(0.683, abs=0.025)


def test_no_noise_where_none_is_asked_for():
    assert (residuals(0.0, periods=2) == 0.0).all()


def test_noise_is_new_every_period_the_same_for_a_seed_and_independent_of_beams():
    one = residuals(0.05).reshape(15, 720)
    np.testing.assert_array_equal(residuals(0.05).reshape(15, 720), one)
    assert (residuals(0.05, seed=1).reshape(15, 720) != one).mean() > 0.99
    assert (one[0] != one[1]).mean() > 0.99
    assert abs(np.corrcoef(one[0], one[1])[0, 1]) < 0.2
    assert abs(np.corrcoef(one[0, :-1], one[0, 1:])[0, 1]) < 0.2


def test_noise_stays_between_nothing_and_range_max():
    world = World(circles=np.array([[4.25, 0.0, 4.0]]))
    _, near = started(world, noisy(0.5))
    assert near.scan.ranges.min() == 0.0
    _, far = started(room(19.0), noisy(0.5, range_max=10.0))
    assert far.scan.ranges.max() == np.float32(10.0)


# --- how it moves -------------------------------------------------------------------------------------


@given(st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=12), st.booleans())
def test_velocity_keeps_to_the_limits_whatever_is_commanded(commands, even_ramp):
    simulator, _ = started(even_ramp=even_ramp, goal=(1e3, 0.0))
    for command in commands:
        before = simulator.state.twist
        now = simulator.step(Twist(*command)).twist
        assert abs(now.v) <= 0.5 + KERNEL
        assert abs(now.omega) <= math.pi / 2 + KERNEL
        # As near to the command as α = 2 comes in 0.2 s.
        for was, is_, wanted, most in zip(before, now, command, (0.5, math.pi / 2), strict=True):
            goal = min(max(wanted, -most), most)
            assert is_ == pytest.approx(min(max(goal, was - 0.4), was + 0.4), abs=1e-8)


@given(SIGNED, SIGNED, SIGNED, SIGNED, st.booleans())
def test_the_pose_is_the_integral_of_the_velocities(v0, omega0, v1, omega1, even_ramp):
    simulator, _ = started(even_ramp=even_ramp, goal=(1e3, 0.0), max_step=1e-3)
    simulator.state = simulator.state._replace(twist=Twist(0.5 * v0, 1.5 * omega0))
    command = Twist(0.5 * v1, 1.5 * omega1)
    simulator.step(command)
    x, y, yaw = integrate(Twist(0.5 * v0, 1.5 * omega0), command, even_ramp)
    assert simulator.state.pose == pytest.approx((x, y, yaw), abs=2e-6)


def integrate(before, command, even_ramp, dt=0.2, alpha=2.0, n=4000):
    """The motion in n small steps of the midpoint rule."""
    t = (np.arange(n) + 0.5) * dt / n

    def ramp(start, goal):
        end = start + np.clip(goal - start, -alpha * dt, alpha * dt)
        if even_ramp:
            return start + (end - start) * t / dt
        return start + np.clip(goal - start, -alpha * t, alpha * t)

    v, omega = ramp(before.v, command.v), ramp(before.omega, command.omega)
    yaw = np.cumsum(omega) * dt / n
    middle = yaw - omega * dt / n / 2
    return (v * np.cos(middle)).sum() * dt / n, (v * np.sin(middle)).sum() * dt / n, yaw[-1]


def test_time_passes_by_the_control_period():
    simulator, _ = started()
    for _ in range(3):
        simulator.step(Twist(0.1, 0.0))
    assert simulator.state.time == pytest.approx(0.6, abs=KERNEL)


def test_reset_puts_the_robot_back_at_rest():
    simulator, first = started(room())
    simulator.step(Twist(0.5, 1.0))
    again = simulator.reset(task(room()), np.random.default_rng(0))
    np.testing.assert_array_equal(first.scan.ranges, again.scan.ranges)
    assert again.twist == Twist(0.0, 0.0)
    assert simulator.state.pose == Pose(0.0, 0.0, 0.0)
    assert simulator.state.time == 0.0


# --- when it stops ------------------------------------------------------------------------------------


def test_contact_ends_the_period_where_it_happens():
    # Disc of 0.2 m, cylinder of 0.3 m at 0.6: contact after 0.1 m, at 2 m/s half of a period of 0.1 s.
    simulator, _ = started(World(circles=np.array([[0.6, 0.0, 0.3]])), fast_disc())
    simulator.step(Twist(2.0, 0.0))
    state = simulator.state
    assert state.contact
    assert not state.arrived
    assert state.clearance == 0.0
    assert 0.1 - KERNEL <= state.pose.x <= 0.125 + KERNEL
    assert state.time == pytest.approx(state.pose.x / 2.0, abs=0.002)
    assert state.travel[-1].tolist() == list(state.pose)


@given(
    st.floats(-0.2745, 0.2745), st.floats(0, 0.4), st.floats(-math.pi, math.pi), st.sampled_from([5.0, 10.0])
)
def test_at_2_m_s_the_robot_cannot_jump_a_thin_cylinder(offset, head_start, yaw, rate):
    # r = 0.2 m past a cylinder of 0.075 m. 0.5 mm within reach, the chord is 33 mm, longer than a check step.
    cos, sin = math.cos(yaw), math.sin(yaw)
    x, y = 1.0 + head_start, offset
    world = World(circles=np.array([[cos * x - sin * y, sin * x + cos * y, 0.075]]))
    simulator, _ = started(world, fast_disc(rate=rate), start=Pose(0.0, 0.0, yaw), goal=(50.0, 0.0))
    for _ in range(15):
        simulator.step(Twist(2.0, 0.0))
        if simulator.state.contact:
            break
    assert simulator.state.contact


@pytest.mark.parametrize("offset", [0.2755, -0.2755, 0.5])
def test_the_robot_passes_a_post_that_it_does_not_touch(offset):
    simulator, _ = started(World(circles=np.array([[1.0, offset, 0.075]])), fast_disc(), goal=(50.0, 0.0))
    least = math.inf
    for _ in range(15):
        simulator.step(Twist(2.0, 0.0))
        least = min(least, simulator.state.clearance)
    assert not simulator.state.contact
    # Beside it: offset − 0.275; half a check step (12.5 mm) before or after, hardly more.
    assert abs(offset) - 0.275 - KERNEL <= least <= math.hypot(offset, 0.0126) - 0.275 + 1e-6


@given(SEEDS)
def test_clearance_is_exact(seed):
    rng = np.random.default_rng(seed)
    circles = np.column_stack([rng.uniform(-2, 2, (6, 2)), rng.uniform(0.05, 0.3, 6)])
    world = World(circles=circles, segments=rng.uniform(-3, 3, (4, 4)))
    body = Footprint(length=0.5, width=0.3) if rng.random() < 0.5 else Footprint(radius=0.2)
    simulator, _ = started(world, stage(footprint=body, v_max=2.0, alpha_v=20.0), goal=(50.0, 0.0))
    for _ in range(4):
        if simulator.state.contact:
            break
        simulator.step(Twist(rng.uniform(-2, 2), rng.uniform(-1.5, 1.5)))
    state = simulator.state
    clearance, contact = oracles.sweep(state.travel, body.box, circles, world.edges)
    assert state.clearance == pytest.approx(clearance, abs=KERNEL)
    assert state.contact == (contact >= 0)
    if contact >= 0:
        assert contact == len(state.travel) - 1


def test_clearance_by_hand():
    # Rectangle 0.5 × 0.3 at the origin, wall x = 1: 1 − 0.25. Cylinder at (0, −1), r 0.2: 1 − 0.15 − 0.2.
    body = stage(footprint=Footprint(length=0.5, width=0.3))
    wall = np.array([[1.0, -3.0, 1.0, 3.0]])
    assert started(World(segments=wall), body)[0].state.clearance == pytest.approx(0.75, abs=KERNEL)
    both = World(segments=wall, circles=np.array([[0.0, -1.0, 0.2]]))
    assert started(both, body)[0].state.clearance == pytest.approx(0.65, abs=KERNEL)
    assert started()[0].state.clearance == math.inf


def test_arrival_ends_the_period():
    # Goal 0.35 m ahead, tolerance 0.2: after 0.15 of the 0.2 m of a period.
    simulator, _ = started(robot=fast_disc(), goal=(0.35, 0.0))
    simulator.step(Twist(2.0, 0.0))
    state = simulator.state
    assert state.arrived
    assert not state.contact
    assert 0.15 - KERNEL <= state.pose.x <= 0.175 + KERNEL
    assert state.time == pytest.approx(state.pose.x / 2.0, abs=0.002)


def test_driving_through_the_goal_counts():
    simulator, _ = started(robot=fast_disc(), goal=(0.1, 0.0), goal_tolerance=0.03)
    simulator.step(Twist(2.0, 0.0))
    assert simulator.state.arrived


@pytest.mark.parametrize(("gap", "arrived"), [(0.03, False), (-0.03, True)])
def test_the_first_of_contact_and_arrival_counts(gap, arrived):
    # Arrival after 0.15 m; contact 3 cm before or after.
    cylinder = World(circles=np.array([[0.15 - gap + 0.2 + 0.3, 0.0, 0.3]]))
    simulator, _ = started(cylinder, fast_disc(), goal=(0.35, 0.0), max_step=0.005)
    simulator.step(Twist(2.0, 0.0))
    assert (simulator.state.arrived, simulator.state.contact) == (arrived, not arrived)


def test_touching_on_arrival_is_contact():
    # Arrived at the start already, and in contact there.
    simulator, _ = started(World(circles=np.array([[0.3, 0.0, 0.2]])), goal=(0.1, 0.0))
    assert simulator.state.contact
    assert simulator.state.clearance == 0.0
    assert not simulator.state.arrived
