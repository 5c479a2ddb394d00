"""The race: who gets more worlds, who wins, and that a killed race ends as an uninterrupted one."""

import numpy as np
import pytest

from lme.errors import InputError
from runners.config.schema import RaceConfig
from runners.training.race import START, Candidate, check_race, mean_reward, run_race
from runners.training.race_log import RaceLog
from runners.workers.trials import Attempt, Score

FAMILIES = ("open", "narrow")
CONFIG = RaceConfig([4, 2], [10, 20])
PLACES = [
    [(family, world) for world in worlds for family in FAMILIES]
    for worlds in (range(2), range(2, 12), range(12, 32))
]


class Track:
    """Rewards with a true value per candidate and noise per place, and what was driven."""

    def __init__(self, values, noise=0.01):
        self.values, self.noise, self.driven = values, noise, []

    def __call__(self, attempts):
        for attempt in reversed(attempts):  # the order in which they finish must not matter
            self.driven.append(attempt)
            yield self.score(attempt)

    def score(self, attempt):
        seed = [attempt.trial + 1, attempt.world, len(attempt.family)]
        error = self.noise * np.random.default_rng(seed).standard_normal()
        reward = self.values[attempt.trial] + float(error)
        return Score(attempt.trial, attempt.world, "success", 10, reward, attempt.family)


def raced(track, config=CONFIG, drive=None):
    candidates = [Candidate(number, {"x": float(number)} if number >= 0 else {}) for number in track.values]
    trials = [each for each in candidates if each.number != START]
    first = [
        track.score(Attempt(each.number, *place, tuple(each.values.items())))
        for each in trials
        for place in PLACES[0]
    ]
    return run_race(candidates, first, PLACES, config, drive or track)


def test_the_best_wins_and_few_get_many_worlds():
    track = Track({number: number / 100 for number in range(20)}, noise=0.03)
    race = raced(track)
    assert race.winner == race.best_trial == 19
    assert [len(rung.values) for rung in race.rungs] == [20, 4, 2]
    assert [len(rung.places) for rung in race.rungs] == [4, 24, 64]
    driven = [sum(each.trial == number for each in track.driven) for number in track.values]
    assert driven[19] == 60, "and not the search's own worlds again"
    assert sorted(driven, reverse=True) == [60, 60, 20, 20] + [0] * 16


def test_the_best_of_every_search_enter_the_first_rung():
    values = {number: (number % 3 == 0) + number / 100 for number in range(30)}
    candidates = [Candidate(number, {}) for number in values]
    track = Track(values, noise=0.0)
    first = [track.score(Attempt(number, *place, ())) for number in values for place in PLACES[0]]
    race = run_race(candidates, first, PLACES, RaceConfig([7, 2], [10, 20]), track, restarts=3)
    assert set(race.rungs[1].values) == {27, 24, 21, 29, 26, 28, 25}
    assert race.winner == 27


def test_luck_on_the_first_worlds_does_not_win():
    lucky = Track({0: 0.9, 1: 0.5, 2: 0.4, 3: 0.3}, noise=0.0)
    candidates = [Candidate(number, {}) for number in lucky.values]
    first = [lucky.score(Attempt(number, *place, ())) for number in lucky.values for place in PLACES[0]]
    later = Track({0: 0.1, 1: 0.5, 2: 0.4, 3: 0.3}, noise=0.0)
    assert run_race(candidates, first, PLACES, CONFIG, later).winner == 1


def test_a_candidate_that_is_worse_beyond_the_noise_gets_no_more_worlds():
    race = raced(Track({0: 1.0, 1: 0.99, 2: 0.2, 3: 0.1}, noise=0.02), RaceConfig([4, 4], [10, 20]))
    assert race.rungs[1].worse >= {2, 3}
    assert set(race.rungs[2].values) <= {0, 1}


def test_equal_candidates_are_not_worse_and_the_earlier_wins():
    race = raced(Track(dict.fromkeys(range(3), 0.5), noise=0.0), RaceConfig([3, 3], [10, 20]))
    assert race.winner == 0
    assert all(not rung.worse for rung in race.rungs)


def test_the_start_stays_until_the_end_however_bad_and_can_win():
    values = {number: number / 100 for number in range(10)}
    bad = raced(Track({START: -1.0, **values}))
    assert all(START in rung.values for rung in bad.rungs)
    assert [len(rung.values) for rung in bad.rungs] == [11, 5, 3]
    assert bad.winner == 9
    good = raced(Track({START: 1.0, **values}))
    assert good.winner == START
    assert good.best_trial == 9


def test_the_start_also_drives_the_worlds_of_the_search():
    track = Track({START: 0.5, 0: 0.4})
    raced(track)
    driven = {(each.family, each.world) for each in track.driven if each.trial == START}
    assert driven == {place for places in PLACES for place in places}
    assert all(each.values == () for each in track.driven if each.trial == START)


def test_a_family_counts_as_much_as_another():
    rewards = {("open", 0): 1.0, ("open", 1): 1.0, ("open", 2): 1.0, ("narrow", 0): 0.0}
    assert mean_reward(rewards, rewards) == 0.5


@pytest.mark.parametrize("known", [0, 1, 37, 60])
def test_a_race_killed_after_some_episodes_ends_as_the_uninterrupted_one(tmp_path, known):
    values = {START: 0.05, **{number: number / 100 for number in range(8)}}
    whole, log = Track(values), tmp_path / "race.jsonl"
    expected = raced(whole)
    with RaceLog(log) as kept:
        for attempt in whole.driven[:known]:
            kept.add(whole.score(attempt))
    log.write_bytes(log.read_bytes() + b'[3,4,"succ')  # a line that was being written
    again = Track(values)

    with RaceLog(log) as kept:

        def drive(attempts):
            for attempt in attempts:
                score = kept.get(attempt)
                if score is None:
                    (score,) = again([attempt])
                    kept.add(score)
                yield score

        race = raced(again, drive=drive)
    assert race == expected
    assert len(again.driven) == len(whole.driven) - known
    assert set(RaceLog(log)) == {whole.score(attempt) for attempt in whole.driven}


@pytest.mark.parametrize("line", ["{}", "[1,2]", '[1,2,"success",3,"x","open"]', "nonsense"])
def test_a_damaged_log_is_one_line(tmp_path, line, says):
    (tmp_path / "race.jsonl").write_text(f'[0,1,"success",5,0.5,"open"]\n{line}\n')
    with says.raises(InputError):
        RaceLog(tmp_path / "race.jsonl")


@pytest.mark.parametrize(
    ("candidates", "worlds"),
    [
        ([4, 2], [1]),
        ([], []),
        ([0], [1]),
        ([4], [0]),
        ([2, 4], [1, 1]),
    ],
    ids=str,
)
def test_rungs_that_cannot_be_raced(candidates, worlds, says):
    with says.raises(InputError):
        check_race(RaceConfig(candidates, worlds))
