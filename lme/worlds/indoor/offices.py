"""A corridor with furnished rooms on both sides."""

from __future__ import annotations

import numpy as np

from lme.worlds.indoor.layouts import WALL, Building, Rectangle, borders, door, furniture, random_size, room

LENGTH = (240, 397)  # of the corridor: 12–20 m
WIDTH = (24, 50)  # of the corridor: 1.2–2.5 m
DEPTH = (66, 110)  # of the rooms on one side, with a wall: 3.3–5.5 m
FRONT = (56, 112)  # of a room along the corridor, with a wall: 2.8–5.6 m
INNER = 0.2  # probability of a door between neighbouring rooms


def offices(rng: np.random.Generator, passage: int) -> Building:
    """Draw an office building in which every room has a door to the corridor.

    passage: least width of doors and of ways around furniture [cells].
    """
    length, width = random_size(rng, LENGTH), max(random_size(rng, WIDTH), passage)
    low = random_size(rng, DEPTH)
    high = low + WALL + width
    top = high + random_size(rng, DEPTH)
    tiles = [Rectangle(0, low, length, high), *_row(rng, length, 0, low), *_row(rng, length, high, top)]
    if rng.random() < 0.5:
        tiles = [Rectangle(tile.y0, tile.x0, tile.y1, tile.x1) for tile in tiles]
    doors = [
        door(rng, border.wall, passage)
        for border in borders(tiles, passage)
        if 0 in border.tiles or rng.random() < INNER
    ]
    corridor, *rooms = map(room, tiles)
    size = max(tile.x1 for tile in tiles) + WALL, max(tile.y1 for tile in tiles) + WALL
    return Building(size, [corridor, *rooms], doors, furniture(rng, rooms, doors, passage))


def _row(rng: np.random.Generator, length: int, y0: int, y1: int) -> list[Rectangle]:
    """Draw tiles side by side along the corridor."""
    cuts = [0]
    while length - cuts[-1] > FRONT[1]:
        remaining = length - cuts[-1]
        cuts.append(cuts[-1] + random_size(rng, (FRONT[0], min(FRONT[1], remaining - FRONT[0]))))
    return [Rectangle(x0, y0, x1, y1) for x0, x1 in zip(cuts, [*cuts[1:], length], strict=True)]
