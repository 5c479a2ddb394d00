"""The traps as a map set, and that they are traps."""

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
from lme.worlds.check import check_task
from lme.worlds.traps import DRAWINGS, KINDS, Traps
from tests.builders import SHIPPED, navigator, shipped, stage

ON_THE_WAY = 1.02  # of the straight line: nothing to go around
PUBLISHED_SHARE = 0.9  # of the starts that LME and TangentBug must get out from


def traps(**keys):
    return Traps(load_settings("map/traps", **keys))


def outcomes(chosen, numbers, make):
    robot = stage()
    return [
        run_episode(
            chosen.task(number),
            make(robot),
            FastSimulator(load_settings("sim/fast"), robot),
            np.random.default_rng(number),
        ).outcome
        for number in numbers
    ]


def bug(robot):
    return Navigator(
        TangentBug(load_settings("guide/tangent_bug"), robot), Simple(load_settings("planner/simple"), robot)
    )


@pytest.mark.parametrize("kind", DRAWINGS)
@pytest.mark.parametrize("name", SHIPPED)
def test_every_robot_can_begin_and_a_way_exists(kind, name):
    robot = shipped(name)
    chosen = traps(kind=kind, radius=robot.footprint.circumscribed_radius)
    assert chosen.numbers == tuple(range(20))
    for number in (0, 7, 19):
        task = chosen.task(number)
        check_task(task, robot)
        assert ON_THE_WAY < task.measures["detour"] < 4.0
        assert task.measures["straight_m"] == pytest.approx(7.0, abs=0.1)
        assert task.optimal_time == task.shortest_path_length / 0.5


def test_starts_differ_and_look_ahead():
    chosen = traps()
    starts = [chosen.task(number).start for number in chosen.numbers]
    assert len(set(starts)) == 20
    assert max(abs(start.y - 5.0) for start in starts) <= 0.3
    assert max(abs(start.yaw) for start in starts) <= 0.3
    assert np.std([start.y for start in starts]) > 0.1
    assert np.std([start.yaw for start in starts]) > 0.1


def test_a_number_means_the_same_whatever_else_is_chosen():
    assert traps(worlds=[3, 900]).task(3).start == traps().task(3).start
    assert traps(start_seed=1).task(3).start != traps().task(3).start


def test_a_door_is_as_wide_as_the_robot_and_the_margin():
    for radius, margin in ((0.2, 0.3), (0.35, 0.1)):
        world = traps(kind="door", radius=radius, door_margin=margin).task(0).world
        below, above = world.segments[-2], world.segments[-1]
        assert above[1] - below[3] == pytest.approx(2 * radius + margin)
        assert min(below[3], above[1]) > 6.5  # aside of the way at y = 5


def test_the_names_on_record_tell_the_traps_apart():
    assert {traps(kind=kind).task(0).map_name for kind in KINDS} == {
        "trap_u", "trap_wall", "trap_door", "trap_zigzag", "trap_mixed"
    }  # fmt: skip


@pytest.mark.parametrize(("radius", "door_margin"), [(0.2, 0.3), (0.5, 1.0)])
def test_every_mixed_trap_leaves_a_way_around(radius, door_margin):
    mixed = traps(kind="mixed", starts=30, radius=radius, door_margin=door_margin, grid=0.1, lateral=0.5)
    for number in mixed.numbers:
        assert 7.0 < mixed.task(number).shortest_path_length < 30.0


def test_a_mixed_trap_does_not_depend_on_the_others():
    def walls(number, **keys):
        return traps(kind="mixed", **keys).task(number).world.segments.tolist()

    assert walls(3, worlds=[900, 3]) == walls(3)
    assert walls(3, start_seed=1) != walls(3)


@pytest.mark.parametrize("kind", KINDS)
def test_heading_straight_for_the_goal_does_not_get_there(kind):
    assert Outcome.SUCCESS not in outcomes(
        traps(kind=kind), range(5), lambda robot: navigator(robot, "target")
    )


@pytest.mark.parametrize("kind", ["u", "wall"])
def test_lme_escapes(kind):
    ended = outcomes(traps(kind=kind), range(10), navigator)
    assert ended.count(Outcome.SUCCESS) >= PUBLISHED_SHARE * len(ended)


@pytest.mark.parametrize("kind", KINDS)
def test_tangent_bug_escapes_from_every_trap(kind):
    assert set(outcomes(traps(kind=kind), range(5), bug)) == {Outcome.SUCCESS}


@pytest.mark.parametrize(
    "keys",
    [
        {"kind": "maze"},
        {"starts": 0},
        {"worlds": [1, 1]},
        {"worlds": []},
        {"start_seed": -1},
        {"lateral": 0.6},
        {"turn": math.nan},
        {"radius": 0.7},
        {"door_margin": 0.05},
        {"grid": 0.0},
        {"time_limit": -1.0},
    ],
    ids=str,
)
def test_a_mistake_is_one_line(keys, says):
    with says.raises(InputError):
        traps(**keys)
