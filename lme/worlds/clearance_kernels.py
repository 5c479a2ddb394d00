"""Distances of the points of a lattice to obstacles: x (X,) and y (Y,) rise evenly [m], fields are (Y, X) [m]."""

import math

import numpy as np
from numba import njit

_ROUNDING = 1e-9  # above the relative rounding error of a squared distance


@njit(cache=True, error_model="numpy")
def shorten_to_circles(field, x, y, reach, circles):
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
def shorten_to_edges(field, x, y, reach, edges):
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
def clear_inside(field, x, y, corners, ends):
    """Set the distances (Y, X) to 0 in polygons.

    corners: (V, 2) of all polygons, one after the other. ends: (P,) index after the last corner of each.
    """
    start = 0
    for stop in ends:
        # Test only the lattice points in the box around the polygon.
        low_x, high_x = corners[start:stop, 0].min(), corners[start:stop, 0].max()
        low_y, high_y = corners[start:stop, 1].min(), corners[start:stop, 1].max()
        rows, columns = _window(x, y, low_x, low_y, high_x, high_y, 0.0)
        covered = inside(corners, start, stop, x[columns[0] : columns[1]], y[rows[0] : rows[1]])
        for r in range(covered.shape[0]):
            for c in range(covered.shape[1]):
                if covered[r, c]:
                    field[rows[0] + r, columns[0] + c] = 0.0
        start = stop


@njit(cache=True, error_model="numpy")
def inside(corners, first, last, x, y):
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
