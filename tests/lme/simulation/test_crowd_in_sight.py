"""The people that a robot's tracker reports."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.robots import Lidar
from lme.simulation.crowd import discs_in_sight
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.types import Pose, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests import oracles
from tests.builders import CAP, observation, shipped, stage, task
from tests.tolerances import KERNEL

STAY = Twist(0.0, 0.0)
DOOR = Mover(path=np.array([[1.0, 1.0, 0.0]]), outline=np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.1]]))
WALL = World(segments=np.array([[2.0, -1.0, 2.0, 1.0]]))


def walker(*path, **rules):
    return Mover(path=np.array(path, dtype=float), radius=0.3, **rules)


def seen(*movers, start=Pose(0.0, 0.0, 0.0), steps=1, world=WALL, robot=None, simulator=None):  # noqa: B008
    """The pedestrians after some steps of a robot at rest."""
    simulator = simulator or FastSimulator(load_settings("sim/fast"), robot or stage())
    world = World(circles=world.circles, segments=world.segments, movers=movers)
    found = simulator.reset(task(world, start=start, goal=(9.0, 9.0)), np.random.default_rng(0))
    for _ in range(steps):
        found = simulator.step(STAY)
    return found.pedestrians


def test_without_movers_there_are_no_pedestrians():
    for pedestrians in (observation().pedestrians, seen(), seen(DOOR)):
        assert pedestrians.shape == (0, 4)


@pytest.mark.parametrize(
    ("simulator", "robot"),
    [
        (FastSimulator(load_settings("sim/fast"), stage()), stage()),
        (PhysicsSimulator(load_settings("sim/physics"), stage()), stage()),
        (
            SkidSimulator(load_settings("sim/skid"), shipped("jackal").capped(CAP)),
            shipped("jackal").capped(CAP),
        ),
    ],
    ids=["fast", "physics", "skid"],
)
def test_every_simulator_reports_positions_and_velocities_in_the_robot_frame(simulator, robot):
    start, seconds = Pose(1.0, -1.0, math.pi / 2), 4 * robot.dt
    people = walker((1.0, 2.0), (1.0, 9.0), speed=0.5), walker((-1.0, -1.0), speed=2.0)
    found = seen(*people, start=start, steps=4, simulator=simulator)
    ahead, left = [3.0 + 0.5 * seconds, 0.0, 0.5, 0.0], [0.0, 2.0, 0.0, 0.0]
    assert found == pytest.approx(np.array([ahead, left]), abs=1e-6)


def test_nobody_has_walked_before_the_first_step():
    assert seen(walker((1.0, 1.0), (9.0, 1.0)), steps=0)[0] == pytest.approx([1.0, 1.0, 0.0, 0.0])


def test_who_waits_or_has_arrived_stands_still():
    waits = walker((1.5, 0.0), (0.0, 0.0), waits_within=2.0)
    arrived = walker((0.0, 3.0), (0.0, 3.1), speed=1.0)
    assert seen(waits, arrived, steps=5)[:, 2:] == pytest.approx(np.zeros((2, 2)), abs=KERNEL)


def test_a_wall_hides_people_and_so_do_others():
    near, behind_near = walker((0.0, 1.5)), walker((0.0, 3.0))
    before_wall, behind_wall, beside_wall = walker((1.5, 0.0)), walker((3.0, 0.0)), walker((2.0, 2.0))
    found = seen(near, behind_near, before_wall, behind_wall, beside_wall)
    assert found[:, :2] == pytest.approx(np.array([[0.0, 1.5], [1.5, 0.0], [2.0, 2.0]]))


def test_only_pedestrians_in_view_and_range_are_seen():
    lidar = Lidar(num_beams=270, fov=math.radians(270.0), range_min=0.02, range_max=5.0, x=0.1)
    robot = stage(lidar=lidar)
    behind, right_behind, far, near_enough = (
        walker(at) for at in ((-2.0, 0.0), (-0.9, -1.1), (0.0, 5.4), (0.0, -5.2))
    )
    found = seen(behind, right_behind, far, near_enough, robot=robot, world=World())
    assert found[:, :2] == pytest.approx(np.array([[-0.9, -1.1], [0.0, -5.2]]))


def test_the_first_and_the_last_direction_of_a_full_turn_are_seen():
    people = [walker((2 * math.cos(angle), 2 * math.sin(angle))) for angle in (math.pi, -3.14, 3.14)]
    for person in people:
        assert len(seen(person)) == 1


@given(st.integers(0, 2**32 - 1))
def test_the_discs_in_sight_are_those_found_by_looking_at_every_beam(seed):
    rng = np.random.default_rng(seed)
    num_beams, fov = int(rng.integers(1, 80)), rng.choice([1.0, 4.0, math.tau])
    angles = (rng.uniform(-4, 4), fov / num_beams)
    ranges = rng.choice([1.0, 2.0, 3.0, 0.01, np.nan, np.inf], num_beams).astype(np.float32)
    discs = np.column_stack((rng.uniform(-4, 4, (12, 2)), rng.uniform(0.1, 0.5, 12)))
    lidar, base = (tuple(rng.uniform(-1, 1, 3)) for _ in range(2))
    given = (discs, rng.normal(size=(12, 2)), ranges, angles, (0.1, 3.5, 0.1), lidar, base)
    assert discs_in_sight(*given) == pytest.approx(oracles.discs_in_sight(*given), abs=KERNEL)


def test_discs_in_sight_is_compiled_once():
    seen(walker((1.0, 2.0)))  # also if no other test has run
    assert len(discs_in_sight.signatures) == 1
