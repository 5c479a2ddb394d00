"""People who walk: where they go, what they walk around, and that nothing about it is random."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.simulation.crowd import Crowd
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.types import Pose, Twist
from lme.worlds.movers import ORCA, SOCIAL_FORCE, Mover
from lme.worlds.world import World
from tests.builders import CAP, shipped, stage, task

FAR = Pose(1e3, 0.0, 0.0)
BOTH = pytest.mark.parametrize("motion", [ORCA, SOCIAL_FORCE])


def person(*path, **changes):
    return Mover(
        path=np.array(path, dtype=float), **{"radius": 0.25, "speed": 1.2, "motion": ORCA, **changes}
    )


def walk(crowd, seconds, robot=FAR, dt=0.01):
    """The places (K, P, 2) of the people at every step."""
    places = []
    for _ in range(round(seconds / dt)):
        crowd.advance(robot, dt)
        places.append(crowd.circles[:, :2].copy())
    return np.array(places)


@BOTH
def test_a_person_walks_to_the_end_of_the_path_and_stays(motion):
    places = walk(Crowd([person((0, 0), (3, 0), (3, 3), motion=motion)]), 9.0)
    assert places[-1, 0] == pytest.approx([3.0, 3.0], abs=0.05)
    assert places[-100, 0] == pytest.approx(places[-1, 0], abs=0.05)


@BOTH
def test_nobody_moves_before_the_start(motion):
    crowd = Crowd([person((0, 0), (3, 0), motion=motion, start_after=1.0)])
    assert np.abs(walk(crowd, 1.0)).max() == 0.0
    assert walk(crowd, 1.0)[-1, 0, 0] > 0.3


@pytest.mark.parametrize("repeat", ["back_and_forth", "cycle"])
def test_who_repeats_comes_back(repeat):
    x = walk(Crowd([person((0, 0), (3, 0), repeat=repeat)]), 12.0)[:, 0, 0]
    assert x.max() > 2.5
    assert x[x.argmax() :].min() < 0.5


@pytest.mark.parametrize(("motion", "least"), [(ORCA, 0.59), (SOCIAL_FORCE, 0.3)])
def test_two_who_meet_walk_around_each_other(motion, least):
    pair = [person((0, 0), (6, 0), motion=motion), person((6, 0.1), (0, 0.1), motion=motion)]
    places = walk(Crowd(pair), 9.0)
    assert np.hypot(*(places[:, 0] - places[:, 1]).T).min() > least
    assert places[-1] == pytest.approx(np.array([[6, 0], [0, 0.1]]), abs=0.1)


@BOTH
def test_nobody_enters_a_wall_or_a_pillar(motion):
    world = World(circles=np.array([[2.0, 0.05, 0.3]]), segments=np.array([[4.0, -1.0, 4.0, 1.0]]))
    places = walk(Crowd([person((0, 0), (6, 0), motion=motion)], world), 9.0)[:, 0]
    assert (np.hypot(*(places - [2.0, 0.05]).T) > 0.55 - 1e-9).all()
    assert places[:, 0].max() <= 3.75 + 1e-9  # the wall is never entered; nobody plans a way around it here


@BOTH
def test_only_who_sees_the_robot_walks_around_it(motion):
    robot = Pose(3.0, 0.05, 0.0)

    def nearest(sees_robot):
        crowd = Crowd([person((0, 0), (6, 0), motion=motion, sees_robot=sees_robot)], None, 0.3)
        return np.hypot(*(walk(crowd, 9.0, robot)[:, 0] - robot[:2]).T).min()

    assert nearest(True) > 0.45
    assert nearest(False) < 0.06


def test_a_scripted_disc_is_walked_around():
    block = Mover(path=np.array([[3.0, 0.05]]), radius=0.4)
    places = walk(Crowd([block, person((0, 0), (6, 0))]), 9.0)
    assert np.hypot(*(places[:, 1] - places[:, 0]).T).min() > 0.64
    assert places[-1, 1] == pytest.approx([6.0, 0.0], abs=0.05)


def test_who_cannot_get_on_turns_round():
    """Two who meet in a corridor too narrow for both do not stand there for ever."""
    corridor = World(segments=np.array([[-1.0, -0.4, 9.0, -0.4], [-1.0, 0.4, 9.0, 0.4]]))
    pair = [person((0, 0), (8, 0)), person((8, 0), (0, 0))]
    x = walk(Crowd(pair, corridor), 20.0)[:, :, 0]
    assert np.abs(np.diff(x[-500:], axis=0)).max() > 1e-3  # some still walk
    assert (np.diff(x[:, 0]) < -1e-3).any()


@BOTH
def test_motion_is_the_same_every_time_and_for_every_length_of_a_step_of_the_robot(motion):
    rng = np.random.default_rng(0)
    people = [person(*rng.uniform(0, 5, (3, 2)), motion=motion, repeat="cycle") for _ in range(6)]
    one, other = walk(Crowd(people), 5.0), walk(Crowd(people), 5.0)
    assert (one == other).all()
    assert walk(Crowd(people), 5.0, dt=0.05)[-1] == pytest.approx(one[-1], abs=1e-6)


def test_a_scene_turned_by_a_right_angle_goes_the_same_way():
    rng = np.random.default_rng(1)
    paths = rng.uniform(0, 4, (5, 2, 2))
    turned = np.stack([-paths[..., 1], paths[..., 0]], axis=-1)
    for motion in (ORCA, SOCIAL_FORCE):
        one = walk(Crowd([person(*path, motion=motion) for path in paths]), 3.0)
        other = walk(Crowd([person(*path, motion=motion) for path in turned]), 3.0)
        assert other == pytest.approx(np.stack([-one[..., 1], one[..., 0]], axis=-1), abs=1e-6)


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
def test_people_walk_around_the_robot_of_every_simulator(simulator, robot):
    world = World(movers=(person((3.0, 0.1), (-3.0, 0.1)),))
    simulator.reset(task(world, goal=(9.0, 9.0)), np.random.default_rng(0))
    for _ in range(round(8.0 / robot.dt)):
        simulator.step(Twist(0.0, 0.0))
        assert not simulator.state.contact
    circles, velocities = simulator.people
    assert circles[0, :2] == pytest.approx([-3.0, 0.1], abs=0.1)
    assert np.hypot(*velocities[0]) < 0.2


def test_who_is_recorded_is_there_only_between_the_first_and_the_last_time():
    track = Mover(
        path=np.array([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0]]), radius=0.2, times=np.array([1.0, 2.0, 3.0])
    )
    crowd = Crowd([track])
    seen = {}
    for step in range(1, 41):
        crowd.advance(FAR, 0.1)
        seen[step] = [round(float(x), 6) for x in crowd.circles[:, 0]]
    assert (seen[9], seen[40]) == ([], [])
    assert (seen[15], seen[25], seen[29]) == ([0.5], [2.0], [2.8])
    assert crowd.top_speed == pytest.approx(2.0)


def test_the_robot_drives_through_where_a_recorded_person_was():
    track = Mover(path=np.array([[2.0, 0.0], [2.0, 0.1]]), radius=0.4, times=np.array([0.0, 0.5]))
    for simulator in (
        FastSimulator(load_settings("sim/fast"), stage()),
        PhysicsSimulator(load_settings("sim/physics"), stage()),
    ):
        simulator.reset(task(World(movers=(track,)), goal=(4.0, 0.0)), np.random.default_rng(0))
        while not (simulator.state.contact or simulator.state.arrived):
            simulator.step(Twist(0.5, 0.0))
        assert simulator.state.arrived


@pytest.mark.parametrize(
    "changes",
    [
        {"motion": "fly"},
        {"radius": None, "outline": np.eye(3, 2)},
        {"starts_within": 1.0},
        {"motion": "scripted", "times": np.array([0.0, math.nan])},
        {"motion": "scripted", "times": np.array([1.0])},
    ],
)
def test_a_wrong_mover_is_named(changes, says):
    with says.raises(InputError):
        person((0, 0), (1, 0), **changes)
