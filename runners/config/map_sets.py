"""Map sets by name, with settings, a robot and world numbers, as in `lme maps` and `lme figure maps`.

Numbers are written as `0-49`, as `7`, or as a list of both, `[0-9,20,30-39]`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple, cast

from omegaconf import DictConfig, OmegaConf

from lme.config.composer import resolved
from lme.errors import InputError, nearest
from lme.robots import Robot
from lme.types import Floats
from lme.worlds.rules import with_robot
from lme.worlds.world import MapSet, Surveyed, Task
from runners.config import catalogue
from runners.config.catalogue import Catalogue

GRAMMAR = "NAME [NUMBER…] [key=value…]"
CHOICES = ("subset", "kind", "difficulty")  # settings that choose among a set's worlds
_ROBOT = re.compile(r"robot(\.[\w.]+)?=")
MAX_WORLDS = 1_000_000  # of a range: a longer list would fill the memory
_SETS = ("held_out", "training")  # map sets by name, besides `map` itself
_RANGE = re.compile(r"(\d{1,18})(?:-(\d{1,18}))?")


class MapSetChoice(NamedTuple):
    """A map set for a robot, on which free space and times depend.

    worlds: the numbers named, or none. choice: the kind of worlds chosen, if the set has several.
    """

    name: str
    maps: MapSet
    worlds: tuple[int, ...]
    choice: str
    robot: Robot


def choose(
    words: Sequence[str], robot: Robot | None = None, configs: Catalogue | None = None
) -> MapSetChoice:
    """Build the map set of these words, as `lme eval` does: its name, and in any order world numbers and settings.

    `map.key=value` is the same as `key=value`, and `0-5` are six numbers. `robot=NAME` and `robot.key=value` replace
    the robot, which is `robot` or else the default of `lme eval`. configs: the shipped ones by default. Raises
    InputError for an unknown or invalid name, number or setting.
    """
    from lme.worlds.barn.map_set import check_given
    from runners.config.instantiate import build

    configs = configs or catalogue.shipped()
    name, *what = words or [""]
    known = configs.titles("map")
    if name not in known:
        raise InputError(f"map set {name!r} is unknown: {nearest(name, known)}There are {', '.join(known)}")
    # Sort the words into settings of the robot, settings of the map set, and world numbers.
    of_robot = [word for word in what if _ROBOT.match(word)]
    settings = [word.removeprefix("map.") for word in what if "=" in word and word not in of_robot]
    numbers = list(dict.fromkeys(number for word in what if "=" not in word for number in _numbers(word)))
    # Build the robot first: a map set's settings may follow it.
    if of_robot or robot is None:
        robot = choose_robot(of_robot, configs)
    node = _node(name, settings, robot, configs)
    check_given((setting.partition("=")[0] for setting in settings), node)
    if numbers:
        node["worlds"] = numbers
    maps = cast(MapSet, build(with_robot(node, robot), "map"))
    choice = next((f"{key} {node[key]}" for key in CHOICES if key in node), "")
    return MapSetChoice(name, maps, tuple(numbers), choice, robot)


def known_path(maps: MapSet, task: Task) -> Floats | None:
    """Return the path (P, 2) [m] from start to goal behind the optimal time; None if only its length is known."""
    return maps.way(task.number) if isinstance(maps, Surveyed) else None


def _numbers(word: str) -> list[int]:
    if re.fullmatch(r"-[0-9]{1,9}", word):
        return [int(word)]  # the map set refuses it with the right values
    if not re.fullmatch(r"[0-9]{1,9}(-[0-9]{1,9})?", word):
        raise InputError(f"{word!r} is neither a world number nor key=value")
    return list(parse_worlds(word, "map.worlds"))


def choose_robot(words: Sequence[str], configs: Catalogue) -> Robot:
    """Return the robot that overrides of `lme eval` choose. Raises InputError."""
    from runners.config.instantiate import fill_dataclass

    names = [word.partition("=")[2] for word in words if word.startswith("robot=")]
    name = names[-1] if names else str(configs.groups("eval")["robot"])
    known = configs.options("robot")
    if name not in known:
        raise InputError(f"robot is {name!r}: {nearest(name, known)}must be one of {', '.join(known)}")
    settings = [word.removeprefix("robot.") for word in words if not word.startswith("robot=")]
    robot: Robot = fill_dataclass(
        Robot, _merged(configs.values(f"robot/{name}"), settings, "robot."), "robot"
    )
    return robot


def _node(name: str, settings: Sequence[str], robot: Robot, configs: Catalogue) -> dict[str, Any]:
    """Return the set's config with the settings. It may refer to other keys of `lme eval`, such as the robot's."""
    from omegaconf import OmegaConf

    merged: Any = OmegaConf.to_container(_merged(configs.values(f"map/{name}"), settings, ""))
    config = {**configs.values("eval"), "robot": asdict(robot)}
    node = resolved("map", merged, config, str(configs.file(f"map/{name}")))
    return {**node, "worlds": parse_worlds(node.get("worlds"), "map.worlds")}


def _merged(written: Mapping[str, Any], settings: Sequence[str], prefix: str) -> Any:
    """Return an unresolved config with other values for some keys. prefix: that of the settings in messages."""
    from omegaconf import OmegaConf
    from omegaconf.errors import GrammarParseError, OmegaConfBaseException
    from yaml import YAMLError

    from runners.config.instantiate import translate_error

    try:
        return OmegaConf.merge(written, OmegaConf.from_dotlist(list(settings)))
    except GrammarParseError as error:
        raise translate_error(error) from error
    except (OmegaConfBaseException, YAMLError, ValueError) as error:
        words = " ".join(f"{prefix}{setting}" for setting in settings)
        raise InputError(f"{words}: must be key=value, as in YAML") from error


def expand_worlds(config: DictConfig) -> None:
    """Write out the ranges of every map set's `worlds` in a composed config.

    A list of numbers stays as it is. Raises InputError.
    """
    sets = [(name, OmegaConf.select(config, name)) for name in _SETS]
    named = [f"{name}.{option}" for name, node in sets if OmegaConf.is_dict(node) for option in node]
    for key in ("map", *named):
        node = OmegaConf.select(config, key)
        if OmegaConf.is_dict(node) and "worlds" in node and not OmegaConf.is_interpolation(node, "worlds"):
            node["worlds"] = parse_worlds(node["worlds"], f"{key}.worlds")


def parse_worlds(worlds: Any, key: str) -> Any:
    """Return the numbers of worlds in order; anything that holds no text and is not a number stays as it is.

    key: key of `worlds`, for messages. Raises InputError for a text that is not a number or a range, for a range that
    runs backwards, and for a world that is listed twice.
    """
    items = list(worlds) if isinstance(worlds, list | tuple) or OmegaConf.is_list(worlds) else [worlds]
    is_number = isinstance(worlds, int) and not isinstance(worlds, bool)
    if not is_number and not any(isinstance(item, str) for item in items):
        return worlds
    numbers = [number for item in items for number in _range_of(item, key)]
    if len(set(numbers)) < len(numbers):
        shown = ",".join(map(str, items))
        raise InputError(f"{key} is [{shown}]: lists a world twice; must be different numbers")
    return numbers


def _range_of(item: Any, key: str) -> range | list[Any]:
    """Return the numbers that an item of the list stands for; an item that is not text stays as it is."""
    if not isinstance(item, str):
        return [item]
    match = _RANGE.fullmatch(item.strip())
    if match is None:
        raise InputError(
            f"{key} has {item!r}: must be numbers and ranges from 0 on, such as 0-49 or [0-9,20,30-39]"
        )
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise InputError(f"{key} has {item}: the range runs backwards; must be {last}-{first}")
    if last - first >= MAX_WORLDS:
        raise InputError(f"{key} has {item}: must be at most {MAX_WORLDS} worlds")
    return range(first, last + 1)
