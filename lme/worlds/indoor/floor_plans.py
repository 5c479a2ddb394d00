"""A rectangle split at random into furnished rooms, again and again (binary space partition), with doors."""

from __future__ import annotations

import math

import numpy as np

from lme.worlds.indoor.layouts import (
    WALL,
    Building,
    Rectangle,
    borders,
    door,
    furniture,
    network,
    random_size,
    room,
)

EXTENT = (240, 397)  # of the whole: 12–20 m
SIDE = 66  # of a room with a wall, at least: 3.3 m
LARGE = 130  # a room with a longer side is split if it can be: 6.5 m
WHOLE = 0.4  # probability that a smaller room stays whole
SHARE = (0.85, 1.0)  # of the rooms that get a door; the others stay solid, so that the outline is irregular
LOOPS = 0.25  # probability of a door that closes a loop


def floor_plans(rng: np.random.Generator, passage: int) -> Building:
    """Draw rooms joined by doors. passage: least width of doors and of ways around furniture [cells]."""
    columns, rows = random_size(rng, EXTENT), random_size(rng, EXTENT)
    tiles = _split(rng, Rectangle(0, 0, columns, rows))
    shared = borders(tiles, passage)
    size = math.ceil(rng.uniform(*SHARE) * len(tiles))
    joined_borders = [shared[i] for i in network(rng, [border.tiles for border in shared], size, LOOPS)]
    rooms = [room(tiles[i]) for i in sorted({i for border in joined_borders for i in border.tiles})]
    doors = [door(rng, border.wall, passage) for border in joined_borders]
    return Building((columns + WALL, rows + WALL), rooms, doors, furniture(rng, rooms, doors, passage))


def _split(rng: np.random.Generator, tile: Rectangle) -> list[Rectangle]:
    """The tile, or the tiles that it is split into, mostly across its longer side."""
    width, height = tile.size
    upright = width * rng.uniform(0.7, 1.4) > height
    length = width if upright else height
    if length < 2 * SIDE or (max(width, height) < LARGE and rng.random() < WHOLE):
        return [tile]
    cut = random_size(rng, (SIDE, length - SIDE))
    if upright:
        halves = tile._replace(x1=tile.x0 + cut), tile._replace(x0=tile.x0 + cut)
    else:
        halves = tile._replace(y1=tile.y0 + cut), tile._replace(y0=tile.y0 + cut)
    return [part for half in halves for part in _split(rng, half)]
