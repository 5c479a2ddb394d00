"""A Jackal on four wheels: against the Open Dynamics Engine, figures of Gazebo, and what may happen in a world."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.skid import AXES
from lme.navigation.episode import run_episode
from lme.simulation.crowd import Crowd
from lme.simulation.mujoco.kernels import apply_friction
from lme.simulation.mujoco.simulator import MujocoSimulator
from lme.simulation.mujoco.wheels import FourWheels
from lme.simulation.simulator import FALL
from lme.types import Outcome, Pose, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests import tolerances
from tests.builders import navigator, room, shipped, task
from tests.ode import check_random_commands

mujoco = pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")

EACH_AXES = pytest.mark.parametrize("axes", AXES)
FAR = (50.0, 0.0)
AHEAD, STOP = Twist(1.0, 0.0), Twist(0.0, 0.0)
WALL = World(segments=np.array([[1.2, -2.0, 1.2, 2.0]]))


def wheels(axes="world", yaw=0.0, phase=0.0):
    """A Jackal on an empty floor; phase: angle of all wheels [rad]."""
    made = FourWheels(shipped("jackal"), axes, 0.0, None)
    made.begin(Pose(0.0, 0.0, yaw), np.random.default_rng(0))
    made.enter(World(), Crowd(()))
    made._data.qpos[7:] = phase
    mujoco.mj_forward(made._arena.model, made._data)
    return made


def driven(commands, axes="world", period=0.1, **start):
    """Rows x, y, yaw, vx (ahead), vy (left), ω of the base, one after each command."""
    made, rows = wheels(axes, **start), []
    for v, omega in commands:
        made.move(Twist(float(v), float(omega)), round(period / made.time_step))
        rows.append((*made.pose, *made.velocity))
    return np.array(rows)


def simulated(world=None, seed=0, goal=FAR, robot=None, **sim):
    """A simulator at the start of a task, and its first observation."""
    simulator = MujocoSimulator(load_settings("sim/mujoco", **sim), robot or shipped("jackal"))
    return simulator, simulator.reset(task(world, goal=goal), np.random.default_rng(seed))


def until_contact(world, command=AHEAD):
    simulator, _ = simulated(world)
    for _ in range(40):
        simulator.step(command)
        if simulator.state.contact:
            break
    return simulator.state


# --- against other engines ----------------------------------------------------------------------------


@EACH_AXES
def test_random_commands_as_in_open_dynamics_engine(axes):
    check_random_commands(driven, axes)


@pytest.mark.parametrize(("axes", "measured"), [("wheel", 3.3), ("world", 4.9)])
def test_acceleration_from_rest(axes, measured):
    phases = np.linspace(0, math.pi, 6, endpoint=False)  # not reported, and it matters
    speed = np.mean([driven([(2, 0)] * 3, axes, phase=phase)[-1, 3] for phase in phases])
    assert speed / 0.3 == pytest.approx(measured, rel=tolerances.GAZEBO_ACCELERATION)


@pytest.mark.parametrize(("axes", "least", "most"), [("wheel", 1.31, 1.35), ("world", 1.08, 1.08)])
def test_steady_turn_rate_per_commanded_one(axes, least, most):
    gain = driven([(0, 1)] * 60, axes)[30:, 5].mean()
    assert least - tolerances.GAZEBO_GAIN <= gain <= most + tolerances.GAZEBO_GAIN


# --- plain mechanics ------------------------------------------------------------------------------------


def test_the_bodies_add_up_to_the_robot_of_the_file():
    made, drivetrain = wheels(), shipped("jackal").drivetrain
    model, data = made._arena.model, made._data
    mass_matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass_matrix)
    mass, x, height = drivetrain.mass, drivetrain.com_x, drivetrain.com_height
    assert model.body_mass.sum() == pytest.approx(mass)
    assert data.subtree_com[0] == pytest.approx([x, 0.0, height], abs=1e-3)
    solid = drivetrain.solid
    about_floor = (
        solid.roll_inertia + mass * height**2,
        solid.pitch_inertia + mass * (x**2 + height**2),
        drivetrain.inertia + mass * x**2,
    )
    assert np.diag(mass_matrix)[3:6] == pytest.approx(about_floor, rel=1e-3)


@EACH_AXES
def test_a_robot_at_rest_stays_there(axes):
    assert np.abs(driven([(0, 0)] * 5, axes)).max() < 1e-4


@EACH_AXES
def test_a_mirrored_command_drives_the_mirrored_way(axes):
    commands = np.random.default_rng(3).uniform((-1, -4), (2, 4), (5, 2))
    one, other = driven(commands, axes), driven(commands * (1, -1), axes)
    np.testing.assert_allclose(one * (1, -1, -1, 1, -1, -1), other, atol=0.02)


def test_the_start_heading_does_not_matter_where_friction_is_fixed_to_the_body():
    commands = np.random.default_rng(4).uniform((-1, -4), (2, 4), (5, 2))
    one, other = driven(commands, "body"), driven(commands, "body", yaw=1.0)
    np.testing.assert_allclose(one[:, 3:], other[:, 3:], atol=1e-3)


def test_the_kernel_equals_one_contact_at_a_time():
    rng = np.random.default_rng(5)
    made = wheels("wheel", yaw=0.4)
    data, (chassis, first_wheel) = made._data, made._first
    data.qvel[:] = rng.normal(size=10)
    mujoco.mj_forward(made._arena.model, data)
    contact, friction, viscosity = data.contact, 0.5, 30.0
    arguments = (contact.pos, contact.geom, contact.efc_address, data.efc_force)
    for axes, name in enumerate(AXES):
        wrenches, expected = np.ones_like(data.xfrc_applied), np.ones_like(data.xfrc_applied)
        expected[chassis + 1 : chassis + 5] = 0.0
        bodies = data.xpos, data.xmat, data.xipos
        assert not apply_friction(
            wrenches, data.qvel, bodies, arguments, made._first, axes, friction, viscosity
        )
        for point, shapes, place in zip(contact.pos, contact.geom, contact.efc_address, strict=True):
            body = chassis + 1 + shapes.max() - first_wheel
            frame, turned = data.xmat[chassis].reshape(3, 3), data.xmat[body].reshape(3, 3)
            sliding = data.qvel[:3] + np.cross(frame @ data.qvel[3:6], point - data.xpos[chassis])
            sliding += np.cross(frame[:, 1] * data.qvel[6 + body - chassis - 1], point - data.xpos[body])
            ahead = np.array([frame[0, 0], frame[1, 0], 0.0]) / math.hypot(frame[0, 0], frame[1, 0])
            along = {"wheel": turned[:, 0], "world": np.array([1.0, 0.0, 0.0]), "body": ahead}[name]
            load = data.efc_force[place] if place >= 0 else 0.0
            for direction in (along, np.cross([0.0, 0.0, 1.0], along)):
                force = np.clip(-viscosity * sliding @ direction, -friction * load, friction * load)
                lever = point - data.xipos[body]
                expected[body] += np.hstack([force * direction, np.cross(lever, force * direction)])
        np.testing.assert_allclose(wrenches, expected, atol=tolerances.KERNEL)


# --- in a world -----------------------------------------------------------------------------------------


def test_a_reset_repeats_the_episode_and_a_copy_goes_on_alike():
    simulator, first = simulated(room())
    commands = [Twist(1.0, 0.3), Twist(0.2, -1.0), Twist(-0.3, 0.0)] * 3
    passed = [(simulator.step(command), simulator.state) for command in commands]
    again = simulator.reset(task(room(), goal=FAR), np.random.default_rng(0))
    np.testing.assert_array_equal(first.scan.ranges, again.scan.ranges)
    for count, (command, (observation, state)) in enumerate(zip(commands, passed, strict=True)):
        if count == 4:
            simulator = copy.deepcopy(simulator)
        repeated = simulator.step(command)
        np.testing.assert_array_equal(repeated.scan.ranges, observation.scan.ranges)
        assert repeated.twist == observation.twist
        assert simulator.state.pose == state.pose


def test_the_front_touches_a_wall():
    state = until_contact(WALL)
    assert state.contact_part == "wheel"  # they stand out by 19 mm
    assert state.pose.x == pytest.approx(1.2 - 0.229, abs=0.01)
    assert state.clearance == 0.0
    assert not state.arrived


def test_the_chassis_touches_what_fits_between_the_wheels():
    assert until_contact(World(circles=np.array([[1.2, 0.0, 0.05]]))).contact_part == "chassis"


def test_wheels_touch_what_is_beside_the_chassis():
    beside = World(segments=np.array([[-2.0, 0.2, 4.0, 0.2]]))
    assert until_contact(beside).contact_part == "wheel"
    clear = World(segments=np.array([[-2.0, 0.22, 4.0, 0.22], [-2.0, -0.22, 4.0, -0.22]]))
    assert not until_contact(clear).contact


@pytest.mark.parametrize("yaw", [0.02, 0.1])
def test_grazing_a_wall_is_a_contact(yaw):
    simulator = MujocoSimulator(load_settings("sim/mujoco"), shipped("jackal"))
    wall = World(segments=np.array([[-1.0, 0.25, 6.0, 0.25]]))
    simulator.reset(task(wall, start=Pose(0.0, 0.0, yaw), goal=FAR), np.random.default_rng(0))
    while not simulator.state.contact and simulator.state.time < 3.0:
        simulator.step(AHEAD)
    assert simulator.state.contact_part == "wheel"


def test_a_start_in_contact_is_reported():
    simulator, _ = simulated(World(segments=np.array([[0.2, -1.0, 0.2, 1.0]])))
    assert simulator.state.contact_part == "chassis"


def test_a_robot_on_its_side_has_fallen():
    simulator, _ = simulated()
    simulator._machine._data.qpos[2:7] = 0.2, math.cos(0.6), math.sin(0.6), 0.0, 0.0
    simulator.step(STOP)
    assert simulator.state.contact_part == FALL


def test_a_person_walks_into_it():
    path = np.array([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    simulator, _ = simulated(World(movers=(Mover(path=path, speed=1.0, radius=0.25),)))
    while not simulator.state.contact and simulator.state.time < 3.0:
        simulator.step(STOP)
    assert simulator.state.contact_part == "chassis"
    assert simulator.state.time == pytest.approx(2.0 - 0.25 - 0.21, abs=0.05)


def test_a_wall_that_appears_is_seen_and_touched():
    simulator, _ = simulated(room())
    for _ in range(6):
        simulator.step(AHEAD)
    before = simulator.state
    observation = simulator.change(task(WALL, goal=FAR))
    assert simulator.state.pose == before.pose
    assert simulator.state.twist.v == pytest.approx(before.twist.v)
    assert observation.scan.ranges.min() == pytest.approx(1.2 - before.pose.x - 0.055, abs=0.01)
    for _ in range(8):
        simulator.step(AHEAD)
    assert simulator.state.contact


def test_it_arrives():
    simulator, _ = simulated(goal=(1.0, 0.0))
    while not simulator.state.arrived and simulator.state.time < 3.0:
        simulator.step(AHEAD)
    assert math.dist(simulator.state.pose[:2], (1.0, 0.0)) <= 0.2


@pytest.mark.parametrize("system", ["world", "wheel"])
def test_lme_drives_it_to_the_goal(system):
    robot = replace(shipped("jackal"), v_max=1.0)
    simulator = MujocoSimulator(load_settings("sim/mujoco", friction=system), robot)
    episode = run_episode(
        task(room(), goal=(1.5, 1.0)), navigator(robot), simulator, np.random.default_rng(0)
    )
    assert episode.outcome is Outcome.SUCCESS


def test_odometry_counts_what_the_wheels_turn():
    simulator, first = simulated(yaw_noise=0.0)
    assert first.odometry == pytest.approx((0.0, 0.0, 0.0))
    for _ in range(5):
        observation = simulator.step(Twist(2.0, 0.0))
    assert observation.twist.v == pytest.approx(2.0)
    assert observation.odometry.x == pytest.approx(1.0 - 2.0 / (2 * 20.0) * 2.0, abs=0.01)  # of the ramp
    assert simulator.state.pose.x < 0.8 * observation.odometry.x  # the wheels have spun


def test_a_delayed_command_takes_effect_later():
    poses = []
    for latency in (0.0, 0.05):
        simulator, _ = simulated(latency=latency)
        simulator.step(AHEAD)
        poses.append(simulator.state.pose.x)
    assert poses[1] < 0.4 * poses[0]


# --- what is refused ----------------------------------------------------------------------------------


def jackal_with(**drivetrain):
    robot = shipped("jackal")
    return replace(robot, drivetrain=replace(robot.drivetrain, **drivetrain))


def test_a_drivetrain_that_lacks_what_three_dimensions_need_is_refused():
    with pytest.raises(InputError, match=r"robot\.drivetrain\.solid is null in robot jackal"):
        simulated(robot=jackal_with(solid=None))
    with pytest.raises(InputError, match=r"robot\.drivetrain\.wheel_base is 0 in robot jackal"):
        simulated(robot=jackal_with(wheel_base=0.0, com_x=0.0))
    with pytest.raises(InputError, match="more than those of its four wheels alone"):
        simulated(robot=jackal_with(mass=1.5))


def test_commands_that_come_too_rarely_are_refused():
    with pytest.raises(InputError, match=r"robot\.control_rate is 2 Hz: must be at least 4"):
        simulated(robot=replace(shipped("jackal"), control_rate=2.0))


def test_an_unknown_frame_of_friction_is_refused():
    with pytest.raises(InputError, match="friction is 'floor': must be one of wheel, world, body"):
        simulated(friction="floor")
