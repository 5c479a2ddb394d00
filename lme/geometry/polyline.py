"""Points on a polyline: the nearest one, evenly spaced ones, and the one where it leaves a disc."""

import math

import numpy as np
from numba import njit

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def project(line: Floats, x: float, y: float) -> tuple[float, float, int]:
    """Find the first point of the polyline (K, 2), K ≥ 1, that is nearest to (x, y).

    Returns its distance along the line [m], its distance from (x, y) [m] and the index of its segment.
    """
    best, along, segment = (line[0, 0] - x) ** 2 + (line[0, 1] - y) ** 2, 0.0, 0
    travelled = 0.0
    for i in range(len(line) - 1):
        ex, ey = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length > 0.0:
            # Foot of the perpendicular on the segment: t = (p − a) · e / |e|², limited to [0, 1].
            part = ((x - line[i, 0]) * ex + (y - line[i, 1]) * ey) / (length * length)
            part = min(max(part, 0.0), 1.0)
            square = (line[i, 0] + part * ex - x) ** 2 + (line[i, 1] + part * ey - y) ** 2
            if square < best:
                best, along, segment = square, travelled + part * length, i
        travelled += length
    return along, math.sqrt(best), segment


@njit(cache=True, error_model="numpy")
def stretch(line: Floats, begin: float, end: float, spacing: float) -> Floats:
    """Evenly spaced points along the polyline (K, 2), from `begin` (excluded) to `end` (included) [m]: (P, 2).

    Neighbours are at most `spacing` apart along the line; P = 0 if end ≤ begin. `end` is limited to the length.
    """
    # Length of the line, which limits the end.
    length = 0.0
    for i in range(len(line) - 1):
        length += math.sqrt((line[i + 1, 0] - line[i, 0]) ** 2 + (line[i + 1, 1] - line[i, 1]) ** 2)
    end = min(end, length)
    count = max(math.ceil((end - begin) / spacing - 1e-9), 0)
    points = np.empty((count, 2))
    i, travelled = 0, 0.0
    for k in range(count):
        position = begin + (end - begin) * (k + 1) / count
        points[k, 0], points[k, 1] = line[-1, 0], line[-1, 1]
        # Move on to the segment that holds the wanted distance, and interpolate on it.
        while i < len(line) - 1:
            ex, ey = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
            length = math.sqrt(ex * ex + ey * ey)
            if length > 0.0 and travelled + length >= position:
                part = (position - travelled) / length
                points[k, 0], points[k, 1] = line[i, 0] + part * ex, line[i, 1] + part * ey
                break
            travelled += length
            i += 1
    return points


@njit(cache=True, error_model="numpy")
def exit_point(line: Floats, radius: float) -> tuple[float, float, float]:
    """Find where the polyline (K, 2), K ≥ 1, first leaves the disc of `radius` [m] about its first point.

    Returns its x and y, or those of the line's end if it stays inside, and the length of the whole line [m].
    """
    x, y = line[-1, 0], line[-1, 1]
    length, has_left = 0.0, False
    for i in range(len(line) - 1):
        ax, ay = line[i, 0] - line[0, 0], line[i, 1] - line[0, 1]
        ex, ey = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
        square = ex * ex + ey * ey
        length += math.sqrt(square)
        if not has_left and (ax + ex) ** 2 + (ay + ey) ** 2 > radius * radius:
            # Greater root t of |a + t e|² = r²: t = (√((a · e)² + |e|² (r² − |a|²)) − a · e) / |e|².
            half = ax * ex + ay * ey
            root = math.sqrt(max(half * half + square * (radius * radius - ax * ax - ay * ay), 0.0))
            part = (root - half) / square
            x, y, has_left = line[i, 0] + part * ex, line[i, 1] + part * ey, True
    return x, y, length


def evenly_spaced(line: Floats, spacing: float) -> Floats:
    """Points (P, 2), P ≥ 2, at equal distances of at most `spacing` [m] along the polyline (K, 2), ends included."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    points: Floats = _sampled(line, along, max(2, math.ceil(along[-1] / spacing) + 1))
    return points


@njit(cache=True, error_model="numpy")
def _sampled(line: Floats, along: Floats, count: int) -> Floats:
    """Points (count, 2) at equal distances on the polyline (K, 2), ends included; along (K,): distance of its points.

    It does what np.linspace and np.interp do, at once for both axes.
    """
    points = np.empty((count, 2))
    step, last, i = along[-1] / (count - 1), len(line) - 1, 0
    for k in range(count):
        position = k * step if k < count - 1 else along[-1]
        while i < last and along[i + 1] <= position:
            i += 1
        points[k, 0], points[k, 1] = line[i, 0], line[i, 1]
        if position > along[i] and i < last:
            for axis in range(2):
                slope = (line[i + 1, axis] - line[i, axis]) / (along[i + 1] - along[i])
                points[k, axis] = slope * (position - along[i]) + line[i, axis]
    return points
