"""The rigid-body simulator: held against the kinematic one, and for what only it can do."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.frames import to_world
from lme.navigation.episode import run_episode
from lme.robots import Footprint
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import GRAVITY, PhysicsSimulator
from lme.types import Outcome, Pose, Twist
from lme.worlds.barn.map_set import Barn
from lme.worlds.world import World
from tests.builders import CLUTTER, SHIPPED, navigator, room, shipped, stage, task
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
FAST_AND_PHYSICS = 0.02  # [m] apart on the same commands, without slip
ROUNDING = 1e-6  # [m] of a way turned or mirrored: rounding, summed up
GRAZE = 0.005  # [m] of clearance that one of two ways of stepping along may find to be a contact
DISC, BOX = Footprint(radius=0.2), Footprint(length=0.5, width=0.3)


def physics(world=None, robot=None, **job):
    """A physics simulator at the start of a task, and its first observation."""
    simulator = PhysicsSimulator(load_settings("sim/physics", **job.pop("sim", {})), robot or stage())
    return simulator, simulator.reset(task(world, **job), np.random.default_rng(0))


def fast(world=None, robot=None, **job):
    simulator = FastSimulator(load_settings("sim/fast"), robot or stage())
    simulator.reset(task(world, **job), np.random.default_rng(0))
    return simulator


def commands(seed, robot, count=40):
    rng = np.random.default_rng(seed)
    return [
        Twist(rng.uniform(-1, 1) * robot.v_max, rng.uniform(-1, 1) * robot.omega_max) for _ in range(count)
    ]


def states(simulator, orders):
    """State after each command, up to contact or arrival."""
    passed = []
    for command in orders:
        simulator.step(command)
        passed.append(simulator.state)
        if simulator.state.contact or simulator.state.arrived:
            break
    return passed


# --- held against sim=fast ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHIPPED)
def test_the_same_commands_lead_to_the_same_place_and_odometry(name):
    robot = shipped(name)
    one, (other, _) = fast(robot=robot, goal=(1e3, 0.0)), physics(robot=robot, goal=(1e3, 0.0))
    for command in commands(1, robot, 100):
        kinematic, rigid = one.step(command), other.step(command)
        assert one.state.pose[:2] == pytest.approx(other.state.pose[:2], abs=FAST_AND_PHYSICS)
        assert one.state.pose.yaw == pytest.approx(other.state.pose.yaw, abs=KERNEL)
        assert kinematic.twist == pytest.approx(rigid.twist, abs=KERNEL)
        assert kinematic.odometry[:2] == pytest.approx(rigid.odometry[:2], abs=FAST_AND_PHYSICS)
        assert one.state.time == pytest.approx(other.state.time, abs=KERNEL)


@given(SEEDS)
def test_fast_and_physics_touch_the_same_obstacle_at_the_same_time(seed):
    rng = np.random.default_rng(seed)
    robot = stage(
        footprint=BOX if seed % 2 else DISC, v_max=2.0, alpha_v=20.0, omega_max=4.0, alpha_omega=25.0
    )
    circles = np.column_stack([rng.uniform(-4, 4, (12, 2)), rng.uniform(0.05, 0.4, 12)])
    circles = circles[np.hypot(circles[:, 0], circles[:, 1]) > 0.9]
    corners = np.array([[1.5, 1.5], [2.5, 1.5], [2.5, 2.0], [1.5, 2.0]])
    world = World(circles, room(9.0).segments, (corners, -corners[:, ::-1]))
    orders = [Twist(rng.uniform(-0.5, 2.0), rng.uniform(-4, 4)) for _ in range(60)]
    ends = [states(sim, orders)[-1] for sim in (fast(world, robot), physics(world, robot)[0])]
    if ends[0].contact != ends[1].contact:  # a graze, which either may step over
        assert min(end.clearance for end in ends if not end.contact) < GRAZE
        return
    assert ends[0].arrived == ends[1].arrived
    assert math.dist(ends[0].pose[:2], ends[1].pose[:2]) < 0.1  # a graze may count a moment later in one


def test_lme_fares_the_same_in_fresh_barn_worlds():
    robot = shipped("jackal")
    maps = Barn(load_settings("map/barn", subset="fresh", count=6, fresh_seed=11))
    drives = []
    for simulator in (
        FastSimulator(load_settings("sim/fast"), robot),
        PhysicsSimulator(load_settings("sim/physics"), robot),
    ):
        driver = navigator(robot)
        drives.append(
            [run_episode(maps.task(n), driver, simulator, np.random.default_rng(n)) for n in maps.numbers]
        )
    successes = [sum(drive.outcome == Outcome.SUCCESS for drive in each) for each in drives]
    assert min(successes) >= 5


def test_the_first_scan_is_the_same_to_the_bit():
    robot = shipped("jackal")
    scans = [
        simulator.reset(task(CLUTTER), np.random.default_rng(3)).scan.ranges
        for simulator in (
            FastSimulator(load_settings("sim/fast"), robot),
            PhysicsSimulator(load_settings("sim/physics"), robot),
        )
    ]
    np.testing.assert_array_equal(*scans)


# --- contact ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("footprint", [DISC, BOX])
@pytest.mark.parametrize("gap", [0.003, -0.003])
def test_the_robot_hits_what_its_footprint_reaches_and_passes_the_rest(footprint, gap):
    half_width = sum(footprint.box[1:])
    robot = stage(footprint=footprint)
    low = half_width + gap
    solids = {
        "circle": World(circles=np.array([[1.5, low + 0.3, 0.3]])),
        "segment": World(segments=np.array([[1.0, low, 2.0, low + 0.5]])),
        "convex": World(polygons=(np.array([[1, low], [2, low], [1.5, low + 1]]),)),
        "hollow": World(polygons=(np.array([[1, low], [1.5, low + 0.5], [2, low], [1.5, low + 1]]),)),
    }
    for name, world in solids.items():
        last = states(physics(world, robot)[0], [Twist(0.5, 0.0)] * 60)[-1]
        assert last.contact == (gap < 0), name
        assert last.arrived == (gap > 0), name


def test_a_hollow_is_not_filled():
    # A U around the robot: its hull would hold it.
    u = np.array([[-1, -1], [3, -1], [3, -0.8], [-0.8, -0.8], [-0.8, 0.8], [3, 0.8], [3, 1], [-1, 1.0]])
    assert not physics(World(polygons=(u,)))[0].state.contact
    assert states(physics(World(polygons=(u,)))[0], [Twist(0.5, 0.0)] * 60)[-1].arrived


def test_contact_cuts_the_period_and_a_start_in_contact_is_seen_at_once():
    # Disc of 0.2 m, wall at 0.55: contact after 0.35 m.
    simulator, _ = physics(World(segments=np.array([[0.55, -1.0, 0.55, 1.0]])))
    last = states(simulator, [Twist(0.5, 0.0)] * 10)[-1]
    assert last.contact
    assert last.clearance == 0.0
    assert last.pose.x == pytest.approx(0.35, abs=0.006)
    assert last.time == pytest.approx(0.35 / 0.5 + 0.125, abs=0.02)  # 0.125 s lost to 2 m/s² from rest
    assert last.travel[-1].tolist() == list(last.pose)
    assert physics(World(circles=np.array([[0.3, 0.0, 0.2]])))[0].state.contact


def test_a_wall_holds_whoever_drives_on_and_lets_go_whoever_turns_back():
    simulator, _ = physics(World(segments=np.array([[0.55, -2.0, 0.55, 2.0]])))
    for _ in range(100):
        simulator.step(Twist(0.5, 0.0))
    assert simulator.state.contact
    assert simulator.state.pose.x < 0.40
    for _ in range(60):
        simulator.step(Twist(-0.5, 0.0))
    assert not simulator.state.contact
    assert simulator.state.pose.x < 0.2


def test_arrival_cuts_the_period():
    simulator, _ = physics(goal=(0.55, 0.0))
    last = states(simulator, [Twist(0.5, 0.0)] * 10)[-1]
    assert last.arrived
    assert last.pose.x == pytest.approx(0.35, abs=0.006)


# --- forces -------------------------------------------------------------------------------------------


def test_tyres_that_break_loose_brake_and_turn_no_harder_than_they_grip():
    robot = shipped("jackal")
    simulator, _ = physics(robot=robot, goal=(1e3, 0.0), sim={"grip": 0.4})
    before = Twist(0.0, 0.0)
    for command in commands(2, robot, 60):
        simulator.step(command)
        assert abs(simulator.state.twist.v - before.v) <= 1.5 * 0.4 * GRAVITY * robot.dt + KERNEL
        before = simulator.state.twist
    straight, _ = physics(robot=robot, goal=(1e3, 0.0), sim={"grip": 0.4})
    straight.step(Twist(2.0, 0.0))
    assert straight.state.twist.v == pytest.approx(0.4 * GRAVITY * 0.1, abs=1e-6)


def test_slipping_tyres_mislead_odometry():
    robot = shipped("jackal")
    simulator, seen = physics(robot=robot, goal=(1e3, 0.0), sim={"grip": 0.3})
    for _ in range(5):
        seen = simulator.step(Twist(2.0, 0.0))
    assert seen.twist.v == pytest.approx(2.0, abs=KERNEL)
    assert seen.odometry.x > simulator.state.pose.x + 0.1


def test_grip_beyond_need_changes_nothing():
    robot = stage()
    plain, (grips, _) = physics(robot=robot)[0], physics(robot=robot, sim={"grip": 5.0})
    orders = commands(4, robot)
    assert [s.pose for s in states(plain, orders)] == [s.pose for s in states(grips, orders)]


# --- symmetry -----------------------------------------------------------------------------------------


@settings(max_examples=15)
@given(SEEDS, st.floats(-math.pi, math.pi))
def test_a_turned_and_moved_scene_leads_to_a_turned_and_moved_way(seed, angle):
    frame = Pose(3.0, -2.0, angle)
    ends = to_world(CLUTTER.segments.reshape(-1, 2), frame).reshape(-1, 4)
    circles = np.column_stack([to_world(CLUTTER.circles[:, :2], frame), CLUTTER.circles[:, 2]])
    goal = to_world(np.array([4.0, 0.0]), frame)
    here, _ = physics(CLUTTER, stage(footprint=BOX))
    there, _ = physics(World(circles, ends), stage(footprint=BOX), start=frame, goal=goal)
    orders = [Twist(abs(v), omega) for v, omega in commands(seed, stage(), 25)]
    one, other = states(here, orders), states(there, orders)
    assert [s.contact for s in one] == [s.contact for s in other]
    for a, b in zip(one, other, strict=True):
        assert to_world(np.array(a.pose[:2]), frame) == pytest.approx(b.pose[:2], abs=ROUNDING)
        assert a.clearance == pytest.approx(b.clearance, abs=ROUNDING)


@settings(max_examples=15)
@given(SEEDS)
def test_a_mirrored_scene_leads_to_a_mirrored_way(seed):
    flip = World(CLUTTER.circles * [1, -1, 1], CLUTTER.segments * [1, -1, 1, -1])
    orders = [Twist(abs(v), omega) for v, omega in commands(seed, stage(), 25)]
    one = states(physics(CLUTTER, stage(footprint=BOX))[0], orders)
    other = states(
        physics(flip, stage(footprint=BOX))[0], [command._replace(omega=-command.omega) for command in orders]
    )
    for a, b in zip(one, other, strict=True):
        assert np.array(a.pose) * [1, -1, -1] == pytest.approx(np.array(b.pose), abs=ROUNDING)
        assert a.contact == b.contact
