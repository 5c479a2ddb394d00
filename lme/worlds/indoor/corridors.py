"""Straight corridors, cut out of solid, that meet at right angles, with turns, junctions, dead ends and a few loops."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from lme.worlds.indoor.layouts import WALL, Building, Rectangle, network, random_size

EXTENT = (300, 400)  # of the network, at most: 15–20 m
WIDTH = (24, 50)  # 1.2–2.5 m
BETWEEN = (20, 80)  # solid between parallel corridors: 1–4 m
SHARE = (0.7, 1.0)  # of the crossings of all lines that the network joins
LOOPS = 0.1  # probability of a corridor that closes a loop

Line = tuple[int, int]  # low and high side of a corridor


def corridors(rng: np.random.Generator, passage: int) -> Building:
    """Draw a random network of corridors. passage: their least width [cells]."""
    columns, rows = _lines(rng, passage), _lines(rng, passage)
    crossings = list(product(range(len(columns)), range(len(rows))))
    number = {crossing: i for i, crossing in enumerate(crossings)}
    pairs = [
        (number[x, y], number[neighbour])
        for x, y in crossings
        for neighbour in ((x + 1, y), (x, y + 1))
        if neighbour in number
    ]
    size = math.ceil(rng.uniform(*SHARE) * len(crossings))
    ends = [[crossings[end] for end in pairs[i]] for i in network(rng, pairs, size, LOOPS)]
    rooms = [
        Rectangle(columns[x0][0], rows[y0][0], columns[x1][1], rows[y1][1]) for (x0, y0), (x1, y1) in ends
    ]
    return Building((columns[-1][1] + WALL, rows[-1][1] + WALL), rooms, [], [])


def _lines(rng: np.random.Generator, passage: int) -> list[Line]:
    """Draw parallel corridors side by side, with solid between them."""
    extent, low = random_size(rng, EXTENT), WALL
    lines: list[Line] = []
    while True:
        high = low + max(random_size(rng, WIDTH), passage)
        if high + WALL > extent:
            return lines
        lines.append((low, high))
        low = high + random_size(rng, BETWEEN)
