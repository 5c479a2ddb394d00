"""Rooms as map sets: configurations under their numbers."""

import json
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.inputs.resources import resource_dir
from lme.robots import Robot
from lme.worlds.check import check_task
from lme.worlds.lattice import clearance_field
from lme.worlds.room import Room, read_floor_plan
from runners.config import catalogue
from runners.config.instantiate import build, fill_dataclass
from tests.places import SHARED

ORIGINALS = SHARED / "maps"


def room(**keys):
    return Room(load_settings("map/_room", **{"name": "env1", "configurations": 5, **keys}))


def pairs(chosen):
    return {
        number: (task.start, tuple(task.goal)) for number in chosen.numbers for task in [chosen.task(number)]
    }


@pytest.mark.parametrize("name", ["env1", "env2"])
def test_shipped_maps_offer_fifty_tasks_that_the_stage_robot_can_begin(name):
    robot = fill_dataclass(Robot, catalogue.shipped().values("robot/stage"), "robot")
    chosen = build(catalogue.shipped().values(f"map/{name}"), "map")
    assert chosen.numbers == tuple(range(50))
    for number in chosen.numbers:
        task = chosen.task(number)
        check_task(task, robot)
        assert (task.map_name, task.number) == (name, number)
        assert (task.goal_tolerance, task.time_limit, task.clock_distance) == (0.2, 40.0, 0.0)
        assert task.optimal_time == task.shortest_path_length / 0.5
        assert task.measures["straight_m"] >= 3.0 - 1e-9
        assert 1.0 <= task.measures["detour"] < 4.0
    assert len(set(pairs(chosen).values())) == 50


def test_walls_make_detours():
    """What the two maps are for: hardly any way around in env1, long ones in env2."""
    longest = {
        name: max(chosen.task(number).measures["detour"] for number in chosen.numbers)
        for name in ("env1", "env2")
        for chosen in [room(name=name, configurations=50)]
    }
    assert longest["env1"] < 1.2
    assert longest["env2"] > 2.0


def test_a_number_means_the_same_whatever_else_is_chosen():
    five, some = pairs(room()), pairs(room(worlds=[3, 900, 1]))
    assert list(some) == [3, 900, 1]
    assert [some[3], some[1]] == [five[3], five[1]]
    assert pairs(room(sample_seed=1))[3] != five[3]


def test_another_process_draws_the_same_tasks():
    code = (
        "import json; from lme.config.presets import load_settings; from lme.worlds.room import Room; "
        "r = Room(load_settings('map/_room', name='env2', configurations=3)); "
        "print(json.dumps([[*r.task(n).start, *r.task(n).goal, r.task(n).shortest_path_length] for n in r.numbers]))"
    )
    there = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    here = room(name="env2", configurations=3)
    tasks = [here.task(number) for number in here.numbers]
    assert json.loads(there.stdout) == [
        [*task.start, *task.goal, task.shortest_path_length] for task in tasks
    ]


def test_a_map_is_surveyed_once_and_again_when_its_file_changes(tmp_path):
    path = tmp_path / "hall.yaml"
    path.write_text("bounds: [0, 0, 8, 8]\n")
    first, second = (room(name=None, path=str(path)) for _ in range(2))
    assert first.task(0).world is second.task(1).world
    assert first.task(0).map_name == "hall"
    path.write_text("bounds: [0, 0, 8, 8]\ncircles: [{centre: [4, 4], radius: 1}]\n")
    assert len(room(name=None, path=str(path)).task(0).world.circles) == 1


def test_a_picture_is_a_map_set_too(tmp_path):
    Image.fromarray(np.pad(np.full((98, 98), 255, dtype=np.uint8), 1)).save(tmp_path / "hall.png")
    given = {"path": str(tmp_path / "hall.png"), "size": [10, 10]}
    chosen = build({**catalogue.shipped().values("map/file"), **given}, "map")
    assert chosen.task(49).map_name == "hall"


@pytest.mark.parametrize(
    "keys",
    [
        {"name": None},
        {"name": "env3"},
        pytest.param({"path": __file__}, id="{'path': __file__}"),
        pytest.param({"path": __file__, "size": [9.0, 9.0]}, id="{'path': __file__, 'size': [9.0, 9.0]}"),
        {"path": "gone.yaml"},
        {"path": "."},
        {"size": [10.0, 10.0]},
        {"size": [10.0]},
        {"size": [10.0, 0.0]},
        {"unknown": "maybe"},
        {"configurations": 0},
        {"worlds": []},
        {"worlds": [1, 1]},
        {"worlds": [-1]},
        {"sample_seed": -1},
        {"min_distance": -1.0},
        {"min_distance": 50.0},
        {"radius": 0.0},
        {"margin": float("nan")},
        {"grid": 1e-5},
        {"time_limit": 0.0},
        {"speed": 0.0},
    ],
    ids=str,
)
def test_a_mistake_is_one_line(keys, says):
    with says.raises(InputError):
        room(**keys)


@pytest.mark.skipif(not ORIGINALS.is_dir(), reason="the original maps are not here")
@pytest.mark.parametrize(("ours", "original"), [("env1", "d6.jpg"), ("env2", "pfeiffer_3.png")])
def test_ours_leave_as_much_room_as_the_originals(ours, original):
    files = [(resource_dir("maps") / ours / "shapes.yaml", None), (ORIGINALS / original, (10.0, 10.0))]
    points = np.arange(0.05, 10.0, 0.1)
    fields = [clearance_field(read_floor_plan(*file), points, points, reach=3.0) for file in files]
    quartiles = [np.percentile(field[field > 0], [25, 50, 75]) for field in fields]
    assert quartiles[0] == pytest.approx(quartiles[1], abs=0.08)
