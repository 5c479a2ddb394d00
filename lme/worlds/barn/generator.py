"""BARN worlds by cellular automaton: the grid, its cylinders, and the recipes of the official worlds.

The grid has 30 × 30 cells of 0.15 m: row r runs across the robot's way (x), column c along it (y).
Source: Perille et al. 2020, arXiv:2008.13315; the published worlds are regenerated cylinder for cylinder.
"""

from __future__ import annotations

import csv
import hashlib
import random
from functools import cache
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from lme.inputs.resources import resource_dir
from lme.types import Bools, Floats

GRID_CELLS = 30  # rows and columns
CELL_M = 0.15
CYLINDER_RADIUS_M = 0.075
ORIGIN_X_M, ORIGIN_Y_M = -4.425, 5.175  # centre of cell (0, 0)
WALL_X_M, WALL_Y_M = -0.075, 0.075  # first cylinder of the wall around the start
WALL_ROWS = 33  # pairs of cylinders left and right of the start area

FILLS = (0.15, 0.20, 0.25, 0.30)
SMOOTHINGS = (2, 3, 4)

_FILL_AT, _CLEAR_AT = 5, 1  # neighbours that fill a cell, or clear it
_NEIGHBOURHOOD = np.ones((3, 3), dtype=np.bool_)


class Recipe(NamedTuple):
    """The parameters of one world: random seed, share of cells filled at first, smoothing rounds."""

    seed: int
    fill: float
    smoothings: int


@cache
def official_recipes() -> dict[int, Recipe]:
    """The recipes of the 300 published worlds, by official number."""
    with (resource_dir("maps") / "barn" / "seeds.csv").open(newline="", encoding="utf-8") as file:
        return {
            int(row["world"]): Recipe(int(row["seed"]), float(row["fill"]), int(row["smoothings"]))
            for row in csv.DictReader(file)
        }


def occupancy(recipe: Recipe) -> tuple[Bools, random.Random]:
    """The filled cells (30, 30), and the random stream after the automaton's draws."""
    rng = random.Random(recipe.seed)
    grid = _first_fill(rng, recipe.fill)
    for _ in range(recipe.smoothings):
        grid = _smoothed(grid)
    return grid, rng


def cylinders_of(grid: Bools) -> Floats:
    """(C, 3) cylinders [x, y, radius] [m] in the published order: the wall around the start, then the grid.

    A filled cell has a cylinder only if it lies on the border of the grid or has an empty neighbour.
    """
    surface = grid & ~ndimage.binary_erosion(grid, _NEIGHBOURHOOD, border_value=0)
    cells = np.argwhere(surface)
    centres = np.column_stack([ORIGIN_X_M + CELL_M * cells[:, 0], ORIGIN_Y_M + CELL_M * cells[:, 1]])
    return np.vstack([start_wall(), _discs(centres)])


def start_wall() -> Floats:
    """(96, 3) cylinders [x, y, radius] [m] around the start area; the same in all worlds."""
    right = [(WALL_X_M - CELL_M * i, WALL_Y_M) for i in range(GRID_CELLS)]
    left_x = WALL_X_M - CELL_M * (GRID_CELLS - 1)
    sides = [(x, WALL_Y_M + CELL_M * j) for j in range(1, WALL_ROWS + 1) for x in (WALL_X_M, left_x)]
    return _discs(np.array(right + sides))


def grid_from(cylinders: Floats) -> Bools:
    """The cells (30, 30) that cylinders (C, 3) [m] fill; cylinders outside the grid are ignored.

    Enclosed cells count as filled, because solid regions have no cylinders inside.
    """
    rows = np.rint((cylinders[:, 0] - ORIGIN_X_M) / CELL_M)
    columns = np.rint((cylinders[:, 1] - ORIGIN_Y_M) / CELL_M)
    inside = (rows >= 0) & (rows < GRID_CELLS) & (columns >= 0) & (columns < GRID_CELLS)
    grid = np.zeros((GRID_CELLS, GRID_CELLS), dtype=np.bool_)
    grid[rows[inside].astype(int), columns[inside].astype(int)] = True
    return np.asarray(ndimage.binary_fill_holes(grid), dtype=np.bool_)


def cylinders_digest(cylinders: Floats) -> str:
    """SHA-256 of one line "x y radius" per cylinder, in order, each number [m] with six decimals."""
    lines = [f"{x:.6f} {y:.6f} {radius:.6f}\n" for x, y, radius in cylinders]
    return hashlib.sha256("".join(lines).encode("ascii")).hexdigest()


def _first_fill(rng: random.Random, fill: float) -> Bools:
    """The first grid: the first and last row are filled without a draw, the other cells are drawn one by one."""
    grid = np.ones((GRID_CELLS, GRID_CELLS), dtype=np.bool_)
    inner = GRID_CELLS - 2
    grid[1:-1] = _draws(rng, inner * GRID_CELLS).reshape(inner, GRID_CELLS) < fill
    return grid


def _draws(rng: random.Random, count: int) -> Floats:
    """The next `count` values of `rng.random()`, several times as fast: fresh worlds take hundreds of attempts.

    A value consists of the upper 27 and 26 bits of two 32-bit words; `getrandbits` gives the same words, first the
    least significant ones.
    """
    words = np.frombuffer(rng.getrandbits(64 * count).to_bytes(8 * count, "little"), dtype="<u4")
    upper, lower = words[::2] >> 5, words[1::2] >> 6
    return (upper * 2.0**26 + lower) / 2.0**53


def _smoothed(grid: Bools) -> Bools:
    """Smooth all cells at once. Cells beyond the first and last row count as filled, other outer cells as empty."""
    padded = np.zeros((GRID_CELLS + 2, GRID_CELLS + 2), dtype=np.int8)
    padded[0] = padded[-1] = 1
    padded[1:-1, 1:-1] = grid
    # The sum of the 3 × 3 cells around each, without the cell itself.
    columns = padded[:, :-2] + padded[:, 1:-1] + padded[:, 2:]
    neighbours = columns[:-2] + columns[1:-1] + columns[2:] - grid
    smoothed: Bools = (neighbours >= _FILL_AT) | (grid & (neighbours > _CLEAR_AT))
    return smoothed


def _discs(centres: Floats) -> Floats:
    """(C, 3) cylinders at the centres (C, 2) [m], rounded to six decimals as in the published files."""
    return np.column_stack([np.round(centres, 6), np.full(len(centres), CYLINDER_RADIUS_M)])
