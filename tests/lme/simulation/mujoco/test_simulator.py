"""A Go2 that walks in a world: what ends an episode, what the robot reports, and what is repeated exactly."""

import copy
import math
import sys

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import relative
from lme.navigation.episode import run_episode
from lme.perception.raycast import cast_shapes
from lme.simulation.mujoco.simulator import MujocoSimulator
from lme.simulation.simulator import FALL
from lme.types import Outcome, Pose, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import navigator, room, shipped, stage, task

pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
pytest.importorskip("onnxruntime", reason="the policy of sim=mujoco needs onnxruntime")

FAR = (50.0, 0.0)
AHEAD, STOP = Twist(0.5, 0.0), Twist(0.0, 0.0)
WALL = World(segments=np.array([[1.2, -2.0, 1.2, 2.0]]))


def walking(world=None, seed=0, goal=FAR, **sim):
    """A simulator at the start of a task, and its first observation."""
    simulator = MujocoSimulator(load_settings("sim/mujoco", **sim), shipped("go2"))
    return simulator, simulator.reset(task(world, goal=goal), np.random.default_rng(seed))


def observations(simulator, command, count):
    return [simulator.step(command) for _ in range(count)]


def until_contact(world):
    simulator, _ = walking(world)
    for _ in range(60):
        simulator.step(AHEAD)
        if simulator.state.contact:
            break
    return simulator.state


# --- the same again -----------------------------------------------------------------------------------


def test_a_reset_repeats_the_episode():
    simulator, first = walking(room())
    commands = [Twist(0.5, 0.3), Twist(0.2, -1.0), Twist(-0.3, 0.0)] * 3
    passed = [(simulator.step(command), simulator.state) for command in commands]
    again = simulator.reset(task(room(), goal=FAR), np.random.default_rng(0))
    np.testing.assert_array_equal(first.scan.ranges, again.scan.ranges)
    for command, (observation, state) in zip(commands, passed, strict=True):
        repeated = simulator.step(command)
        np.testing.assert_array_equal(repeated.scan.ranges, observation.scan.ranges)
        assert repeated.twist == observation.twist
        assert simulator.state.pose == state.pose


def test_a_copy_goes_on_alike():
    simulator, _ = walking(room())
    observations(simulator, AHEAD, 4)
    other = copy.deepcopy(simulator)
    for _ in range(4):
        np.testing.assert_array_equal(simulator.step(AHEAD).scan.ranges, other.step(AHEAD).scan.ranges)
    assert simulator.state.pose == other.state.pose


# --- contact, fall and arrival ------------------------------------------------------------------------


def test_a_wall_is_touched_by_the_front():
    state = until_contact(WALL)
    assert state.contact_part in ("trunk", "foot", "calf")
    assert 0.6 < state.pose.x < 1.0
    assert state.clearance == 0.0
    assert not state.arrived


def test_feet_touch_what_is_beside_the_trunk():
    corridor = World(segments=np.array([[-2.0, 0.2, 4.0, 0.2], [-2.0, -0.2, 4.0, -0.2]]))
    assert until_contact(corridor).contact_part == "foot"


def test_nothing_is_touched_in_the_open():
    simulator, _ = walking(room())
    observations(simulator, STOP, 10)
    assert not simulator.state.contact
    assert simulator.state.contact_part == ""
    assert simulator.state.clearance > 4.0


def test_a_start_in_contact_is_reported():
    simulator, _ = walking(World(segments=np.array([[0.25, -1.0, 0.25, 1.0]])))
    assert simulator.state.contact
    assert simulator.state.contact_part == "trunk"


def test_a_fall_is_a_contact():
    simulator, _ = walking()
    simulator._machine._walker.data.qpos[3:7] = math.cos(0.6), math.sin(0.6), 0.0, 0.0  # on its side
    simulator.step(STOP)
    assert simulator.state.contact
    assert simulator.state.contact_part == FALL


def test_it_arrives():
    simulator, _ = walking(goal=(0.6, 0.0))
    observations(simulator, AHEAD, 9)
    assert simulator.state.arrived
    assert math.dist(simulator.state.pose[:2], (0.6, 0.0)) <= 0.2


