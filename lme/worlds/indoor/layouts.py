"""Parts of generated buildings: furniture, the network that connects rooms, and their borders with doors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import NamedTuple

import numpy as np

from lme.types import Floats
from lme.worlds.contours import outlines
from lme.worlds.world import FloorPlan, enclosed

CELL_M = 0.05  # [m] side of a cell
WALL = 3  # cells: walls are 0.15 m thick

Range = tuple[int, int]  # least and greatest number of cells
DESK = (24, 32), (12, 16)  # length and depth: 1.2–1.6 × 0.6–0.8 m
CUPBOARD = (16, 24), (8, 10)  # 0.8–1.2 × 0.4–0.5 m
TABLE = (20, 32), (16, 20)  # 1–1.6 × 0.8–1 m
CHAIR = (4, 5)  # radius: 0.2–0.25 m
FLOOR_PER_PIECE = 1600  # cells of a room for each piece that is tried, at most: 4 m²
DOOR = (16, 22)  # width: 0.8–1.1 m
JAMB = 2  # least wall next to a door: 0.1 m


class Rectangle(NamedTuple):
    """The cells with x0 ≤ x < x1 and y0 ≤ y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def size(self) -> tuple[int, int]:
        """Cells along x and along y."""
        return self.x1 - self.x0, self.y1 - self.y0

    def enlarged(self, cells: int) -> Rectangle:
        """This rectangle, larger by this many cells on every side."""
        return Rectangle(self.x0 - cells, self.y0 - cells, self.x1 + cells, self.y1 + cells)

    def shifted(self, x: int, y: int) -> Rectangle:
        """This rectangle, moved by this many cells along x and y."""
        return Rectangle(self.x0 + x, self.y0 + y, self.x1 + x, self.y1 + y)

    def transposed(self) -> Rectangle:
        """This rectangle with x and y exchanged."""
        return Rectangle(self.y0, self.x0, self.y1, self.x1)

    def meets(self, other: Rectangle) -> bool:
        """Return whether both have a cell in common."""
        return self.x0 < other.x1 and other.x0 < self.x1 and self.y0 < other.y1 and other.y0 < self.y1

    def holds(self, point: Floats) -> bool:
        """Return whether a point (2,) [m] lies in this rectangle."""
        x, y = (point / CELL_M).tolist()
        return bool(self.x0 <= x <= self.x1 and self.y0 <= y <= self.y1)


def random_size(rng: np.random.Generator, bounds: Range) -> int:
    """A random number of cells, from the least to the greatest of `bounds`."""
    return int(rng.integers(*bounds, endpoint=True))


class Piece(NamedTuple):
    """A piece of furniture. chairs: discs, each given by the square around it."""

    boxes: list[Rectangle]
    chairs: list[Rectangle]

    @property
    def floor(self) -> Rectangle:
        """The smallest rectangle around it and its chairs."""
        x0, y0, x1, y1 = zip(*self.boxes, *self.chairs, strict=True)
        return Rectangle(min(x0), min(y0), max(x1), max(y1))


