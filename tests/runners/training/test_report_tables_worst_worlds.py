"""The worst held-out worlds: failures first, then low rewards; what the start could do is said."""

import pandas as pd
import pytest

from runners.records.episode_record import EpisodeKey
from runners.training.report_tables import regressions, worst_worlds


def records(folder, *rows):
    """rows: map, world, run, reward; below zero it is a collision."""
    return pd.DataFrame(
        {
            "run_dir": f"{folder}/{place}",
            "world": world,
            "run": run,
            "outcome": "success" if reward > 0 else "collision",
            "reward": reward,
            "time_s": 10.0 + run,
        }
        for place, world, run, reward in rows
    )


EPISODES = [("env1", 0, 0), ("env1", 0, 1), ("env1", 1, 0), ("env1", 1, 1), ("env2", 0, 0), ("env2", 0, 1)]


def driven(folder, *rewards):
    return records(folder, *((*key, reward) for key, reward in zip(EPISODES, rewards, strict=True)))


RESULT = driven("run", 0.5, 0.1, -0.2, 0.9, -0.2, -0.2)
GOOD_START = driven("run/start", 0.5, 0.5, 0.5, 0.5, 0.5, -0.2)


def test_worlds_that_the_start_solved_come_first_among_equals():
    start = driven("run/start", 0.5, 0.5, 0.5, 0.5, -0.2, -0.2)
    found = worst_worlds(RESULT, start, 9)
    assert [(world.run_dir.name, world.key) for world in found] == [
        ("env1", EpisodeKey(1, 0)),
        ("env2", EpisodeKey(0, 0)),
        ("env1", EpisodeKey(0, 1)),
    ]
    assert [(world.failed, world.runs, world.start_failed, world.lost) for world in found] == [
        (1, 2, 0, 1),
        (2, 2, 2, 0),
        (0, 2, 0, 0),
    ]


def test_of_worlds_that_lost_as_often_the_one_that_fails_more_comes_first():
    found = worst_worlds(RESULT, GOOD_START, 2)
    assert [world.run_dir.name for world in found] == ["env2", "env1"]
    assert found[0].reward == pytest.approx(-0.2)
    assert found[0].outcome == "collision"


def test_where_the_start_is_the_result_nothing_is_lost():
    found = worst_worlds(RESULT, None, 9)
    assert {(world.start_failed, world.lost) for world in found} == {(None, 0)}


def test_regressions_count_episodes():
    assert regressions(RESULT, GOOD_START) == 2
    assert regressions(GOOD_START.assign(outcome="success"), GOOD_START) == 0
