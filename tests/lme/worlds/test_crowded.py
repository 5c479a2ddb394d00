"""People in any map set: how many, where, and that worlds keep what they were."""

import numpy as np
import pytest

from lme.config.presets import load_map_set, load_robot, load_settings
from lme.errors import InputError
from lme.simulation.crowd import Crowd
from lme.types import Pose
from lme.worlds.check import check_task, point_clearance
from lme.worlds.crowded import Crowded
from lme.worlds.world import Named

ROBOT = load_robot("jackal")
SETS = [
    ("barn", {"subset": "all"}),
    ("indoor", {}),
    ("traps", {}),
    ("env1", {}),
    ("real1_dynamic", {}),
    ("dynabarn", {}),
]


def crowded(name="barn", settings=None, **keys):
    settings = {"subset": "all"} if name == "barn" and settings is None else settings
    return Crowded(load_settings("crowd/orca", **keys), load_map_set(name, settings, ROBOT))


@pytest.mark.parametrize(("name", "settings"), SETS)
def test_people_stand_where_they_have_room_in_every_kind_of_map(name, settings):
    maps = crowded(name, settings, density=0.1)
    for number in maps.numbers[:3]:
        task, plain = maps.task(number), load_map_set(name, settings, ROBOT).task(number)
        people = [mover for mover in task.world.movers if mover.walks]
        assert people
        places = np.array([mover.path[0, :2] for mover in people])
        assert all(point_clearance(task.world, place) >= 0.25 for place in places)
        assert np.hypot(*(places - task.start[:2]).T).min() >= 2.0
        apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 9 * np.eye(len(places))
        assert apart.min() >= 0.6
        assert (task.start, task.goal.tolist(), task.time_limit) == (
            plain.start,
            plain.goal.tolist(),
            plain.time_limit,
        )
        assert (task.world.edges == plain.world.edges).all()
        assert len(task.world.movers) == len(people) + len(plain.world.movers)
        check_task(task, ROBOT)


def test_their_ways_lead_through_free_space():
    task = crowded("indoor", density=0.05).task(0)
    for mover in task.world.movers:
        legs = zip(mover.path[:, :2], np.roll(mover.path[:, :2], -1, axis=0), strict=True)
        for begin, end in legs:
            for part in np.linspace(0.0, 1.0, 20):
                assert point_clearance(task.world, begin + part * (end - begin)) > 0.2


def test_they_walk_there_and_touch_nothing_that_stands():
    task = crowded("indoor", density=0.05).task(1)
    crowd = Crowd(task.world.movers, task.world, 0.3)
    begin, far = crowd.circles.copy(), Pose(1e3, 0.0, 0.0)
    farthest = np.zeros(len(begin))
    for _ in range(600):
        crowd.advance(far, 0.05)
        farthest = np.maximum(farthest, np.hypot(*(crowd.circles - begin)[:, :2].T))
        for x, y, radius in crowd.circles:
            assert point_clearance(task.world, np.array([x, y])) >= radius - 1e-9
    assert (farthest > 0.5).all()  # they walk to and fro


def test_the_number_is_the_density_times_the_floor_or_as_given():
    sparse, dense = (len(crowded(density=density).task(200).world.movers) for density in (0.05, 0.2))
    assert dense == pytest.approx(4 * sparse, abs=3)
    task = crowded(count=7).task(200)
    assert len(task.world.movers) == task.measures["people"] == 7
    assert task.measures["people_per_m2"] == pytest.approx(0.05 * 7 / sparse, rel=0.4)
    assert len(crowded(density=1e-6).task(200).world.movers) == 1


def test_people_depend_on_seed_and_world_alone():
    def places(worlds, number, **keys):
        return [
            m.path.tolist() for m in crowded("barn", {"worlds": worlds}, **keys).task(number).world.movers
        ]

    assert places([200, 201], 201) == places([201], 201)
    assert places([201], 201) != places([201], 201, crowd_seed=1)
    assert places([200], 200) != places([201], 201)


def test_some_do_not_see_the_robot():
    people = crowded(count=10, sees_robot=0.5, body_radius=0.15).task(200).world.movers
    assert {mover.sees_robot for mover in people} == {True, False}
    assert {mover.radius for mover in people} == {0.15}


def test_it_has_the_name_of_its_base_or_none():
    assert isinstance(crowded("real1_dynamic"), Named)
    assert not isinstance(crowded("barn"), Named)
    assert crowded("real1_dynamic").name == "real1_dynamic"


@pytest.mark.parametrize(
    "keys",
    [
        {"count": 500},
        {"clear": 50.0},
        {"motion": "scripted"},
        {"density": 0.0},
        {"sees_robot": 2.0},
        {"walking_speed": 0.0},
    ],
    ids=str,
)
def test_what_is_not_possible_is_said(keys, says):
    with says.raises(InputError):
        crowded(**keys).task(200)


def test_a_map_with_people_of_its_own_takes_no_more(says):
    with says.raises(InputError):
        crowded("social").task(0)
