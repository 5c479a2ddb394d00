"""Generated buildings as a map set."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.tangent_bug.guide import TangentBug
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Outcome
from lme.worlds.check import check_task, point_clearance
from lme.worlds.indoor import Indoor
from lme.worlds.indoor.map_set import KINDS
from tests.builders import SHIPPED, shipped, stage
from tests.tolerances import KERNEL


def indoor(**keys):
    return Indoor(load_settings("map/indoor", **keys))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SHIPPED)
def test_every_robot_can_begin_and_a_way_exists(kind, name):
    robot = shipped(name)
    radius = robot.footprint.circumscribed_radius
    chosen = indoor(kind=kind, radius=radius)
    assert chosen.numbers == tuple(range(100))
    for number in (0, 99):
        task = chosen.task(number)
        check_task(task, robot)
        assert task.map_name == f"indoor_{kind}"
        assert 6.0 - KERNEL <= task.measures["straight_m"] <= 18.0
        assert 1.0 - KERNEL <= task.measures["detour"] < 6.0
        assert task.optimal_time == task.shortest_path_length / 0.5
        for place in (np.array(task.start[:2]), task.goal):
            assert point_clearance(task.world, place) >= radius + 0.1 - KERNEL


@pytest.mark.parametrize("kind", KINDS)
def test_a_number_means_the_same_whatever_else_is_chosen(kind):
    def drawn(number, **keys):
        task = indoor(kind=kind, **keys).task(number)
        return task.start, task.goal.tolist(), task.shortest_path_length, task.world.edges.tolist()

    assert drawn(3, worlds=[900, 3]) == drawn(3, count=4)
    assert drawn(3) != drawn(4)
    assert drawn(3) != drawn(3, building_seed=1)


@pytest.mark.parametrize("kind", KINDS)
def test_tangent_bug_arrives(kind):
    robot = stage()
    task = indoor(kind=kind, radius=robot.footprint.circumscribed_radius).task(1)
    bug = Navigator(
        TangentBug(load_settings("guide/tangent_bug"), robot), Simple(load_settings("planner/simple"), robot)
    )
    episode = run_episode(
        task, bug, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(0)
    )
    assert episode.outcome is Outcome.SUCCESS


@pytest.mark.parametrize(
    "keys",
    [
        {"kind": "maze"},
        {"count": 0},
        {"worlds": [1, 1]},
        {"building_seed": -1},
        {"min_distance": -1.0},
        {"max_distance": 5.0},
        {"radius": 0.5},
        {"passage_margin": 0.05},
        {"passage_margin": 0.6},
        {"margin": math.nan},
        {"grid": 0.0},
        {"time_limit": 0.0},
    ],
    ids=str,
)
def test_a_mistake_is_one_line(keys, says):
    with says.raises(InputError):
        load_settings("map/indoor", **keys)


@pytest.mark.parametrize(
    "keys",
    [
        {"min_distance": 40.0, "max_distance": 50.0},
        {"min_distance": 0.0, "max_distance": 0.1},
    ],
    ids=str,
)
def test_distances_that_no_building_has_are_refused(keys, says):
    with says.raises(InputError):
        indoor(**keys).task(0)
