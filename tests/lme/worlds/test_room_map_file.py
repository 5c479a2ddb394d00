"""A map of the user's own: start and goal given, or drawn."""

import math

import numpy as np
import pytest
from PIL import Image

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.worlds.check import check_task
from lme.worlds.room import MapFile, Room
from lme.worlds.traps import Traps
from lme.worlds.world import Named
from tests.builders import stage

RADIUS = 0.2


@pytest.fixture
def hall(tmp_path):
    """10 × 10 m: a wall with a gap of 1 m on the way, a closed cell in a corner, a pillar."""
    path = tmp_path / "hall.yaml"
    path.write_text(
        "bounds: [0, 0, 10, 10]\n"
        "walls:\n"
        "  - {points: [[5, 0], [5, 8]]}\n"
        "  - {points: [[5, 9], [5, 10]]}\n"
        "  - {points: [[8, 0], [8, 2], [10, 2]]}\n"
        "circles: [{centre: [2, 7], radius: 0.5}]\n"
    )
    return str(path)


def chosen(path, **keys):
    return MapFile(load_settings("map/file", **{"path": path, "configurations": 4, "radius": RADIUS, **keys}))


def test_a_map_file_without_start_and_goal_is_a_room(hall):
    mine = chosen(hall)
    room = Room(load_settings("map/_room", path=hall, configurations=4, radius=RADIUS))
    for number in range(4):
        ours, theirs = mine.task(number), room.task(number)
        assert ours.start == theirs.start
        assert ours.goal.tolist() == theirs.goal.tolist()
        assert ours.shortest_path_length == theirs.shortest_path_length


def test_a_given_start_and_goal_are_one_configuration(hall):
    mine = chosen(hall, start=[1.0, 1.0, 0.5], goal=[9.0, 5.0])
    assert mine.numbers == (0,)
    task = mine.task(0)
    assert task.start == (1.0, 1.0, 0.5)
    assert task.goal.tolist() == [9.0, 5.0]
    assert task.measures["straight_m"] == math.hypot(8, 4)
    # Round the wall's end at (5, 8), a radius away from it.
    around = math.hypot(4, 7 + RADIUS) + math.hypot(4, 3 + RADIUS)
    assert task.shortest_path_length == pytest.approx(around, rel=0.014)
    assert task.optimal_time == task.shortest_path_length / 0.5


def test_a_start_without_a_yaw_faces_the_goal(hall):
    assert chosen(hall, start=[1.0, 1.0], goal=[3.0, 3.0]).task(0).start == (1.0, 1.0, math.pi / 4)
    task = chosen(hall, start=[1.0, 1.0]).task(2)
    assert task.start.yaw == math.atan2(task.goal[1] - 1.0, task.goal[0] - 1.0)


@pytest.mark.parametrize("given", [{"start": [1.0, 1.0, -1.0]}, {"goal": [9.0, 5.0]}])
def test_a_missing_start_or_goal_is_drawn_in_reach_for_each_number(hall, given):
    tasks = [chosen(hall, **given).task(number) for number in range(4)]
    starts, goals = {task.start for task in tasks}, {tuple(task.goal) for task in tasks}
    assert (len(starts), len(goals)) == ((1, 4) if "start" in given else (4, 1))
    for task in tasks:
        assert math.dist(task.start[:2], task.goal) >= 3.0 - RADIUS
        assert math.isfinite(task.shortest_path_length)
    alone = chosen(hall, worlds=[3], **given).task(3)
    assert (alone.start, alone.goal.tolist()) == (tasks[3].start, tasks[3].goal.tolist())


def test_a_place_between_lattice_points_is_free_if_the_disc_fits(tmp_path):
    # The place is 0.201 m from the wall; the lattice point nearest to it, at y = 3.175, is 0.18 m.
    path = tmp_path / "wall.yaml"
    path.write_text("bounds: [0, 0, 8, 6]\nwalls: [{points: [[0, 2.995], [8, 2.995]]}]\n")
    task = chosen(str(path), start=[1.0, 3.196], goal=[7.0, 3.196]).task(0)
    assert task.shortest_path_length == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize(
    "keys",
    [
        {"start": [-1.0, 1.0]},
        {"start": [2.0, 7.0]},
        {"goal": [4.9, 4.0]},
        {"start": [9.0, 1.0], "goal": [1.0, 1.0]},
        {"start": [9.0, 1.0]},
        {"start": [1.0, 1.0], "goal": [1.0, 1.1]},
        {"start": [1.0, 1.0], "goal": [1.0, 1.0]},
        {"start": [1.0, 1.0], "goal": [9.0, 5.0], "worlds": [3]},
        {"start": [1.0]},
        {"start": [1.0, math.nan]},
        {"goal": [1.0, 2.0, 3.0]},
    ],
    ids=str,
)
def test_a_mistake_is_one_line(hall, keys, says):
    with says.raises(InputError):
        chosen(hall, **keys).task(0)


def test_the_records_call_it_by_its_file_or_its_name(hall):
    assert isinstance(chosen(hall), Named)
    assert chosen(hall).name == chosen(hall).task(0).map_name == "hall"
    assert chosen(hall, name="mine").name == "mine"
    assert not isinstance(Traps(load_settings("map/traps")), Named)


def test_a_start_a_goal_and_movers_may_stand_in_the_file(tmp_path, says):
    path = tmp_path / "drawn.yaml"
    path.write_text(
        "bounds: [0, 0, 6, 6]\nstart: [1, 1, 0.5]\ngoal: [5, 5]\n"
        "movers:\n  - {radius: 0.25, path: [[3, 5], [3, 1]], speed: 0.8}\n"
    )
    maps = chosen(path)
    assert maps.numbers == (0,)
    task = maps.task(0)
    assert (task.start, task.goal.tolist()) == ((1.0, 1.0, 0.5), [5.0, 5.0])
    (mover,) = task.world.movers
    assert (mover.radius, mover.speed) == (0.25, 0.8)
    given = chosen(path, start=[2.0, 1.0], goal=[1.0, 5.0]).task(0)  # the config's win
    assert (given.start[:2], given.goal.tolist()) == ((2.0, 1.0), [1.0, 5.0])
    with says.raises(InputError):
        chosen(path, worlds=[1])


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        ("start: [1]", "start is [1]"),
        ("goal: [1, 2, 3]", "goal is [1, 2, 3]"),
        ("movers: [{path: [[1, 1]]}]", "movers[0]"),
    ],
)
def test_a_mistake_in_what_stands_in_the_file_is_one_line(tmp_path, line, problem):
    path = tmp_path / "drawn.yaml"
    path.write_text(f"bounds: [0, 0, 6, 6]\n{line}\n")
    with pytest.raises(InputError) as error:
        chosen(path)
    assert problem in str(error.value)


@pytest.mark.slow
def test_a_ros_map_of_twenty_million_cells_has_tasks(tmp_path):
    """A site of 250 by 200 m; a wall reaches 60 m into it from the lower side."""
    cells = np.full((4000, 5000), 254, np.uint8)
    cells[2800:, 2500:2504] = 0
    Image.fromarray(cells).save(tmp_path / "site.png")
    path = tmp_path / "site.yaml"
    path.write_text(
        "image: site.png\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    )
    drawn = chosen(path)
    for number in range(4):
        check_task(drawn.task(number), stage())
    task = chosen(path, start=[45.0, 20.0], goal=[205.0, 20.0]).task(0)
    around = math.hypot(80.0, 40.0 + RADIUS) * 2
    assert task.shortest_path_length == pytest.approx(around, rel=0.014)
