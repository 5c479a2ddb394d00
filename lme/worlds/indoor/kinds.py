"""The kinds of generated buildings: corridors, offices, and floor plans that are split at random."""

from __future__ import annotations

import math
from itertools import product

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

CORRIDOR_WIDTH = (24, 50)  # 1.2–2.5 m

NETWORK_EXTENT = (300, 400)  # of corridors, at most: 15–20 m
BETWEEN = (20, 80)  # solid between parallel corridors: 1–4 m
JOINED_CROSSINGS = (0.7, 1.0)  # share of the crossings of all lines that the network joins
CORRIDOR_LOOPS = 0.1  # probability of a corridor that closes a loop

OFFICE_LENGTH = (240, 397)  # of the corridor: 12–20 m
DEPTH = (66, 110)  # of the rooms on one side, with a wall: 3.3–5.5 m
FRONT = (56, 112)  # of a room along the corridor, with a wall: 2.8–5.6 m
INNER = 0.2  # probability of a door between neighbouring rooms

PLAN_EXTENT = (240, 397)  # of a whole floor plan: 12–20 m
SIDE = 66  # of a room with a wall, at least: 3.3 m
LARGE = 130  # a room with a longer side is split if it can be: 6.5 m
WHOLE = 0.4  # probability that a smaller room stays whole
JOINED_ROOMS = (0.85, 1.0)  # share of the rooms with a door; the others stay solid, for an irregular outline
DOOR_LOOPS = 0.25  # probability of a door that closes a loop

Line = tuple[int, int]  # low and high side of a corridor


def corridors(rng: np.random.Generator, passage: int) -> Building:
    """Draw a random network of straight corridors, cut out of solid, that meet at right angles.

    It has turns, junctions, dead ends and a few loops. passage: least width of a corridor [cells].
    """
    columns, rows = _lines(rng, passage), _lines(rng, passage)
    crossings = list(product(range(len(columns)), range(len(rows))))
    number = {crossing: i for i, crossing in enumerate(crossings)}
    pairs = [
        (number[x, y], number[neighbour])
        for x, y in crossings
        for neighbour in ((x + 1, y), (x, y + 1))
        if neighbour in number
    ]
    size = math.ceil(rng.uniform(*JOINED_CROSSINGS) * len(crossings))
    ends = [[crossings[end] for end in pairs[i]] for i in network(rng, pairs, size, CORRIDOR_LOOPS)]
    rooms = [
        Rectangle(columns[x0][0], rows[y0][0], columns[x1][1], rows[y1][1]) for (x0, y0), (x1, y1) in ends
    ]
    return Building((columns[-1][1] + WALL, rows[-1][1] + WALL), rooms, [], [])


def _lines(rng: np.random.Generator, passage: int) -> list[Line]:
    """Draw parallel corridors side by side, with solid between them."""
    extent, low = random_size(rng, NETWORK_EXTENT), WALL
    lines: list[Line] = []
    while True:
        high = low + max(random_size(rng, CORRIDOR_WIDTH), passage)
        if high + WALL > extent:
            return lines
        lines.append((low, high))
        low = high + random_size(rng, BETWEEN)


def offices(rng: np.random.Generator, passage: int) -> Building:
    """Draw an office building: a corridor with furnished rooms on both sides, each with a door to it.

    passage: least width of doors and of ways around furniture [cells].
    """
    length, width = random_size(rng, OFFICE_LENGTH), max(random_size(rng, CORRIDOR_WIDTH), passage)
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


def floor_plans(rng: np.random.Generator, passage: int) -> Building:
    """Split a rectangle at random into furnished rooms (binary space partition), and join them by doors.

    passage: least width of doors and of ways around furniture [cells].
    """
    columns, rows = random_size(rng, PLAN_EXTENT), random_size(rng, PLAN_EXTENT)
    tiles = _split(rng, Rectangle(0, 0, columns, rows))
    shared = borders(tiles, passage)
    size = math.ceil(rng.uniform(*JOINED_ROOMS) * len(tiles))
    joined_borders = [shared[i] for i in network(rng, [border.tiles for border in shared], size, DOOR_LOOPS)]
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
