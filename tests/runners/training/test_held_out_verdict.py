"""Whether the result of a training is better, level or worse than the start."""

import numpy as np
import pandas as pd
import pytest

from runners.training.held_out import judge, with_rewards
from tests.composing import jobs_of

WORLDS, STEPS = 40, 100


@pytest.fixture(scope="module")
def places():
    with jobs_of("train", "executor=serial", "tracking=none") as job:
        config = job("map=env1").config
    return {"env1": config, "other": config}


def records(steps, failures=(), place="env1", failure="collision"):
    """One episode in each of WORLDS worlds."""
    noise = np.random.default_rng(0).integers(0, 5, WORLDS)
    return pd.DataFrame(
        {
            "run_dir": f"run/{place}",
            "world": range(WORLDS),
            "run": 0,
            "outcome": [failure if world in failures else "success" for world in range(WORLDS)],
            "steps": steps + noise,
        }
    )


def both(steps, failures=()):
    return pd.concat([records(steps, failures), records(steps, place="other")], ignore_index=True)


def judged(places, start, found, training_reward):
    """The verdict on records without rewards."""
    scored = with_rewards(places, start)
    return judge(places, scored, scored if found is start else with_rewards(places, found), training_reward)


START = both(STEPS, {1, 2})


@pytest.mark.parametrize(
    ("found", "word"),
    [
        (both(STEPS - 10, {1, 2}), "better"),
        (both(STEPS, {1, 2}), "level"),
        (both(STEPS + 10, {1, 2}), "worse"),
        (both(STEPS - 50, set(range(12))), "worse"),
    ],
)
def test_the_verdict_and_its_sentence(places, found, word, says):
    verdict = judged(places, START, found, 0.7)
    assert verdict.content()["verdict"] == word
    assert verdict.is_worse == (word == "worse")
    says(verdict.lines("published")[-1])


def test_success_on_one_map_counts_even_if_the_reward_on_all_is_better(places):
    verdict = judged(places, START, both(STEPS - 90, set(range(3, 15))), 0.9)
    assert verdict.overall.reward_difference.mean > 0
    assert verdict.by_place["env1"].success_difference.high < 0
    assert verdict.is_worse


def test_more_collisions_are_worse_although_the_reward_counts_them_like_timeouts(places, says):
    failures = set(range(12))
    start = pd.concat([records(STEPS, failures, failure="timeout"), records(STEPS, place="other")])
    verdict = judged(places, start, both(STEPS - 50, failures), 0.9)
    assert verdict.overall.reward_difference.low > 0
    assert verdict.by_place["env1"].success_difference.mean == 0
    assert verdict.by_place["env1"].start_collision == pytest.approx(0)
    assert verdict.content()["difference_to_start"]["env1"]["collision"] == pytest.approx(0.3)
    assert verdict.content()["verdict"] == "worse"
    says(verdict.lines("published"))


def test_a_few_worlds_prove_nothing(places):
    few, better = (frame[frame["world"] < 4] for frame in (START, both(STEPS - 50, {1, 2})))
    verdict = judged(places, few, better, 0.9)
    assert verdict.overall.reward_difference.low > 0
    assert verdict.content()["verdict"] == "level"


def test_figures_are_those_of_the_records(places):
    verdict = judged(places, START, both(STEPS - 10, {1, 2}), 0.9)
    env1 = verdict.by_place["env1"]
    assert env1.success == pytest.approx(38 / 40)
    rewards = 1 - records(STEPS - 10)["steps"].drop([1, 2]) / 200
    assert env1.reward == pytest.approx((rewards.sum() - 2 * 0.2) / 40)
    assert env1.reward_difference.mean == pytest.approx(38 / 40 * 10 / 200)
    content = verdict.content()
    assert set(content["difference_to_start"]) == {"env1", "other", "all"}
    mean = (env1.reward + verdict.by_place["other"].reward) / 2
    assert content["reward_gap"] == pytest.approx(0.9 - mean, abs=1e-6)


def test_if_the_start_wins_the_weights_are_kept(places, says):
    verdict = judged(places, START, START, 0.7)
    assert verdict.content()["verdict"] == "level"
    says(verdict.lines("published")[-1])
