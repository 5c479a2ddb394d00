"""The map set: subsets, bad input, tasks, and its YAML."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.worlds.barn.map_set import Barn


def barn(**keys):
    return Barn(load_settings("map/barn", **keys))


def test_a_subset_has_its_worlds():
    assert barn(subset="hard100").numbers == tuple(range(200, 300))
    assert barn(subset="all").numbers == tuple(range(300))
    assert barn(subset="official50").numbers == tuple(range(0, 300, 6))
    assert barn(subset="fresh", count=3).numbers == (1000, 1001, 1002)
    assert barn(subset="fresh_hard", count=3).numbers == (1000, 1001, 1002)
    assert barn(worlds=[7, 3]).numbers == (7, 3)
    assert barn(subset="fresh", worlds=[1500]).numbers == (1500,)


@pytest.mark.parametrize(
    "keys",
    [
        {"subset": "hard10"},
        {"subset": "xyz"},
        {"subset": "fresh", "source": "here"},
        {"subset": "fresh_hard", "source": "here"},
        {"worlds": [5], "subset": "fresh_hard"},
        {"count": 0},
        {"fresh_seed": -1},
        {"goal_tolerance": 0.0},
        {"time_limit": math.inf},
        {"clock_distance": -0.1},
        {"start": [0.0, 0.0]},
        {"goal": [0.0, math.nan]},
        {"worlds": []},
        {"worlds": [1, 1]},
        {"worlds": [7, -1]},
        {"worlds": [300, 7, 301]},
        {"worlds": [5], "subset": "fresh"},
        {"source": "/nowhere"},
        pytest.param({"source": "1" * 300}, id="{'source': '111…'}"),
    ],
    ids=str,
)
def test_a_wrong_setting_is_named(keys, says):
    with says.raises(InputError):
        barn(**keys)


def test_absent_numbers_of_a_source_are_named(tmp_path, says):
    for number in range(205, 300):
        (tmp_path / f"world_{number}.world").touch()
    with says.raises(InputError):
        barn(source=str(tmp_path), subset="hard100")
    with says.raises(InputError):
        barn(source=str(tmp_path), subset="official50")
    assert len(barn(source=str(tmp_path), subset="all").numbers) == 95


def test_task_has_the_protocol_of_the_benchmark():
    task = barn(worlds=[0]).task(0)
    assert (task.map_name, task.number) == ("barn", 0)
    assert task.start == (-2.25, 3.0, math.pi / 2)
    np.testing.assert_array_equal(task.goal, [-2.25, 13.0])
    assert (task.goal_tolerance, task.time_limit, task.clock_distance) == (1.0, 100.0, 0.1)
    assert task.world.circles.shape == (209, 3)
    assert task.shortest_path_length == 2 * task.optimal_time
    assert round(task.optimal_time, 4) == 6.7961
    assert list(task.measures) == [
        "cylinders",
        "fill",
        "smoothings",
        "closest_wall",
        "avg_visibility",
        "dispersion",
        "characteristic_dimension",
        "tortuosity",
    ]


def test_worlds_get_harder_with_their_number():
    """Correlation of the authors' order with three of the measures: −.52, −.57, −.54."""
    every = barn(subset="all")
    measures = [every.task(number).measures for number in every.numbers]
    for name, expected in {
        "closest_wall": -0.52,
        "avg_visibility": -0.57,
        "characteristic_dimension": -0.54,
    }.items():
        values = [world[name] for world in measures]
        assert round(float(np.corrcoef(range(300), values)[0, 1]), 2) == expected
