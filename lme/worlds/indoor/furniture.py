"""Desks, cupboards, tables and chairs, with a way around every piece and free doors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lme.worlds.indoor.cells import Range, Rectangle, random_size

DESK = (24, 32), (12, 16)  # length and depth: 1.2–1.6 × 0.6–0.8 m
CUPBOARD = (16, 24), (8, 10)  # 0.8–1.2 × 0.4–0.5 m
TABLE = (20, 32), (16, 20)  # 1–1.6 × 0.8–1 m
CHAIR = (4, 5)  # radius: 0.2–0.25 m
FLOOR_PER_PIECE = 1600  # cells of a room for each piece that is tried, at most: 4 m²


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
    """Random pieces in the rooms, at least `passage` cells from each other and from doors.

    Desks and cupboards stand at a wall. Tables and single chairs are at least `passage` cells from any wall.
    """
    pieces: list[Piece] = []
    taken = [door.enlarged(passage) for door in doors]
    for room in rooms:
        across, up = room.size
        for _ in range(random_size(rng, (0, across * up // FLOOR_PER_PIECE))):
            piece = _piece(rng, room, passage)
            if piece is not None and not any(map(piece.floor.meets, taken)):
                pieces.append(piece)
                taken.append(piece.floor.enlarged(passage))
    return pieces


def _piece(rng: np.random.Generator, room: Rectangle, passage: int) -> Piece | None:
    """A random piece at a random place of the room, regardless of other pieces; None if it does not fit."""
    turned, mirrored = (rng.random(2) < 0.5).tolist()
    width, height = room.size[::-1] if turned else room.size
    make, gap = ((_desk, 0), (_cupboard, 0), (_table, passage), (_chair, passage))[int(rng.integers(4))]
    piece = make(rng)
    length, depth = piece.floor.size
    if min(width - length, height - depth) < 2 * gap:
        return None
    x = random_size(rng, (gap, width - gap - length))
    y = random_size(rng, (gap, height - gap - depth)) if gap else 0

    def placed(part: Rectangle) -> Rectangle:
        part = part.shifted(x, y)
        if mirrored:
            part = part._replace(y0=height - part.y1, y1=height - part.y0)
        return (part.transposed() if turned else part).shifted(room.x0, room.y0)

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
    at = random_size(rng, (0, length - chair.x1))
    return Piece([Rectangle(0, 0, length, depth)], [chair.shifted(at, depth)])
