"""The named subsets of the BARN worlds."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from functools import cache

from lme.resources import resource_dir

FRESH = ("fresh", "fresh_hard")  # generated: the others are official worlds


@cache
def lab100() -> tuple[int, ...]:
    """The hundred worlds of a test script of the paper's lab, sorted; `maps/README.md` has the source.

    That the paper's "100 challenging maps" are the same is inferred.
    """
    with (resource_dir("maps") / "barn" / "lab100.csv").open(newline="", encoding="utf-8") as file:
        return tuple(sorted(int(row["world"]) for row in csv.DictReader(file)))


OFFICIAL: dict[str, Callable[[], Iterable[int]]] = {
    "all": lambda: range(300),
    "official50": lambda: range(0, 300, 6),
    "lab100": lab100,
    "hard100": lambda: range(200, 300),
}
SUBSETS = (*OFFICIAL, *FRESH)
