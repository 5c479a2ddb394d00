"""The simulator of a robot that slips: what it adds to the kernel, which has tests of its own."""

import dataclasses
import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import compose, relative, to_robot
from lme.navigation.episode import run_episode
from lme.robots import Footprint, Response
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.types import Pose, Twist
from lme.worlds.barn.map_set import Barn
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import CAP, CLUTTER, navigator, room, shipped, stage, task
from tests.tolerances import KERNEL, RANGE

GAZEBO, REAL = shipped("jackal").capped(CAP), shipped("jackal_real")
FAR = (1e3, 0.0)
CALM = {"yaw_noise": 0.0}


def skid(world=None, robot=GAZEBO, start=Pose(0.0, 0.0, 0.0), goal=FAR, seed=0, **sim):  # noqa: B008
    """A simulator at the start of a task, and its first observation."""
    simulator = SkidSimulator(load_settings("sim/skid", **sim), robot)
    return simulator, simulator.reset(task(world, start=start, goal=goal), np.random.default_rng(seed))


def driven(simulator, commands):
    return [simulator.step(Twist(*command)) for command in commands]


# --- motion -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", [GAZEBO, REAL], ids=lambda robot: robot.name)
def test_lme_drives_barn_worlds_and_a_seed_gives_the_drive_again(robot):
    maps, driver = Barn(load_settings("map/barn", subset="fresh", count=1, fresh_seed=3)), navigator(robot)
    simulator = SkidSimulator(load_settings("sim/skid"), robot)
    for number in maps.numbers:
        one, two = (
            run_episode(maps.task(number), driver, simulator, np.random.default_rng(1)) for _ in range(2)
        )
        assert one.steps > 20
        np.testing.assert_array_equal(one.trajectory, two.trajectory)


def test_state_holds_the_way_of_the_whole_period():
    simulator, _ = skid()
    driven(simulator, [(1.0, 0.5)] * 3)
    state = simulator.state
    assert state.time == pytest.approx(0.3)
    assert state.travel.shape == (20, 3)
    assert tuple(state.travel[-1]) == state.pose
    assert state.twist.v > 0.3


def test_friction_is_on_the_axes_that_are_asked_for():
    ends = set()
    for friction in ("wheel", "world", "body"):
        simulator, _ = skid(friction=friction, **CALM)
        driven(simulator, [(1.0, 2.0)] * 10)
        ends.add(simulator.state.pose)
    assert len(ends) == 3


@pytest.mark.parametrize("rate", [4.0, 8.0, 10.0, 30.0, 100.0])
def test_any_control_rate_lasts_its_period(rate):
    simulator, _ = skid(robot=dataclasses.replace(GAZEBO, control_rate=rate), **CALM)
    driven(simulator, [(1.0, 0.0)] * round(2 * rate))
    assert simulator.state.time == pytest.approx(round(2 * rate) / rate)
    assert simulator.state.pose.x == pytest.approx(2.0 - 0.5 / 4.905, abs=0.01)  # to 1 m/s at μ g


def test_the_wheels_approach_the_command_with_the_lag():
    simulator, _ = skid(lag=0.2, **CALM)
    speeds = [seen.twist.v for seen in driven(simulator, [(0.5, 0.0)] * 5)]
    assert speeds == pytest.approx([0.5 * (1.0 - math.exp(-k / 2)) for k in range(1, 6)], abs=KERNEL)


def test_a_lag_adds_to_a_measured_response():
    prompt, lagging = (skid(robot=REAL, lag=lag, **CALM)[0] for lag in (0.0, 0.3))
    for simulator in (prompt, lagging):
        driven(simulator, [(0.3, 0.0)] * 10)
    later = (prompt.state.pose.x - lagging.state.pose.x) / prompt.state.twist.v
    assert 0.1 < later < 0.3
    driven(lagging, [(0.3, 0.0)] * 20)
    assert lagging.state.twist.v == pytest.approx(prompt.state.twist.v, rel=1e-3)


def test_latency_puts_the_motion_off():
    late, _ = skid(latency=0.1, **CALM)
    prompt, _ = skid(**CALM)
    driven(late, [(1.0, 0.0)] * 6)
    driven(prompt, [(1.0, 0.0)] * 5)
    assert late.state.pose == pytest.approx(prompt.state.pose, abs=KERNEL)


