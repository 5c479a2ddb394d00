"""The draws of the cold trial: fixed by seed and number, within their ranges, and possible for the drawn robot."""

import math
from collections import Counter

import pytest

from lme.config.presets import load_map_set, load_robot, load_settings
from lme.errors import InputError
from lme.worlds.check import check_task
from lme.worlds.cold_trial import draw_task

SEED = 7


def trial(**settings):
    return load_map_set("_cold_trial", {"trial_seed": SEED, "count": 40, **settings})


def test_a_draw_depends_on_seed_and_number_alone():
    forth, back = trial(), trial(worlds=[3, 2])
    first = [forth.drawn(number) for number in (2, 3)]
    second = [back.drawn(number) for number in (3, 2)][::-1]
    for one, other in zip(first, second, strict=True):
        assert (one.robot, one.disturbances, one.columns) == (other.robot, other.disturbances, other.columns)
        assert (one.task.start, one.task.time_limit) == (other.task.start, other.task.time_limit)
    assert trial(trial_seed=8).drawn(2).robot != first[0].robot


def test_families_take_turns_and_every_robot_has_a_path():
    maps, families = trial(), []
    for number in range(8):
        task, robot, disturbances, columns = maps.drawn(number)
        families.append(columns["family"])
        check_task(task, robot)
        assert math.isfinite(task.shortest_path_length)
        assert 0.2 <= columns["width_m"] <= columns["length_m"] <= 0.8 + 1e-9
        assert 5.0 <= robot.control_rate <= 20.0
        assert math.pi <= robot.lidar.fov <= 2 * math.pi
        assert 0.0 <= disturbances["latency"] <= 0.2
        assert 0.0 <= disturbances["slip"] <= 0.05
        assert 0.0 <= disturbances["scan_noise"] <= 0.02
    assert set(Counter(families).values()) == {2}


def test_a_barn_world_refuses_a_disc_that_is_too_wide():
    with pytest.raises(InputError, match=r"no path|too near"):
        draw_task("barn", seed=1, choice=0, radius=1.5, margin=0.1)


def test_the_task_is_for_the_drawn_robot_alone(says):
    with says.raises(InputError):
        check_task(trial().task(3), load_robot("jackal"))


@pytest.mark.parametrize(
    ("key", "bounds", "message"),
    [
        ("slip", [0.1, 0.0], "lowest, highest"),
        ("size", [0.0, 1.0], "greater than 0"),
        ("mount", [-2.0, 0.0], "-1"),
    ],
)
def test_a_bad_range_names_its_key(key, bounds, message):
    with pytest.raises(InputError, match=rf"map\.ranges\.{key}.*{message}"):
        load_settings("map/_cold_trial", ranges={key: bounds})
