"""What all map sets have in common: a goal that is reached at the start is no task; times follow the robot."""

import re
from dataclasses import replace

import pytest
from PIL import Image

from lme.config.presets import load_map_set, load_robot
from lme.errors import InputError

LIES = r"the start lies [\d.]+ m from the goal, within goal_tolerance = 100 m: must be further away"
SETS = {
    "barn": ("barn", 0, {"worlds": [0]}),
    "env1": ("env1", 3, {}),
    "dynabarn": ("dynabarn_medium", 3, {}),
    "social": ("social_crossing", 3, {}),
    "indoor": ("indoor_offices", 3, {}),
    "traps": ("trap_u", 3, {}),
    "real1": ("real1", 3, {}),
    "empty": ("empty", 0, {}),
}


@pytest.mark.parametrize(("name", "named", "number", "keys"), [(name, *each) for name, each in SETS.items()])
def test_a_start_within_the_goal_tolerance_is_refused_in_one_line(name, named, number, keys):
    maps = load_map_set(name, {**keys, "goal_tolerance": 100.0}, load_robot("stage"))
    with pytest.raises(InputError, match=f"^map {re.escape(named)}, world {number}: {LIES}$"):
        maps.task(number)


@pytest.mark.parametrize("name", sorted(set(SETS) - {"empty"}))
def test_a_number_that_was_not_chosen_is_refused(name):
    maps, (named, *_) = load_map_set(name, {"worlds": [3]}, load_robot("stage")), SETS[name]
    said = f"^[a-z]+ 4 is not among the chosen ones of map {named.removesuffix('_medium')}$"
    with pytest.raises(InputError, match=said):
        maps.task(4)


def test_recorded_people_are_no_exception(tmp_path):
    (tmp_path / "walk.txt").write_text("0 1 0 0\n50 1 6 4\n")
    keys = {"path": str(tmp_path / "walk.txt"), "start": [-3.0, 2.0], "goal": [9.0, 2.0]}
    assert load_map_set("tracks", keys).task(0).shortest_path_length == 12.0
    with pytest.raises(InputError, match=f"^map walk, world 0: {LIES}$"):
        load_map_set("tracks", {**keys, "goal_tolerance": 100.0}).task(0)


def test_a_goal_at_the_start_is_refused(says):
    maps = load_map_set("barn", {"worlds": [0], "goal": [-2.25, 3.0]})
    with says.raises(InputError):
        maps.task(0)


# The clock follows the robot


CLOCKS = {
    "file": {"size": [20.0, 3.0], "start": [1.0, 1.5], "goal": [19.0, 1.5]},
    "indoor": {"worlds": [1]},
    "traps": {},
    "social": {"kind": "corridor"},
    "real3": {},
    "go2_b": {},
    "tracks": {"start": [-3.0, 2.0], "goal": [9.0, 2.0]},
    "building": {"min_distance": 3.0},
}


@pytest.fixture
def hall(tmp_path):
    """A hall of 20 × 3 m as a ROS map and as a picture, and the track of a person."""
    Image.new("L", (200, 30), 255).save(tmp_path / "hall.png")
    ros = "image: hall.png\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
    (tmp_path / "hall.yaml").write_text(ros)
    (tmp_path / "walk.txt").write_text("0 1 0 0\n50 1 6 4\n")
    files = {"file": {"path": "hall.png"}, "tracks": {"path": "walk.txt"}, "building": {"paths": "hall.yaml"}}
    return {
        name: {
            key: str(tmp_path / file) if key == "path" else [str(tmp_path / file)]
            for key, file in keys.items()
        }
        for name, keys in files.items()
    }


def first_task(hall, name, robot, **keys):
    maps = load_map_set(name, {**CLOCKS[name], **hall.get(name, {}), **keys}, robot)
    return maps.task(maps.numbers[0])


@pytest.mark.parametrize("name", CLOCKS)
@pytest.mark.parametrize("v_max", [0.07, 0.5, 2.0])
def test_optimal_time_and_limit_are_those_of_the_robot(hall, name, v_max):
    task = first_task(hall, name, replace(load_robot("turtlebot2"), v_max=v_max))
    assert task.optimal_time == task.shortest_path_length / v_max
    assert task.time_limit == max(60.0, 8.0 * task.optimal_time)


@pytest.mark.parametrize("name", CLOCKS)
def test_a_given_speed_is_that_of_the_optimal_time_alone(hall, name):
    robot = replace(load_robot("turtlebot2"), v_max=0.1)
    task = first_task(hall, name, robot, speed=0.4)
    assert task.optimal_time == task.shortest_path_length / 0.4
    assert task.time_limit == max(60.0, 8.0 * task.shortest_path_length / 0.1)
    assert first_task(hall, name, robot, time_limit=33.0).time_limit == 33.0


@pytest.mark.parametrize("robot", ["stage", "jackal"])
@pytest.mark.parametrize(
    ("name", "limit", "speed"),
    [("env1", 40.0, 0.5), ("env2", 40.0, 0.5), ("dynabarn", 100.0, 2.0)],
)
def test_the_papers_and_the_benchmarks_clocks_are_the_same_for_every_robot(name, limit, speed, robot):
    task = load_map_set(name, {}, load_robot(robot)).task(3)
    assert (task.time_limit, task.optimal_time) == (limit, task.shortest_path_length / speed)


def test_people_are_there_until_the_robots_time_limit(tmp_path):
    walks = {1: range(0, 1000, 25), 2: range(1000, 2000, 25)}  # person 2 comes after 80 s
    lines = "".join(f"{frame} {who} 5 {frame / 1000}\n" for who, frames in walks.items() for frame in frames)
    (tmp_path / "walk.txt").write_text(lines)
    keys = {"path": str(tmp_path / "walk.txt"), "start": [0.0, 3.0], "goal": [10.0, 3.0], "frame_rate": 12.5}
    slow, fast = (replace(load_robot("turtlebot2"), v_max=v_max) for v_max in (0.5, 2.0))
    people = [len(load_map_set("tracks", keys, robot).task(0).world.movers) for robot in (slow, fast)]
    assert people == [2, 1]


@pytest.mark.parametrize(("key", "value"), [("v_max", 0.0), ("speed", -1.0), ("time_limit", 0.0)])
def test_a_clock_that_does_not_run_is_refused(key, value, says):
    with says.raises(InputError):
        load_map_set("traps", {key: value}, load_robot("stage"))