def test_a_real_robot_responds_as_it_was_measured():
    simulator, _ = skid(robot=REAL, **CALM)
    seen = driven(simulator, [(0.5, 0.4)] * 20)
    x, _, yaw = simulator.state.pose
    assert simulator.state.twist == pytest.approx((0.91 * 0.5, 0.84 * 0.4), abs=1e-6)
    assert seen[-1].twist == pytest.approx((0.5, 0.84 * 0.4), abs=1e-6)
    assert yaw == pytest.approx(0.84 * 0.4 * (2 - 0.06 - 0.84 * 0.4 / 5 / 2), abs=0.003)
    assert math.hypot(*seen[-1].odometry[:2]) == pytest.approx(
        math.hypot(*simulator.state.pose[:2]) / 0.91, rel=0.01
    )
    assert x > 0.5


def test_a_real_robot_waits_for_its_delay():
    simulator, _ = skid(robot=REAL, **CALM)
    driven(simulator, [(0.5, 0.0)])
    assert simulator.state.pose.x == 0.0
    driven(simulator, [(0.5, 0.0)])
    assert simulator.state.pose.x > 0.0


# --- what the robot knows -------------------------------------------------------------------------------


def test_the_goal_is_known_by_odometry_alone_and_arrival_by_the_true_pose():
    simulator, first = skid(goal=(1.0, 0.0), **CALM)
    np.testing.assert_allclose(first.target, (1.0, 0.0))
    seen = driven(simulator, [(2.0, 0.0)] * 5)[-1]
    spun = seen.odometry.x - simulator.state.pose.x  # tread that covered no ground
    assert spun > 0.2
    assert seen.target[0] == pytest.approx(1.0 - seen.odometry.x)
    assert not simulator.state.arrived
    assert seen.target[0] < 0.2  # the robot believes that it is there


def test_reported_speed_is_the_wheels_and_turn_rate_is_true():
    simulator, _ = skid(**CALM)
    seen = driven(simulator, [(2.0, 1.0)] * 2)[-1]
    assert seen.twist.v == 2.0
    assert simulator.state.twist.v < 1.5
    assert seen.twist.omega == simulator.state.twist.omega


def test_a_localisation_may_see_the_goal_with_every_scan():
    simulator, _ = skid(goal=(3.0, 1.0), goal_rate=None)
    seen = driven(simulator, [(2.0, 1.0)] * 5)[-1]
    np.testing.assert_allclose(seen.target, to_robot(np.array([3.0, 1.0]), simulator.state.pose))


def test_the_measured_yaw_is_as_noisy_as_asked_for():
    simulator, first = skid(yaw_noise=0.05)
    errors = [simulator.step(Twist(0.0, 0.0)).odometry.yaw for _ in range(400)]
    assert first.odometry.yaw == 0.0
    assert np.std(errors) == pytest.approx(0.05, rel=0.15)


def test_a_scan_is_at_most_one_lidar_period_old():
    robot = dataclasses.replace(GAZEBO, lidar=dataclasses.replace(GAZEBO.lidar, noise_std=0.0))
    wall = World(segments=np.array([[6.0, -9.0, 6.0, 9.0]]))
    ages = []
    for seed in range(8):
        simulator, _ = skid(wall, robot, seed=seed, scan_rate=20.0, **CALM)
        seen = driven(simulator, [(1.0, 0.0)] * 10)[-1]
        seen_from = 6.0 - robot.lidar.x - float(seen.scan.ranges.min())
        ages.append((simulator.state.pose.x - seen_from) / simulator.state.twist.v)
    assert min(ages) > -0.003
    assert max(ages) < 0.053
    assert max(ages) - min(ages) > 0.02


def test_a_scan_says_where_it_was_taken():
    robot = dataclasses.replace(GAZEBO, lidar=dataclasses.replace(GAZEBO.lidar, noise_std=0.0))
    for seed in range(3):
        simulator, _ = skid(CLUTTER, robot, seed=seed, scan_rate=20.0, odometry_age=0.02, **CALM)
        seen = driven(simulator, [(1.0, 0.6)] * 5)[-1]
        other = FastSimulator(load_settings("sim/fast"), robot)
        # the wheels slide, so the odometry is off; where the scan was taken is known relative to it
        twin, _ = skid(CLUTTER, robot, seed=seed, scan_rate=20.0, **CALM)  # its odometry has no age
        now = driven(twin, [(1.0, 0.6)] * 5)[-1].odometry
        there = compose(simulator.state.pose, relative(seen.scan_pose, now))
        again = other.reset(task(CLUTTER, start=there), np.random.default_rng(0))
        np.testing.assert_allclose(seen.scan.ranges, again.scan.ranges, atol=RANGE)


