"""The named subsets of the BARN worlds."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

from lme.errors import InputError
from lme.resources import resource_dir

FRESH = ("fresh", "fresh_hard")  # generated: the others are official worlds
FRESH_KEYS = ("count", "fresh_seed")  # which only these subsets use
TARGET = "lme.worlds.barn.Barn"  # of the map set, in its YAML


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


def is_idle(key: str, map_set: Mapping[str, Any]) -> bool:
    """Whether a key of a map set's config is for fresh worlds, and the subset is one of official worlds."""
    return key in FRESH_KEYS and map_set.get("_target_") == TARGET and map_set.get("subset") in OFFICIAL


def check_given(keys: Iterable[str], map_set: Mapping[str, Any], node: str = "map") -> None:
    """Raise InputError if one of the keys that the user gave is idle. node: of the map set in the whole config."""
    for key in keys:
        if is_idle(key, map_set):
            choose = f"; {node}.worlds=0-9 chooses worlds" if key == "count" else ""
            raise InputError(
                f"{node}.{key} is {map_set[key]} with {node}.subset={map_set['subset']}: "
                f"must be left out, or {node}.subset be {' or '.join(FRESH)}{choose}"
            )