def furniture(
    rng: np.random.Generator, rooms: Sequence[Rectangle], doors: Sequence[Rectangle], passage: int
) -> list[Piece]:
    """Draw pieces in the rooms, at least `passage` cells from each other and from doors.

    Desks and cupboards stand at a wall. Tables and single chairs are at least `passage` cells from any wall.
    """
    pieces: list[Piece] = []
    blocked = [door.enlarged(passage) for door in doors]
    for room in rooms:
        width, height = room.size
        for _ in range(random_size(rng, (0, width * height // FLOOR_PER_PIECE))):
            piece = _piece(rng, room, passage)
            if piece is not None and not any(map(piece.floor.meets, blocked)):
                pieces.append(piece)
                blocked.append(piece.floor.enlarged(passage))
    return pieces


def _piece(rng: np.random.Generator, room: Rectangle, passage: int) -> Piece | None:
    """A random piece at a random place of the room, regardless of other pieces; None if it does not fit."""
    is_turned, is_mirrored = (rng.random(2) < 0.5).tolist()
    width, height = room.size[::-1] if is_turned else room.size
    maker, gap = ((_desk, 0), (_cupboard, 0), (_table, passage), (_chair, passage))[int(rng.integers(4))]
    piece = maker(rng)
    length, depth = piece.floor.size
    if min(width - length, height - depth) < 2 * gap:
        return None
    x = random_size(rng, (gap, width - gap - length))
    y = random_size(rng, (gap, height - gap - depth)) if gap else 0

    def placed(part: Rectangle) -> Rectangle:
        part = part.shifted(x, y)
        if is_mirrored:
            part = part._replace(y0=height - part.y1, y1=height - part.y0)
        return (part.transposed() if is_turned else part).shifted(room.x0, room.y0)

    return Piece([placed(box) for box in piece.boxes], [placed(chair) for chair in piece.chairs])


def _desk(rng: np.random.Generator) -> Piece:
    return _with_chair(rng, *DESK)


def _cupboard(rng: np.random.Generator) -> Piece:
    return Piece([Rectangle(0, 0, random_size(rng, CUPBOARD[0]), random_size(rng, CUPBOARD[1]))], [])


def _table(rng: np.random.Generator) -> Piece:
    return _with_chair(rng, *TABLE)


def _chair(rng: np.random.Generator) -> Piece:
    side = 2 * random_size(rng, CHAIR)
    return Piece([], [Rectangle(0, 0, side, side)])


def _with_chair(rng: np.random.Generator, lengths: Range, depths: Range) -> Piece:
    """A box with its back to y = 0, and a chair that touches its front."""
    length, depth, chair = random_size(rng, lengths), random_size(rng, depths), _chair(rng).floor
    chair_x = random_size(rng, (0, length - chair.x1))
    return Piece([Rectangle(0, 0, length, depth)], [chair.shifted(chair_x, depth)])


@dataclass(frozen=True, slots=True)
class Building:
    """A building whose free space is rooms and doors, less the furniture. size: cells along x and along y."""

    size: tuple[int, int]
    rooms: list[Rectangle]
    doors: list[Rectangle]
    furniture: list[Piece]

    def floor_plan(self) -> FloorPlan:
        """The building in metres, with its lower left corner at the origin."""
        columns, rows = self.size
        solid = np.ones((rows, columns), dtype=bool)
        for free in (*self.rooms, *self.doors):
            solid[free.y0 : free.y1, free.x0 : free.x1] = False
        for box in (box for piece in self.furniture for box in piece.boxes):
            solid[box.y0 : box.y1, box.x0 : box.x1] = True
        chairs = np.array([chair for piece in self.furniture for chair in piece.chairs]).reshape(-1, 4)
        discs = np.column_stack([chairs[:, :2] + chairs[:, 2:], chairs[:, 2] - chairs[:, 0]]) / 2
        corners = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows]]) * CELL_M
        polygons = tuple(outline * CELL_M for outline in outlines(solid))
        return enclosed(corners, discs * CELL_M, np.empty((0, 4)), polygons)


def network(rng: np.random.Generator, pairs: Sequence[tuple[int, int]], size: int, loops: float) -> list[int]:
    """Indices of the pairs that join `size` nodes, or as many as the pairs can join.

    A tree grows from a random node by random pairs. Each other pair of two joined nodes is added with probability
    `loops`, which closes a loop.
    """
    connected = {pairs[int(rng.integers(len(pairs)))][0]}
    tree: list[int] = []
    while len(connected) < size:
        extensions = [i for i, (a, b) in enumerate(pairs) if (a in connected) != (b in connected)]
        if not extensions:
            break
        tree.append(extensions[int(rng.integers(len(extensions)))])
        connected.update(pairs[tree[-1]])
    loop_candidates = [i for i, pair in enumerate(pairs) if i not in tree and connected.issuperset(pair)]
    return sorted([*tree, *(i for i in loop_candidates if rng.random() < loops)])


class Border(NamedTuple):
    """Two neighbouring tiles, by their index in the list, and the wall between their rooms."""

    tiles: tuple[int, int]
    wall: Rectangle


def room(tile: Rectangle) -> Rectangle:
    """The room of a tile."""
    return tile._replace(x0=tile.x0 + WALL, y0=tile.y0 + WALL)


def borders(tiles: Sequence[Rectangle], passage: int) -> list[Border]:
    """The borders of all tiles that are long enough for a door, `passage` cells wide or more."""
    long_borders, min_length = [], max(passage, DOOR[0]) + 2 * JAMB
    for (i, a), (j, b) in permutations(enumerate(tiles), 2):
        first, second = room(a), room(b)
        x0, y0 = max(first.x0, second.x0), max(first.y0, second.y0)
        x1, y1 = min(first.x1, second.x1), min(first.y1, second.y1)
        if a.x1 == b.x0 and y1 - y0 >= min_length:
            long_borders.append(Border((i, j), Rectangle(a.x1, y0, second.x0, y1)))
        if a.y1 == b.y0 and x1 - x0 >= min_length:
            long_borders.append(Border((i, j), Rectangle(x0, a.y1, x1, second.y0)))
    return long_borders


def door(rng: np.random.Generator, wall: Rectangle, passage: int) -> Rectangle:
    """Draw a door at a random place in a wall, at least `passage` cells wide."""
    upright = wall.size[0] == WALL
    length = wall.size[1] if upright else wall.size[0]
    width = min(max(random_size(rng, DOOR), passage), length - 2 * JAMB)
    begin = random_size(rng, (JAMB, length - JAMB - width))
    if upright:
        return wall._replace(y0=wall.y0 + begin, y1=wall.y0 + begin + width)
    return wall._replace(x0=wall.x0 + begin, x1=wall.x0 + begin + width)
