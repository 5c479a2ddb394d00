"""The search and the race of a training, made up, for tests of its report."""

from runners.config.space import Range
from runners.training.race import START, Race, Rung
from runners.training.study import Trial
from runners.workers.trials import Score

SPACE = {"guide.parameters.c_o": Range(1.0, 1000.0, log=True), "planner.kp": Range(0.0, 4.0)}
VALUES = {
    number: dict(zip(SPACE, (10.0 ** (number % 3), 0.5 * number + 0.5), strict=True)) for number in range(5)
}
REWARDS = {0: 0.1, 1: 0.8, 2: 0.6, 3: 0.7, 4: -0.2}
TRIALS = [
    Trial(number, REWARDS[number], VALUES[number], [Score(number, 5, "success", 9, REWARDS[number], "env1")])
    for number in range(5)
]

_PLACES = [[(name, world) for name in ("env1", "fresh")] for world in range(3)]
_PLACES.append([("env1", 3)])
_SEARCH, _FIRST = tuple(_PLACES[0]), tuple(_PLACES[0] + _PLACES[1])
_LAST = tuple(place for places in _PLACES for place in places)
RACE = Race(
    (
        Rung(_SEARCH, {1: 0.8, 3: 0.7, 2: 0.6, START: 0.5, 0: 0.1, 4: -0.2}, frozenset({4})),
        Rung(_FIRST, {3: 0.6, START: 0.55, 2: 0.5, 1: 0.4}, frozenset({1})),
        Rung(_LAST, {3: 0.65, START: 0.6}, frozenset()),
    ),
    {},
)  # trial 3 wins; trials 0 and 4 do not enter
