"""Social measures by hand: distances, personal space, heading, whose fault a collision was."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.collision import sweep
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.simulator import State
from lme.simulation.skid.simulator import SkidSimulator
from lme.simulation.social import Company, closing_speeds, distances, without_people
from lme.types import Outcome, Pose, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import CAP, shipped, stage, task
from tests.tolerances import KERNEL

DOOR = Mover(path=np.array([[9.0, 9.0, 0.0]]), outline=np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.1]]))


class Stands:
    """Does not move."""

    def reset(self, rng):
        pass

    def plan(self, observation, guidance):
        return Twist(0.0, 0.0)


FAST = FastSimulator, load_settings("sim/fast"), stage()
PHYSICS = PhysicsSimulator, load_settings("sim/physics"), stage()
SKID = SkidSimulator, load_settings("sim/skid"), shipped("jackal").capped(CAP)


def someone(*path, **rules):
    return Mover(path=np.array(path, dtype=float), **{"radius": 0.25, "speed": 1.0, **rules})


def drive(*movers, planner=None, simulated=FAST, **rules):
    """Outcome and measures of a drive from (0, 0) to (4, 0)."""
    make, config, robot = simulated
    simulator = make(config, robot)
    navigator = Navigator(
        Target(TargetConfig(), robot), planner or Simple(load_settings("planner/simple"), robot)
    )
    company = Company(robot, simulator)
    place = task(World(movers=movers), **{"goal": (4.0, 0.0), "time_limit": 20.0, **rules})
    episode = run_episode(place, navigator, simulator, np.random.default_rng(0), company)
    return episode, company.measures()


def test_someone_who_stands_aside_is_passed_at_a_distance():
    robot = stage()
    episode, found = drive(someone((2.0, 1.5)))
    assert episode.outcome is Outcome.SUCCESS
    assert found.minimum_distance_to_people_m == pytest.approx(
        1.5 - 0.25 - robot.footprint.circumscribed_radius, abs=2e-3
    )
    # Within 1.2 m while |x − 2| < √((1.2 + .25 + r)² − 1.5²).
    reach = math.sqrt((1.45 + robot.footprint.circumscribed_radius) ** 2 - 1.5**2)
    share = 2 * reach / robot.v_max / episode.time
    assert found.personal_space_intrusions == pytest.approx(share, abs=0.05)
    assert found.intimate_space_intrusions == 0.0
    assert found.path_irregularity_rad == pytest.approx(0.0, abs=1e-6)
    assert (found.robot_on_person_collision, found.person_on_robot_collision) == (0.0, 0.0)


def test_personal_space_begins_where_intimate_space_ends():
    _, found = drive(someone((2.0, 0.8)))
    assert found.intimate_space_intrusions > 0.1
    assert found.personal_space_intrusions > 0.1
    assert found.intimate_space_intrusions + found.personal_space_intrusions < 1.0


def test_irregularity_is_the_angle_between_heading_and_goal():
    _, found = drive(planner=Stands(), start=Pose(0.0, 0.0, 0.5), time_limit=2.0)
    assert found.path_irregularity_rad == pytest.approx(0.5, abs=1e-9)


@pytest.mark.parametrize("simulated", [FAST, PHYSICS, SKID])
def test_a_robot_that_is_walked_into_is_not_to_blame(simulated):
    episode, found = drive(someone((3.0, 0.0), (-3.0, 0.0)), planner=Stands(), simulated=simulated)
    assert episode.outcome is Outcome.COLLISION
    assert (found.robot_on_person_collision, found.person_on_robot_collision) == (0.0, 1.0)
    assert found.minimum_distance_to_people_m == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("simulated", [FAST, PHYSICS, SKID])
def test_a_robot_that_drives_into_someone_who_stands_is(simulated):
    episode, found = drive(someone((2.0, 0.05)), simulated=simulated)
    assert episode.outcome is Outcome.COLLISION
    assert (found.robot_on_person_collision, found.person_on_robot_collision) == (1.0, 0.0)


def test_a_wall_is_nobodys_fault():
    robot = stage()
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    company = Company(robot, simulator)
    world = World(segments=np.array([[2.0, -1.0, 2.0, 1.0]]), movers=(someone((0.0, 3.0)),))
    navigator = Navigator(Target(TargetConfig(), robot), Simple(load_settings("planner/simple"), robot))
    episode = run_episode(task(world), navigator, simulator, np.random.default_rng(0), company)
    found = company.measures()
    assert episode.outcome is Outcome.COLLISION
    assert (found.robot_on_person_collision, found.person_on_robot_collision) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("twist", "velocity", "ours", "theirs"),
    [
        ((1.0, 0.0), (-0.4, 0.0), 1.0, 0.4),  # head on
        ((-0.5, 0.0), (-1.0, 0.0), -0.5, 1.0),  # from behind, while it backs up
        ((0.0, 2.0), (0.0, 0.0), 0.0, 0.0),  # turns on the spot under a person straight ahead
    ],
)
def test_closing_speeds_are_along_the_line_of_contact(twist, velocity, ours, theirs):
    state = State(Pose(0.0, 0.0, 0.0), Twist(*twist), 0.0, np.zeros((1, 3)), 0.0, True, False)
    found = closing_speeds(state, (0.2, 0.1, 0.0), np.array([0.45, 0.0, 0.25]), np.array(velocity))
    assert found == pytest.approx((ours, theirs), abs=KERNEL)


def test_a_corner_that_swings_into_someone_closes_the_gap():
    state = State(Pose(0.0, 0.0, 0.0), Twist(0.0, 1.0), 0.0, np.zeros((1, 3)), 0.0, True, False)
    ours, _ = closing_speeds(state, (0.2, 0.1, 0.0), np.array([0.2, 0.4, 0.3]), np.zeros(2))
    assert ours == pytest.approx(0.2, abs=KERNEL)  # ω times the lever of the corner ahead of the middle


NUMBER = st.floats(-3.0, 3.0)


@given(
    st.lists(st.tuples(NUMBER, NUMBER, st.floats(0.1, 0.6)), min_size=1, max_size=4),
    st.tuples(NUMBER, NUMBER, NUMBER),
    st.sampled_from([(0.25, 0.15, 0.0), (0.0, 0.0, 0.3)]),
)
def test_distance_is_the_clearance_that_ends_an_episode(people, pose, box):
    circles = np.array(people)
    found = distances(np.array([pose]), box, circles, np.zeros((len(circles), 2)), 0.0)[0]
    assert found == pytest.approx(sweep(np.array([pose]), box, circles, np.empty((0, 4)))[0], abs=KERNEL)


def test_during_a_motion_people_are_where_they_were_then():
    travel = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    near = distances(travel, (0.0, 0.0, 0.2), np.array([[1.0, 0.0, 0.3]]), np.array([[-1.0, 0.0]]), 0.2)
    assert near == pytest.approx([0.6, 0.5], abs=KERNEL)


def test_alone_doors_stay():
    world = World(segments=np.array([[2.0, -1.0, 2.0, 1.0]]), movers=(DOOR, someone((0.0, 3.0))))
    alone = without_people(task(world))
    assert alone.world.movers == (DOOR,)
    assert (alone.world.edges == world.edges).all()
