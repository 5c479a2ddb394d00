"""A rectangle divided into tiles. A tile is a room with the walls on its left and at its bottom."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np

from lme.worlds.indoor.cells import WALL, Rectangle, random_size

DOOR = (16, 22)  # width: 0.8–1.1 m
JAMB = 2  # least wall next to a door: 0.1 m


class Border(NamedTuple):
    """Two neighbouring tiles, by their index in the list, and the wall between their rooms."""

    tiles: tuple[int, int]
    wall: Rectangle


def room(tile: Rectangle) -> Rectangle:
    """The room of a tile."""
    return tile._replace(x0=tile.x0 + WALL, y0=tile.y0 + WALL)


def borders(tiles: Sequence[Rectangle], passage: int) -> list[Border]:
    """The borders of all tiles that are long enough for a door, `passage` cells wide or more."""
    found, least = [], max(passage, DOOR[0]) + 2 * JAMB
    for (i, a), (j, b) in permutations(enumerate(tiles), 2):
        first, second = room(a), room(b)
        x0, y0 = max(first.x0, second.x0), max(first.y0, second.y0)
        x1, y1 = min(first.x1, second.x1), min(first.y1, second.y1)
        if a.x1 == b.x0 and y1 - y0 >= least:
            found.append(Border((i, j), Rectangle(a.x1, y0, second.x0, y1)))
        if a.y1 == b.y0 and x1 - x0 >= least:
            found.append(Border((i, j), Rectangle(x0, a.y1, x1, second.y0)))
    return found


def door(rng: np.random.Generator, wall: Rectangle, passage: int) -> Rectangle:
    """A door at a random place in a wall, at least `passage` cells wide."""
    upright = wall.size[0] == WALL
    length = wall.size[1] if upright else wall.size[0]
    width = min(max(random_size(rng, DOOR), passage), length - 2 * JAMB)
    begin = random_size(rng, (JAMB, length - JAMB - width))
    if upright:
        return wall._replace(y0=wall.y0 + begin, y1=wall.y0 + begin + width)
    return wall._replace(x0=wall.x0 + begin, x1=wall.x0 + begin + width)
