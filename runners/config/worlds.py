"""World numbers as users write them: `0-49`, `7`, or a list of both, `[0-9,20,30-39]`."""

from __future__ import annotations

import re
from typing import Any

from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError

MAX_WORLDS = 1_000_000  # of a range: a longer list would fill the memory
_SETS = ("held_out", "training")  # map sets by name, besides `map` itself
_RANGE = re.compile(r"(\d{1,18})(?:-(\d{1,18}))?")


def expand_worlds(config: DictConfig) -> None:
    """Write out the ranges of every map set's `worlds` in a composed config.

    A list of numbers stays as it is. Raises InputError.
    """
    for key in ("map", *(f"{name}.{place}" for name in _SETS for place in _names(config, name))):
        node = OmegaConf.select(config, key)
        if OmegaConf.is_dict(node) and "worlds" in node and not OmegaConf.is_interpolation(node, "worlds"):
            node["worlds"] = parse_worlds(node["worlds"], f"{key}.worlds")


def parse_worlds(given: Any, key: str) -> Any:
    """Return the numbers of worlds in order; anything that holds no text and is not a number stays as it is.

    key: key of `given`, for messages. Raises InputError for a text that is not a number or a range, for a range that
    runs backwards, and for a world that is listed twice.
    """
    items = list(given) if isinstance(given, list | tuple) or OmegaConf.is_list(given) else [given]
    is_number = isinstance(given, int) and not isinstance(given, bool)
    if not is_number and not any(isinstance(item, str) for item in items):
        return given
    numbers = [number for item in items for number in _numbers(item, key)]
    if len(set(numbers)) < len(numbers):
        shown = ",".join(map(str, items))
        raise InputError(f"{key} is [{shown}]: lists a world twice; must be different numbers")
    return numbers


def _numbers(item: Any, key: str) -> range | list[Any]:
    """Return the numbers that an item of the list stands for; an item that is not text stays as it is."""
    if not isinstance(item, str):
        return [item]
    found = _RANGE.fullmatch(item.strip())
    if found is None:
        raise InputError(
            f"{key} has {item!r}: must be numbers and ranges from 0 on, such as 0-49 or [0-9,20,30-39]"
        )
    first, last = int(found[1]), int(found[2] or found[1])
    if last < first:
        raise InputError(f"{key} has {item}: the range runs backwards; must be {last}-{first}")
    if last - first >= MAX_WORLDS:
        raise InputError(f"{key} has {item}: must be at most {MAX_WORLDS} worlds")
    return range(first, last + 1)


def _names(config: DictConfig, key: str) -> list[str]:
    node = OmegaConf.select(config, key)
    return [str(name) for name in node] if OmegaConf.is_dict(node) else []