def test_without_a_scan_rate_the_scan_is_taken_at_the_current_pose():
    robot = dataclasses.replace(GAZEBO, lidar=dataclasses.replace(GAZEBO.lidar, noise_std=0.0))
    simulator, _ = skid(CLUTTER, robot, scan_rate=None)
    seen = driven(simulator, [(0.5, 0.3)] * 3)[-1]
    other = FastSimulator(load_settings("sim/fast"), robot)
    there = other.reset(task(CLUTTER, start=simulator.state.pose), np.random.default_rng(0))
    np.testing.assert_allclose(seen.scan.ranges, there.scan.ranges, atol=RANGE)


# --- contact ------------------------------------------------------------------------------------------


def hits(make, robot):
    """Whether a robot that drives past a post, between its footprint's side and the wheels', hits it."""
    simulator = make(robot)
    beside = World(circles=np.array([[1.0, 0.24, 0.05]]))
    simulator.reset(task(beside, goal=FAR), np.random.default_rng(0))
    for _ in range(15):
        simulator.step(Twist(1.0, 0.0))
        if simulator.state.contact:
            break
    return simulator.state.contact


def test_wheels_that_stand_out_collide_in_this_simulator_alone():
    bare = dataclasses.replace(GAZEBO, drivetrain=dataclasses.replace(GAZEBO.drivetrain, contact=None))
    assert hits(lambda robot: SkidSimulator(load_settings("sim/skid"), robot), GAZEBO)
    assert not hits(lambda robot: SkidSimulator(load_settings("sim/skid"), robot), bare)
    assert not hits(lambda robot: FastSimulator(load_settings("sim/fast"), robot), GAZEBO)
    assert not hits(lambda robot: PhysicsSimulator(load_settings("sim/physics"), robot), GAZEBO)


def test_a_wall_ends_the_motion_at_the_hulls_front():
    simulator, _ = skid(room(4.0))
    while not simulator.state.contact:
        simulator.step(Twist(1.0, 0.0))
    assert simulator.state.pose.x == pytest.approx(2.0 - 0.458 / 2, abs=0.01)
    assert simulator.state.clearance == 0.0


def test_a_pedestrian_runs_into_a_robot_at_rest():
    walker = Mover(path=np.array([[2.0, 0.0], [-2.0, 0.0]]), radius=0.3, speed=1.0)
    simulator, _ = skid(World(movers=(walker,)))
    while not simulator.state.contact and simulator.state.time < 3.0:
        simulator.step(Twist(0.0, 0.0))
    assert simulator.state.time == pytest.approx(2.0 - 0.3 - 0.458 / 2, abs=0.02)


# --- mistakes -------------------------------------------------------------------------------------------


def test_a_robot_without_a_drivetrain_is_refused_with_what_to_add(says):
    with says.raises(InputError):
        skid(robot=stage())


def test_commands_that_come_too_seldom_are_refused(says):
    with says.raises(InputError, match="control_rate.*3 Hz"):
        skid(robot=dataclasses.replace(GAZEBO, control_rate=3.0))


@pytest.mark.parametrize(
    "change",
    [
        {"mass": 0.0},
        {"com_x": 0.2},
        {"wheel_base": -1.0},
    ],
    ids=str,
)
def test_an_impossible_drivetrain_is_refused(change, says):
    with says.raises(InputError):
        dataclasses.replace(GAZEBO.drivetrain, **change)


def test_an_impossible_response_is_refused(says):
    with says.raises(InputError, match="gain_v.*0"):
        Response(0.0, 1.0, 0.0, 0.0, 1.0, 1.0)
    with says.raises(InputError):
        dataclasses.replace(GAZEBO, response=REAL.response)


@pytest.mark.parametrize(
    "change",
    [{"footprint": Footprint(length=0.6, width=0.3)}, {"v_max": 4.0}, {"omega_max": 6.0}],
    ids=str,
)
def test_an_outline_or_a_speed_that_is_not_the_drivetrains_is_said(change, says):
    with says.warns():
        SkidSimulator(load_settings("sim/skid"), dataclasses.replace(GAZEBO, **change))
