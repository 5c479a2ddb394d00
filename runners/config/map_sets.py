"""Map sets by name, with settings and world numbers: what `lme maps` and `lme figure maps` take."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

from lme.errors import InputError, nearest
from lme.types import Floats
from lme.worlds.world import MapSet, Surveyed, Task
from runners.config import catalogue
from runners.config.worlds import parse_worlds

GRAMMAR = "NAME [NUMBER…] [key=value…]"
CHOICES = ("subset", "kind", "difficulty")  # settings that say which of a set's worlds there are


class Chosen(NamedTuple):
    """A map set. worlds: the numbers named, or none. choice: which of its worlds, where it comes in kinds."""

    name: str
    maps: MapSet
    worlds: tuple[int, ...]
    choice: str


def choose(words: Sequence[str]) -> Chosen:
    """Build the map set of these words: its name, and in any order world numbers and settings.

    `map.key=value` is the same as `key=value`, and `0-5` are six numbers. Raises InputError for a name, a number or a
    setting that is not there, or not right.
    """
    from lme.worlds.barn.subsets import check_given
    from runners.config.instantiate import build

    name, *what = words or [""]
    known = catalogue.shipped().titles("map")
    if name not in known:
        raise InputError(f"map set {name!r} is unknown: {nearest(name, known)}There are {', '.join(known)}")
    settings = [word for word in what if "=" in word]
    numbers = list(dict.fromkeys(number for word in what if "=" not in word for number in _numbers(word)))
    settings = [setting.removeprefix("map.") for setting in settings]
    node = _node(name, settings)
    check_given((setting.partition("=")[0] for setting in settings), node)
    if numbers:
        node["worlds"] = numbers
    maps = cast(MapSet, build(node, "map"))
    choice = next((f"{key} {node[key]}" for key in CHOICES if key in node), "")
    return Chosen(name, maps, tuple(numbers), choice)


def known_path(maps: MapSet, task: Task) -> Floats | None:
    """(P, 2) the way from start to goal that the optimal time counts [m]; None where only its length is known."""
    return maps.way(task.number) if isinstance(maps, Surveyed) else None


def _numbers(word: str) -> list[int]:
    if re.fullmatch(r"-[0-9]{1,9}", word):
        return [int(word)]  # the map set says what is right
    if not re.fullmatch(r"[0-9]{1,9}(-[0-9]{1,9})?", word):
        raise InputError(f"{word!r} is neither a world number nor key=value")
    return list(parse_worlds(word, "map.worlds"))


def _node(name: str, settings: Sequence[str]) -> Any:
    """The set's config with its settings."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    try:
        given = OmegaConf.from_dotlist(list(settings))
        merged: Any = OmegaConf.merge(catalogue.shipped().values(f"map/{name}"), given)
        return {**merged, "worlds": parse_worlds(merged.get("worlds"), "map.worlds")}
    except (OmegaConfBaseException, YAMLError, ValueError) as error:
        raise InputError(f"{' '.join(settings)}: must be key=value, as in YAML") from error
