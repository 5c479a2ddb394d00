"""Race over worlds: the best candidates of a search drive more and more worlds, until the best one is known.

Every candidate drives the same worlds with the same random numbers, so differences are paired. A rung keeps the best
candidates, without those that are worse than the best one beyond the noise of these differences, as in F-Race
(Birattari et al. 2002). The starting weights stay until the end, so that nothing worse than them can win unnoticed.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from statistics import fmean
from typing import NamedTuple

import numpy as np

from lme.errors import InputError, require
from lme.types import Floats
from runners.config.schema import RaceConfig
from runners.training.samplers import restart_of
from runners.workers.trials import Attempt, Place, Score

START = -1  # the number of the starting weights, which are not a trial
_FEWEST = 8  # worlds; on fewer no difference counts as beyond the noise
_NOISE = 2.0  # standard errors

Drive = Callable[[Sequence[Attempt]], Iterable[Score]]
_LONGEST = 20  # characters of the name of the starting weights, which may be a path


class Candidate(NamedTuple):
    """Values by dotted config key, and the number of their trial, or START."""

    number: int
    values: dict[str, float]


@dataclass(frozen=True, slots=True)
class Rung:
    """One round of the race. values: mean rewards over `places` by number, the best first; places: all so far.

    worse: numbers of the candidates that are worse than the best one beyond the noise; none in the search, since
    its candidates were chosen on these very worlds.
    """

    places: tuple[Place, ...]
    values: dict[int, float]
    worse: frozenset[int]


@dataclass(frozen=True, slots=True)
class Race:
    """Finished race. rungs: the first one is the search. rewards: by candidate and place."""

    rungs: tuple[Rung, ...]
    rewards: Mapping[int, Mapping[Place, float]]

    @property
    def winner(self) -> int:
        """Number of the best candidate of the last rung."""
        return next(iter(self.rungs[-1].values))

    @property
    def best_trial(self) -> int:
        """Number of the best candidate that is not the starting weights; START if there is no other."""
        trials = (number for rung in reversed(self.rungs) for number in rung.values if number != START)
        return next(trials, START)


def check_race(config: RaceConfig) -> None:
    """Raise InputError for invalid rungs."""
    if len(config.candidates) != len(config.worlds) or not config.worlds:
        raise InputError(
            f"race.candidates is {config.candidates} and race.worlds {config.worlds}: must have one number per rung; "
            "race=null for no race"
        )
    for key, counts in (("candidates", config.candidates), ("worlds", config.worlds)):
        for count in counts:
            require(f"race.{key}", count, at_least=1)
    if sorted(config.candidates, reverse=True) != config.candidates:
        raise InputError(f"race.candidates is {config.candidates}: must not grow from rung to rung")


def run_race(
    candidates: Sequence[Candidate],
    scores: Iterable[Score],
    stages: Sequence[Sequence[Place]],
    config: RaceConfig,
    drive: Drive,
    restarts: int = 1,
) -> Race:
    """Run the whole race.

    candidates: those of the search, and perhaps the start. scores: those of the search. stages: configurations of it,
    and those that each rung adds. drive: runs attempts. restarts: number of searches; the best of each enter the
    first rung.
    """
    # Rung 0 is the search: only the start, which was no trial, still has to drive its worlds.
    rewards: dict[int, dict[Place, float]] = {candidate.number: {} for candidate in candidates}
    for score in scores:
        rewards[score.trial][score.place] = score.reward
    field, configurations = list(candidates), tuple(stages[0])
    _drive_missing(field, configurations, rewards, drive)
    rungs = [replace(_rung(field, configurations, rewards), worse=frozenset())]
    # Each rung keeps the best candidates, and adds worlds that all of them drive.
    for count, added in zip(config.candidates, stages[1:], strict=True):
        survivors = _survivors(rungs[-1], count, restarts if len(rungs) == 1 else 1)
        field = [candidate for candidate in field if candidate.number in survivors]
        configurations += tuple(added)
        _drive_missing(field, configurations, rewards, drive)
        rungs.append(_rung(field, configurations, rewards))
    return Race(tuple(rungs), rewards)


def mean_reward(rewards: Mapping[Place, float], configurations: Iterable[Place]) -> float:
    """Return the mean of the families' mean rewards."""
    by_family: dict[str, list[float]] = {}
    for configuration in configurations:
        by_family.setdefault(configuration[0], []).append(rewards[configuration])
    return fmean(map(fmean, by_family.values()))


