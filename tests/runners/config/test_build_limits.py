"""Time limits: what is printed, and a warning for those that nobody can meet."""

import warnings

import pandas as pd
import pytest

from runners.config.build import check_episodes, describe_limits
from runners.config.command_line import compose


def config_of(*words):
    (job,) = compose("eval", [*words])
    return job.config


def records(lengths, tolerance=0.2):
    """Two runs in each world."""
    rows = [
        {"world": world, "shortest_path_length_m": length, "goal_tolerance_m": tolerance}
        for _ in range(2)
        for world, length in enumerate(lengths)
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    "words",
    [
        ["map=traps", "robot=stage"],
        ["map=traps", "robot=stage", "robot.v_max=5"],
        ["map=traps", "robot=stage", "robot.v_max=0.07"],
        ["map=env1", "robot=stage"],
        ["map=env1", "robot=stage", "robot.v_max=0.1"],
        ["map=traps", "robot=stage", "map.time_limit=7"],
    ],
    ids=" ".join,
)
def test_the_line_gives_the_rule_and_its_range(words, says):
    says(describe_limits(config_of(*words), records([2.0, 4.0, 10.0])))


def test_a_map_set_with_a_rule_of_its_own_has_no_line():
    config = config_of("experiment=cold_trial", "hydra.mode=RUN", "system=lme", "map.subset=static")
    assert describe_limits(config, records([2.0])) == ""


def warnings_of(*words):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_episodes(config_of(*words))
    return [str(each.message) for each in caught if "time_limit" in str(each.message)]


def test_a_limit_that_some_pairs_cannot_meet_is_named(says):
    (line,) = warnings_of("map=env1", "robot=stage", "robot.v_max=0.15")
    assert "map.time_limit is 40 s" in line
    says(line)
    assert "highest speed of 0.15 m/s" in line


def test_a_cap_on_the_speed_counts():
    (line,) = warnings_of("map=env1", "robot=stage", "cap.v_max=0.15")
    assert "highest speed of 0.15 m/s" in line


@pytest.mark.parametrize(
    "words",
    [
        ["map=env1", "robot=stage"],
        ["map=traps", "robot=stage", "robot.v_max=0.05"],  # its limit follows the robot
        ["map=traps", "robot=stage", "map.time_limit=20"],
        ["map=barn", "robot=jackal"],
    ],
)
def test_a_limit_that_all_can_meet_is_not(words):
    assert warnings_of(*words) == []
