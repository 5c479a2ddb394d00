"""Clearance of the points of a lattice, and shortest paths between them, with moves in 32 directions.

The clearance takes points at x (X,) and y (Y,), which rise evenly [m], and fills fields (Y, X) [m].
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.geometry.heap import enlarged, pop, push
from lme.types import Bools, Floats, Ints
from lme.worlds.world import FloorPlan

_CROSSED = {  # (rows, columns) of a move: the points on both sides of it, all of which must be free
    (0, 1): (),
    (1, 1): ((0, 1), (1, 0)),
    (1, 2): ((0, 1), (1, 1)),
    (1, 3): ((0, 1), (1, 1), (0, 2), (1, 2)),
    (2, 3): ((0, 1), (1, 1), (1, 2), (2, 2)),
}  # with their mirror images 32 directions, so that a path is at most 1.3 % longer than the straight line
_REACH = 3  # rows or columns of the longest move
_ROOM = 4096  # entries of the heap at first
_ROUNDING = 1e-9  # above the relative rounding error of a squared distance, and of a path's length


def clearance_field(plan: FloorPlan, x: Floats, y: Floats, reach: float) -> Floats:
    """(Y, X) distance of each lattice point to the nearest obstacle [m], at most `reach`.

    Zero in solid obstacles and outside the plan's outline. x (X,) and y (Y,) rise evenly [m].
    """
    field = np.where(inside(plan.outline, x, y), float(reach), 0.0)
    world = plan.world
    _shorten_to_circles(field, x, y, float(reach), np.ascontiguousarray(world.circles, dtype=np.float64))
    _shorten_to_edges(field, x, y, float(reach), world.edges)
    if world.polygons:
        ends = np.cumsum([len(polygon) for polygon in world.polygons])
        _clear_inside(field, x, y, np.vstack(world.polygons, dtype=np.float64), ends)
    return field


def inside(polygon: Floats, x: Floats, y: Floats) -> Bools:
    """Return (Y, X) whether each lattice point lies in a polygon (V, 2), by the even–odd rule."""
    corners = np.ascontiguousarray(polygon, dtype=np.float64)
    is_inside: Bools = _inside(corners, 0, len(corners), x, y)
    return is_inside


@njit(cache=True, error_model="numpy")
def _shorten_to_circles(field, x, y, reach, circles):
    """Shorten the distances (Y, X) to the discs (C, 3)."""
    for i in range(len(circles)):
        centre_x, centre_y, radius = circles[i]
        span = radius + reach
        rows, columns = _window(x, y, centre_x, centre_y, centre_x, centre_y, span)
        for r in range(rows[0], rows[1]):
            for c in range(columns[0], columns[1]):
                # Distance of p to the disc: max(|p − centre| − radius, 0).
                distance = math.hypot(x[c] - centre_x, y[r] - centre_y) - radius
                field[r, c] = min(field[r, c], max(distance, 0.0))


@njit(cache=True, error_model="numpy")
def _shorten_to_edges(field, x, y, reach, edges):
    """Shorten the distances (Y, X) to the edges (E, 4)."""
    for i in range(len(edges)):
        x0, y0, x1, y1 = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        ex, ey = x1 - x0, y1 - y0
        square = ex * ex + ey * ey
        rows, columns = _window(x, y, min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1), reach)
        for r in range(rows[0], rows[1]):
            for c in range(columns[0], columns[1]):
                # Nearest point of the edge: p0 + t e, with t = (p − p0) · e / |e|² clipped to [0, 1].
                dx, dy = x[c] - x0, y[r] - y0
                fraction = min(max((dx * ex + dy * ey) / square, 0.0), 1.0) if square > 0.0 else 0.0
                dx, dy = dx - fraction * ex, dy - fraction * ey
                # Compare squares first, and take the root only where the edge may be nearer.
                if dx * dx + dy * dy < field[r, c] * field[r, c] * (1.0 + _ROUNDING):
                    field[r, c] = min(field[r, c], math.hypot(dx, dy))


@njit(cache=True, error_model="numpy")
def _clear_inside(field, x, y, corners, ends):
    """Set the distances (Y, X) to 0 in polygons.

    corners: (V, 2) of all polygons, one after the other. ends: (P,) index after the last corner of each.
    """
    start = 0
    for stop in ends:
        # Test only the lattice points in the box around the polygon.
        low_x, high_x = corners[start:stop, 0].min(), corners[start:stop, 0].max()
        low_y, high_y = corners[start:stop, 1].min(), corners[start:stop, 1].max()
        rows, columns = _window(x, y, low_x, low_y, high_x, high_y, 0.0)
        covered = _inside(corners, start, stop, x[columns[0] : columns[1]], y[rows[0] : rows[1]])
        for r in range(covered.shape[0]):
            for c in range(covered.shape[1]):
                if covered[r, c]:
                    field[rows[0] + r, columns[0] + c] = 0.0
        start = stop


@njit(cache=True, error_model="numpy")
def _inside(corners, first, last, x, y):
    """Return (Y, X) whether each lattice point lies in the polygon of corners first…last − 1 (even–odd rule)."""
    is_inside = np.zeros((len(y), len(x)), np.bool_)
    for i in range(first, last):
        j = i + 1 if i + 1 < last else first
        x0, y0, x1, y1 = corners[i, 0], corners[i, 1], corners[j, 0], corners[j, 1]
        # In each row that the side crosses, flip the first point that is not left of the crossing,
        # x0 + (y − y0) (x1 − x0) / (y1 − y0).
        for r in range(np.searchsorted(y, min(y0, y1)), np.searchsorted(y, max(y0, y1))):
            column = np.searchsorted(x, x0 + (y[r] - y0) * ((x1 - x0) / (y1 - y0)))
            if column < len(x):
                is_inside[r, column] ^= True
    # Summed along the row, the flips give the parity of the sides to the left of each point.
    for r in range(len(y)):
        for c in range(1, len(x)):
            is_inside[r, c] ^= is_inside[r, c - 1]
    return is_inside


@njit(cache=True, error_model="numpy")
def _window(x, y, low_x, low_y, high_x, high_y, reach):
    """(first, last + 1) rows and columns of the lattice within `reach` of a box."""
    rows = np.searchsorted(y, low_y - reach), np.searchsorted(y, high_y + reach)
    columns = np.searchsorted(x, low_x - reach), np.searchsorted(x, high_x + reach)
    return rows, columns


def shortest_path(free: Bools, step: float, start: Ints, goal: Ints) -> float:
    """Length of the shortest path from one free point [row, column] to another; inf if there is none.

    free: (R, C), whether the robot can be at a point. step: distance between neighbouring points [m], the unit of the
    result.
    """
    _, reached, (_, end) = _searched(free, step, start, goal)
    return float(reached[end])


def shortest_way(free: Bools, step: float, start: Ints, goal: Ints) -> Ints:
    """(N, 2) points [row, column] at which a shortest path turns, with both ends; N = 0 if there is none.

    Arguments are those of `shortest_path`.
    """
    (bordered, width, offsets, lengths), reached, (begin, end) = _searched(free, step, start, goal)
    if not math.isfinite(reached[end]):
        return np.empty((0, 2), dtype=np.int64)
    nodes = _trace_back(bordered, offsets, lengths, reached, begin, end)[::-1]
    points = np.column_stack(np.divmod(nodes, width)) - _REACH
    moves = np.diff(points, axis=0)
    turns = (moves[1:] != moves[:-1]).any(axis=1)
    return np.asarray(points[np.concatenate([[True], turns, [True]])[: len(points)]])


def _searched(
    free: Bools, step: float, start: Ints, goal: Ints
) -> tuple[tuple[Bools, int, Ints, Floats], Floats, tuple[int, int]]:
    """Search for a shortest path from start to goal.

    Returns the lattice with a border, its width and its moves; the lengths [m] of the paths found to its points; and
    both ends.
    """
    bordered = np.pad(free, _REACH)
    width = bordered.shape[1]
    begin, end = ((int(row) + _REACH) * width + int(column) + _REACH for row, column in (start, goal))
    offsets, lengths = _moves(width)
    lattice = (bordered.ravel(), width, offsets, lengths * step)
    return lattice, _search(*lattice[:2], step, *lattice[2:], begin, end), (begin, end)


def _moves(width: int) -> tuple[Ints, Floats]:
    """Steps through the flat lattice (32, 5) to the end of each move and the points beside it; lengths (32,)."""
    offsets, lengths = [], []
    for end, passed in _CROSSED.items():
        points = [end, *passed, *[end] * (4 - len(passed))]
        mirrored = {
            tuple((a * row, b * column) if not swap else (a * column, b * row) for row, column in points)
            for swap in (False, True)
            for a in (1, -1)
            for b in (1, -1)
        }
        for move in sorted(mirrored):
            offsets.append([row * width + column for row, column in move])
            lengths.append(math.hypot(*end))
    return np.array(offsets), np.array(lengths)


@njit(cache=True, error_model="numpy")
def _search(
    free: Bools, width: int, step: float, offsets: Ints, lengths: Floats, start: int, goal: int
) -> Floats:
    """Return the least length found to every point [m], inf for those not reached; that of the goal is the shortest.

    A* (Hart, Nilsson & Raphael 1968, DOI 10.1109/TSSC.1968.300136) with the straight line as the heuristic. It
    continues until no path is left that is equally long but for rounding, so that the shortest length does not depend
    on the order.
    """
    # The heap holds points by f = g + h: the length of the path found so far, and the straight line to the goal.
    g = np.full(free.size, np.inf)
    keys, points = np.empty(_ROOM), np.empty(_ROOM, np.int32)
    g[start] = 0.0
    keys[0], points[0], size = 0.0, start, 1
    while size > 0 and not keys[0] > g[goal] * (1.0 + _ROUNDING):
        key, node = keys[0], points[0]
        size = pop(keys, points, size)
        if size + len(lengths) > len(keys):
            keys, points = enlarged(keys, points)
        if key > g[node] + _straight(node, goal, width) * step:
            continue  # outdated: a shorter path was found later
        # Try all moves from here: one that shortens the path to its end puts that point on the heap.
        for k in range(len(lengths)):
            neighbour = node + offsets[k, 0]
            length = g[node] + lengths[k]
            if length < g[neighbour] and _all_free(free, node, offsets[k]):
                g[neighbour] = length
                size = push(keys, points, size, length + _straight(neighbour, goal, width) * step, neighbour)
    return g


@njit(cache=True, error_model="numpy")
def _trace_back(free: Bools, offsets: Ints, lengths: Floats, reached: Floats, start: int, goal: int) -> Ints:
    """Points of a shortest path from the goal back to the start."""
    nodes = np.empty(free.size, np.int64)
    node, count = goal, 0
    while node != start:
        # Go to the point through which the path to this one is the shortest: the least g + length of the move.
        nodes[count], best = node, np.inf
        count += 1
        for k in range(len(lengths)):  # the moves are symmetric: those to here are those from here
            neighbour = nodes[count - 1] + offsets[k, 0]
            length = reached[neighbour] + lengths[k]
            if length < best and _all_free(free, nodes[count - 1], offsets[k]):
                best, node = length, neighbour
    nodes[count] = start
    path: Ints = nodes[: count + 1]
    return path


@njit(cache=True, error_model="numpy", inline="always")
def _straight(node: int, goal: int, width: int) -> float:
    return math.hypot(node // width - goal // width, node % width - goal % width)


@njit(cache=True, error_model="numpy", inline="always")
def _all_free(free: Bools, node: int, offsets: Ints) -> bool:
    for k in range(len(offsets)):  # noqa: SIM110
        if not free[node + offsets[k]]:
            return False
    return True