def _drive_missing(
    field: Sequence[Candidate],
    configurations: Sequence[Place],
    rewards: dict[int, dict[Place, float]],
    drive: Drive,
) -> None:
    """Drive the places that the candidates have not driven yet, and add their rewards."""
    attempts = [
        Attempt(candidate.number, *configuration, tuple(candidate.values.items()))
        for candidate in field
        for configuration in configurations
        if configuration not in rewards[candidate.number]
    ]
    for score in drive(attempts) if attempts else ():
        rewards[score.trial][score.place] = score.reward


def _rung(
    field: Sequence[Candidate],
    configurations: tuple[Place, ...],
    rewards: Mapping[int, Mapping[Place, float]],
) -> Rung:
    values = {candidate.number: mean_reward(rewards[candidate.number], configurations) for candidate in field}
    ranked = dict(sorted(values.items(), key=lambda item: (-item[1], item[0])))
    best_rewards = _vector(rewards[next(iter(ranked))], configurations)
    worse = {
        number for number in ranked if _is_worse(_vector(rewards[number], configurations) - best_rewards)
    }
    return Rung(configurations, ranked, frozenset(worse))


def _survivors(rung: Rung, count: int, restarts: int) -> set[int]:
    """Return at most `count` of the best trials that are not worse than the best beyond the noise, and the start.

    restarts: number of searches, which contribute equally many trials if they have enough.
    """
    trials = [number for number in rung.values if number != START and number not in rung.worse]
    ranks = [itertools.count() for _ in range(restarts)]
    rank = {number: next(ranks[restart_of(number, restarts)]) for number in trials}  # within its own search
    trials.sort(key=rank.__getitem__)  # stable: the better one of equal ranks comes first
    return {*trials[:count], *({START} & rung.values.keys())}


def _is_worse(differences: Floats) -> bool:
    """Return whether paired differences from the best candidate (P,) lie below zero beyond their noise."""
    count = len(differences)
    if count < _FEWEST:
        return False
    # Worse if mean + 2 s / √P < 0, with s the standard deviation of the differences.
    error = float(differences.std(ddof=1)) / math.sqrt(count)
    return float(differences.mean()) < -_NOISE * error


def _vector(rewards: Mapping[Place, float], configurations: Sequence[Place]) -> Floats:
    return np.array([rewards[configuration] for configuration in configurations])


class End(StrEnum):
    """Reason why a candidate went no further."""

    won = "winner"
    finished = "finished"
    worse = "worse beyond the noise"
    outranked = "outranked"


@dataclass(frozen=True, slots=True)
class Racer:
    """A candidate. number: that of its trial, or START. values: its mean rewards, for each rung that it drove."""

    number: int
    values: tuple[float, ...]
    end: End

    @property
    def raced(self) -> bool:
        """Return whether it drove more than the worlds of the search."""
        return len(self.values) > 1


def racers(race: Race) -> list[Racer]:
    """Return all candidates: the winner first, then by the number of rungs and by the last mean reward."""
    all_racers = []
    for number in race.rungs[0].values:
        rungs = [rung for rung in race.rungs if number in rung.values]
        means = tuple(rung.values[number] for rung in rungs)
        all_racers.append(Racer(number, means, _end(race, number, rungs[-1])))
    return sorted(
        all_racers,
        key=lambda racer: (racer.end is not End.won, -len(racer.values), -racer.values[-1], racer.number),
    )


def name_of(number: int, start: str) -> str:
    """Return the name of a candidate. start: name of the starting weights."""
    start_name = start if len(start) <= _LONGEST else f"…{start[1 - _LONGEST :]}"
    return f"{start_name} (start)" if number == START else f"trial {number}"


def worlds_by_family(rung: Rung) -> dict[str, int]:
    """Return the number of worlds of each family that the candidates of a rung have driven."""
    return dict(Counter(family for family, _ in rung.places))


def driven_label(race: Race) -> str:
    """Return the label of the counts from `worlds_driven`."""
    has_families = len(worlds_by_family(race.rungs[0])) > 1
    return f"worlds {'of each family ' if has_families else ''}driven"


def worlds_driven(rung: Rung) -> str:
    """Return the worlds of each family as text: "10" if all have equally many, else "10 + 8"."""
    counts = list(worlds_by_family(rung).values())
    return " + ".join(map(str, counts if len(set(counts)) > 1 else counts[:1]))


def _end(race: Race, number: int, last_rung: Rung) -> End:
    if number == race.winner:
        return End.won
    if number in last_rung.worse:
        return End.worse
    return End.finished if last_rung is race.rungs[-1] else End.outranked
