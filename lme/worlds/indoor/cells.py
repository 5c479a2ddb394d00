"""Rectangles on a grid of cells. All lengths of a generated building are whole numbers of cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lme.types import Floats

CELL_M = 0.05  # [m] side of a cell
WALL = 3  # cells: walls are 0.15 m thick

Range = tuple[int, int]  # least and greatest number of cells


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
        """Whether both have a cell in common."""
        return self.x0 < other.x1 and other.x0 < self.x1 and self.y0 < other.y1 and other.y0 < self.y1

    def holds(self, place: Floats) -> bool:
        """Whether a place (2,) [m] lies in this rectangle."""
        x, y = (place / CELL_M).tolist()
        return bool(self.x0 <= x <= self.x1 and self.y0 <= y <= self.y1)


def random_size(rng: np.random.Generator, bounds: Range) -> int:
    """A random number of cells, from the least to the greatest of `bounds`."""
    return int(rng.integers(*bounds, endpoint=True))