def test_lme_drives_it_to_the_goal():
    robot = shipped("go2")
    simulator = MujocoSimulator(load_settings("sim/mujoco"), robot)
    episode = run_episode(
        task(room(), goal=(1.5, 1.0)), navigator(robot), simulator, np.random.default_rng(0)
    )
    assert episode.outcome is Outcome.SUCCESS
    assert 2.0 < episode.time < 15.0


# --- what the robot reports ---------------------------------------------------------------------------


def test_the_measured_twist_and_the_odometry_are_those_of_the_motion():
    simulator, first = walking()
    assert first.twist == Twist(0.0, 0.0)
    seen = observations(simulator, AHEAD, 24)
    assert np.mean([observation.twist.v for observation in seen[8:]]) == pytest.approx(0.5, abs=0.06)
    assert seen[-1].odometry == pytest.approx(relative(simulator.state.pose, Pose(0.0, 0.0, 0.0)), abs=1e-9)
    assert seen[-1].target == pytest.approx(relative(Pose(*FAR, 0.0), simulator.state.pose)[:2], abs=1e-9)


def test_the_command_is_reported_as_the_limits_allow_it():
    simulator, _ = walking(twist="command")
    seen = observations(simulator, Twist(5.0, 0.0), 8)
    assert [observation.twist.v for observation in seen[:2]] == pytest.approx([0.125, 0.25])  # 1 m/s² at 8 Hz
    assert seen[-1].twist == (0.66, 0.0)
    assert seen[-1].last_command == seen[-1].twist


def test_no_twist_is_reported():
    simulator, _ = walking(twist="zero")
    assert all(observation.twist == (0.0, 0.0) for observation in observations(simulator, AHEAD, 8))
    assert simulator.state.twist.v > 0.2


def errors(registered):
    """Ranges minus true ones while it walks in a room: (24, beams), not finite where nothing is returned."""
    simulator, _ = walking(room(16.0), registered=registered)
    lidar = shipped("go2").lidar
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    rows = []
    for _ in range(24):
        ranges = simulator.step(AHEAD).scan.ranges
        rows.append(ranges - cast_shapes(simulator.state.pose, angles, lidar.range_max, *simulator.obstacles))
    return np.array(rows)


def test_a_registered_cloud_is_level_and_another_sees_the_floor():
    level, tilted = errors(registered=True), errors(registered=False)
    # Bins of a degree along walls that graze, and noise.
    assert np.abs(level[np.isfinite(level)]).max() < 0.5
    assert np.isfinite(level).mean() > 0.97
    assert (tilted < -2.0).mean() > 0.05


# --- movers and other tasks ---------------------------------------------------------------------------


def test_a_person_walks_into_it():
    path = np.array([[2.0, 0.0, 0.0], [-2.0, 0.0, 0.0]])
    simulator, _ = walking(World(movers=(Mover(path=path, speed=1.0, radius=0.25),)))
    for _ in range(24):
        simulator.step(STOP)
        if simulator.state.contact:
            break
    assert simulator.state.contact_part
    assert simulator.state.time == pytest.approx(
        1.4, abs=0.3
    )  # .36 m from nose to middle, .25 m of the person


def test_a_wall_that_appears_is_touched_and_seen():
    simulator, _ = walking(room())
    observations(simulator, AHEAD, 4)
    before = simulator.state.pose
    observation = simulator.change(task(WALL, goal=FAR))
    assert simulator.state.pose == before
    assert np.nanmin(observation.scan.ranges) == pytest.approx(1.2 - before.x, abs=0.1)
    observations(simulator, AHEAD, 16)
    assert simulator.state.contact


# --- what is refused ----------------------------------------------------------------------------------


def test_a_robot_without_a_cloud_is_refused():
    with pytest.raises(InputError, match=r"robot\.lidar\.cloud is null in robot stage"):
        MujocoSimulator(load_settings("sim/mujoco"), stage())


def test_a_second_gait_is_refused():
    with pytest.raises(InputError, match=r"ripple_v is 0\.1: must be 0 in sim=mujoco"):
        walking(ripple_v=0.1)


def test_an_unknown_twist_is_refused():
    with pytest.raises(InputError, match="twist is 'none': must be one of measured, command, zero"):
        walking(twist="none")


def test_without_mujoco_a_line_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(InputError, match="sim=mujoco needs MuJoCo: pip install"):
        MujocoSimulator(load_settings("sim/mujoco"), shipped("go2"))
