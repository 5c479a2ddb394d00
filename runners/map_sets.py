"""Map sets by name, with settings and world numbers: what `lme maps` and `lme figure maps` are told."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import MapSet, Task
from runners import catalogue
from runners.mistakes import nearest
from runners.pictures.scene import Box

GRAMMAR = "NAME [NUMBER…] [key=value…]"
CHOICES = ("subset", "kind", "difficulty")  # settings that say which of a set's worlds there are
SIDES = 24  # of the outline of a disc


class Chosen(NamedTuple):
    """A map set. worlds: the numbers named, or none. choice: which of its worlds, where it comes in kinds."""

    name: str
    maps: MapSet
    worlds: tuple[int, ...]
    choice: str


def titles() -> dict[str, str]:
    """Every map set that ships, with the first comment line of its file."""
    shipped = catalogue.shipped()
    return {name: shipped.title(f"map/{name}") for name in shipped.options("map")}


def choose(words: Sequence[str]) -> Chosen:
    """Build the map set of these words: its name, and in any order world numbers and settings.

    `map.key=value` is the same as `key=value`. Raises InputError for a name, a number or a setting that is not
    there, or not right.
    """
    from runners.targets import build

    name, *what = words or [""]
    known = titles()
    if name not in known:
        raise InputError(f"map set {name!r} is unknown: {nearest(name, known)}There are {', '.join(known)}")
    settings = [word for word in what if "=" in word]
    numbers = list(dict.fromkeys(_number(word) for word in what if "=" not in word))
    node = _node(name, [setting.removeprefix("map.") for setting in settings])
    if numbers:
        node["worlds"] = numbers
    maps = cast(MapSet, build(node, "map"))
    choice = next((f"{key} {node[key]}" for key in CHOICES if key in node), "")
    return Chosen(name, maps, tuple(numbers), choice)


def known_path(maps: MapSet, task: Task) -> Floats | None:
    """(P, 2) the way from start to goal that the optimal time counts [m]; None where only its length is known.

    BARN's leads through the middles of its cells; the scripts that score measure it (−0.15, −0.10) m beside them.
    """
    from lme.worlds.barn import Barn
    from lme.worlds.barn_generator import CELL_M, ORIGIN_X_M, ORIGIN_Y_M

    if not isinstance(maps, Barn):
        return None
    cells = maps.layout(task.number).path * CELL_M + np.array([ORIGIN_X_M, ORIGIN_Y_M])
    return np.vstack([[task.start.x, task.start.y], cells, task.goal])


def extent(task: Task) -> Box:
    """The box around all obstacles, movers where they stand at first, start and goal."""
    world = task.world
    centres, radii = world.circles[:, :2], world.circles[:, 2:]
    ends = np.array([task.start[:2], task.goal])
    solid = [centres - radii, centres + radii, world.edges.reshape(-1, 2)]
    points = np.vstack([ends, *solid, *(mover_outline(mover) for mover in world.movers)])
    return Box(*points.min(axis=0).tolist(), *points.max(axis=0).tolist())


def mover_outline(mover: Mover) -> Floats:
    """(V, 2) corners of a mover where it stands at first [m]; a disc's are so many that it looks round."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    outline = mover.outline
    if outline is None:
        outline = (mover.radius or 0.0) * np.column_stack([np.cos(angles), np.sin(angles)])
    return to_world(outline, Pose(*mover.path[0].tolist()))


def metres(task: Task) -> str:
    """How large a world is, start and goal included, to half a metre, in words."""
    box = extent(task)
    return " × ".join(f"{round(2 * side) / 2:g}" for side in (box.x1 - box.x0, box.y1 - box.y0)) + " m"


def about_set(chosen: Chosen, task: Task) -> str:
    """Size of the world shown, and on a second line how many there are."""
    count = len(chosen.maps.numbers)
    choice = f", {chosen.choice}" if chosen.choice else ""
    return f"{metres(task)}\n{count} world{'s' * (count > 1)}{choice}"


def _number(word: str) -> int:
    if not re.fullmatch(r"-?[0-9]{1,9}", word):
        raise InputError(f"{word!r} is neither a world number nor key=value")
    return int(word)


def _node(name: str, settings: Sequence[str]) -> Any:
    """The set's config with its settings."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    try:
        given = OmegaConf.from_dotlist(list(settings))
        return OmegaConf.merge(OmegaConf.load(catalogue.shipped().file(f"map/{name}")), given)
    except (OmegaConfBaseException, YAMLError, ValueError) as error:
        raise InputError(f"{' '.join(settings)}: must be key=value, as in YAML") from error
