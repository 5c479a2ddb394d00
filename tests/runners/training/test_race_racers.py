"""What became of the candidates of a race."""

import pytest

from runners.training.race import START, End, driven_label, name_of, racers, worlds_by_family, worlds_driven
from tests.made_training import RACE


def test_each_candidate_ends_as_the_rungs_say():
    ends = {racer.number: (racer.end, racer.values) for racer in racers(RACE)}
    assert ends == {
        3: (End.won, (0.7, 0.6, 0.65)),
        START: (End.finished, (0.5, 0.55, 0.6)),
        1: (End.worse, (0.8, 0.4)),
        2: (End.outranked, (0.6, 0.5)),
        0: (End.outranked, (0.1,)),
        4: (End.worse, (-0.2,)),
    }


def test_the_winner_is_first_then_those_that_came_furthest():
    found = racers(RACE)
    assert [racer.number for racer in found] == [3, START, 2, 1, 0, 4]
    assert [racer.raced for racer in found] == [True, True, True, True, False, False]


def test_worlds_are_counted_by_family(says):
    assert worlds_by_family(RACE.rungs[1]) == {"env1": 2, "fresh": 2}
    assert [worlds_driven(rung) for rung in RACE.rungs] == ["1", "2", "4 + 3"]
    says(driven_label(RACE))


@pytest.mark.parametrize(
    ("number", "start", "name"),
    [(7, "published", "trial 7"), (START, "published", "published (start)"),
     (START, "a/" * 20 + "run", "…a/a/a/a/a/a/a/a/run (start)")],
)  # fmt: skip
def test_a_name_is_short(number, start, name):
    assert name_of(number, start) == name
