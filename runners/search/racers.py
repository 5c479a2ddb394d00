"""What became of each candidate of a race: how far it came, and why it went no further."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

from runners.search.race import START, Race, Rung

_LONGEST = 20  # characters of the name of the starting weights, which may be a path


class End(StrEnum):
    """Why a candidate went no further."""

    won = "winner"
    finished = "finished"
    worse = "worse beyond the noise"
    outranked = "outranked"


@dataclass(frozen=True, slots=True)
class Racer:
    """A candidate. number: of its trial, or START. values: its mean reward by rung, as far as it came."""

    number: int
    values: tuple[float, ...]
    end: End

    @property
    def raced(self) -> bool:
        """Whether it drove more than the worlds of the search."""
        return len(self.values) > 1


def racers(race: Race) -> list[Racer]:
    """All candidates: the winner first, then those that came furthest, then by their last value."""
    found = [_racer(race, number) for number in race.rungs[0].values]
    return sorted(
        found, key=lambda one: (one.end is not End.won, -len(one.values), -one.values[-1], one.number)
    )


def name_of(number: int, start: str) -> str:
    """A candidate in words. start: the name of the starting weights."""
    short = start if len(start) <= _LONGEST else f"…{start[1 - _LONGEST :]}"
    return f"{short} (start)" if number == START else f"trial {number}"


def worlds_by_family(rung: Rung) -> dict[str, int]:
    """How many worlds of each family the candidates of a rung have driven."""
    return dict(Counter(family for family, _ in rung.places))


def driven_label(race: Race) -> str:
    """What `worlds_driven` counts."""
    several = len(worlds_by_family(race.rungs[0])) > 1
    return f"worlds {'of each family ' if several else ''}driven"


def worlds_driven(rung: Rung) -> str:
    """The same in words: "10" if the families have equally many, else "10 + 8"."""
    counts = list(worlds_by_family(rung).values())
    return " + ".join(map(str, counts if len(set(counts)) > 1 else counts[:1]))


def _racer(race: Race, number: int) -> Racer:
    driven = [rung for rung in race.rungs if number in rung.values]
    return Racer(number, tuple(rung.values[number] for rung in driven), _end(race, number, driven[-1]))


def _end(race: Race, number: int, last: Rung) -> End:
    if number == race.winner:
        return End.won
    if number in last.worse:
        return End.worse
    return End.finished if last is race.rungs[-1] else End.outranked
