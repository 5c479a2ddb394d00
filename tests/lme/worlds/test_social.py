"""Scenes with people: their geometry, who is in them, and that they happen as named."""

import math

import numpy as np
import pytest

from lme.config.presets import load_map_set, load_robot
from lme.errors import InputError
from lme.simulation.crowd import Crowd
from lme.types import Pose
from lme.worlds.check import check_task, point_clearance
from lme.worlds.social import SCENES

ROBOT = load_robot("jackal")
KINDS = pytest.mark.parametrize("kind", SCENES)
FAR = Pose(1e3, 0.0, 0.0)


def scenes(kind, **settings):
    return load_map_set("social", {"kind": kind, **settings}, ROBOT)


def tracks(task, seconds):
    """Places (K, P, 2) of the people every .1 s."""
    crowd, places = Crowd(task.world.movers, task.world, 0.3), []
    for _ in range(round(10 * seconds)):
        crowd.advance(FAR, 0.1)
        places.append(crowd.circles[:, :2].copy())
    return np.array(places)


@KINDS
def test_every_scene_can_be_driven_and_nobody_is_too_near(kind):
    maps = scenes(kind)
    assert len(maps.numbers) == 20
    for number in maps.numbers:
        task = maps.task(number)
        check_task(task, ROBOT)
        assert task.map_name == f"social_{kind}"
        people = np.array([mover.path[0, :2] for mover in task.world.movers])
        assert len(people) == SCENES[kind].people == task.measures["people"]
        assert all(point_clearance(task.world, place) > 0.25 for place in people)
        assert np.hypot(*(people - task.start[:2]).T).min() >= 1.5


@KINDS
def test_worlds_differ_and_depend_on_number_and_seed_alone(kind):
    def people(number, **settings):
        return [mover.path.tolist() for mover in scenes(kind, **settings).task(number).world.movers]

    assert people(3) == people(3, worlds=[3])
    assert people(3) != people(4)
    assert people(3) != people(3, scene_seed=1)


@KINDS
@pytest.mark.parametrize("density", [0.05, 0.1, 0.2])
def test_density_is_people_per_area_of_the_floor(kind, density):
    task = scenes(kind, density=density).task(0)
    assert len(task.world.movers) == round(density * math.prod(SCENES[kind].size))
    assert task.measures["people_per_m2"] == pytest.approx(density, rel=0.3)


def test_people_cross_the_robots_way():
    places = tracks(scenes("crossing").task(0), 12.0)
    y = places[:, :, 1]
    assert ((y.min(axis=0) < 3.0) & (y.max(axis=0) > 5.0)).all()


def test_people_ahead_are_slow_and_go_past_the_goal():
    task = scenes("overtaking").task(0)
    steps = np.diff(tracks(task, 5.0)[:, :, 0], axis=0) / 0.1
    assert (0.35 < steps.mean(axis=0)).all()
    assert (steps.mean(axis=0) < 0.75).all()
    assert (tracks(task, 50.0)[-1, :, 0] > task.goal[0]).all()


def test_people_come_through_the_door_from_both_sides():
    task = scenes("doorway").task(0)
    begin = np.array([mover.path[0, 0] for mover in task.world.movers])
    assert sorted(begin < 6.0) == [False, True]
    x = tracks(task, 15.0)[:, :, 0]
    assert ((x.min(axis=0) < 5.5) & (x.max(axis=0) > 6.5)).all()


def test_people_in_the_corridor_come_towards_the_robot():
    x = tracks(scenes("corridor").task(0), 4.0)[:, :, 0]
    assert (x[-1] < x[0] - 2.0).all()


@pytest.mark.parametrize("kind", ["group", "queue"])
def test_who_talks_or_waits_stays_there(kind):
    task = scenes(kind).task(0)
    places = tracks(task, 10.0)
    assert np.hypot(*(places[-1] - [mover.path[0, :2] for mover in task.world.movers]).T).max() < 0.3


def test_a_group_is_a_circle_and_a_queue_a_line_across_the_way():
    group = np.array([mover.path[0, :2] for mover in scenes("group").task(0).world.movers])
    assert np.hypot(*(group - group.mean(axis=0)).T) == pytest.approx(0.75)
    task = scenes("queue").task(0)
    queue = np.array([mover.path[0, :2] for mover in task.world.movers])
    assert np.ptp(queue[:, 0]) < 0.2
    assert queue[:, 1].min() < task.goal[1] < queue[:, 1].max()


def test_motion_and_other_traits_are_those_of_the_config():
    people = scenes("crossing", motion="social_force", sees_robot=0.0, body_radius=0.3).task(0).world.movers
    assert {(one.motion, one.sees_robot, one.radius) for one in people} == {("social_force", False, 0.3)}


@pytest.mark.parametrize(
    "settings",
    [
        {"kind": "lift"},
        {"kind": "doorway", "density": 3.9},
        {"kind": "queue", "density": 1.0},
        {"motion": "scripted"},
        {"density": -1.0},
    ],
    ids=str,
)
def test_what_is_not_possible_is_said(settings, says):
    with says.raises(InputError):
        load_map_set("social", settings, ROBOT).task(0)
