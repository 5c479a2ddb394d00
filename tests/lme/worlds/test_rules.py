"""What all map sets have in common: a goal that is reached at the start is no task."""

import re

import pytest

from lme.errors import InputError
from lme.presets import load_map_set, load_robot

LIES = r"the start lies [\d.]+ m from the goal, within map\.goal_tolerance = 100 m: must be further away"
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


def test_recorded_people_are_no_exception(tmp_path):
    (tmp_path / "walk.txt").write_text("0 1 0 0\n50 1 6 4\n")
    keys = {"path": str(tmp_path / "walk.txt"), "start": [-3.0, 2.0], "goal": [9.0, 2.0]}
    assert load_map_set("tracks", keys).task(0).shortest_path_length == 12.0
    with pytest.raises(InputError, match=f"^map walk, world 0: {LIES}$"):
        load_map_set("tracks", {**keys, "goal_tolerance": 100.0}).task(0)


def test_a_goal_at_the_start_is_refused():
    maps = load_map_set("barn", {"worlds": [0], "goal": [-2.25, 3.0]})
    with pytest.raises(InputError, match="map barn, world 0: the start lies 0 m from the goal, within"):
        maps.task(0)
