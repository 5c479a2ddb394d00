"""Places on a polyline: the nearest, those at even steps, the one where it leaves a disc."""

import math

import numpy as np
from numba import njit

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def project(line: Floats, x: float, y: float) -> tuple[float, float, int]:
    """Where the polyline (K, 2), K ≥ 1, comes nearest to (x, y): the first such place.

    Returns the way to there along the line [m], the distance from there [m] and the segment's number.
    """
    best, along, segment = (line[0, 0] - x) ** 2 + (line[0, 1] - y) ** 2, 0.0, 0
    passed = 0.0
    for i in range(len(line) - 1):
        ex, ey = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
        length = math.sqrt(ex * ex + ey * ey)
        if length > 0.0:
            part = ((x - line[i, 0]) * ex + (y - line[i, 1]) * ey) / (length * length)
            part = min(max(part, 0.0), 1.0)
            square = (line[i, 0] + part * ex - x) ** 2 + (line[i, 1] + part * ey - y) ** 2
            if square < best:
                best, along, segment = square, passed + part * length, i
        passed += length
    return along, math.sqrt(best), segment


@njit(cache=True, error_model="numpy")
def stretch(line: Floats, begin: float, end: float, spacing: float) -> Floats:
    """Points along the polyline (K, 2), evenly from `begin` (left out) to `end` (there) [m] of its way.

    (P, 2), no two further apart than `spacing` along the line; none where end ≤ begin. The way ends where the
    line does.
    """
    length = 0.0
    for i in range(len(line) - 1):
        length += math.sqrt((line[i + 1, 0] - line[i, 0]) ** 2 + (line[i + 1, 1] - line[i, 1]) ** 2)
    end = min(end, length)
    count = max(math.ceil((end - begin) / spacing - 1e-9), 0)
    out = np.empty((count, 2))
    i, passed = 0, 0.0
    for k in range(count):
        wanted = begin + (end - begin) * (k + 1) / count
        out[k, 0], out[k, 1] = line[-1, 0], line[-1, 1]
        while i < len(line) - 1:
            ex, ey = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
            length = math.sqrt(ex * ex + ey * ey)
            if length > 0.0 and passed + length >= wanted:
                part = (wanted - passed) / length
                out[k, 0], out[k, 1] = line[i, 0] + part * ex, line[i, 1] + part * ey
                break
            passed += length
            i += 1
    return out


@njit(cache=True, error_model="numpy")
def leaves(line: Floats, radius: float) -> tuple[float, float, float]:
    """Where the polyline (K, 2), K ≥ 1, first leaves the disc of `radius` [m] about its first point.

    Returns x and y there, or at the line's end where it stays inside, and the length of the whole line [m].
    """
    x, y = line[-1, 0], line[-1, 1]
    length, found = 0.0, False
    for i in range(len(line) - 1):
        ax, ay = line[i, 0] - line[0, 0], line[i, 1] - line[0, 1]
        ex, ey = line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1]
        square = ex * ex + ey * ey
        length += math.sqrt(square)
        if not found and (ax + ex) ** 2 + (ay + ey) ** 2 > radius * radius:
            half = ax * ex + ay * ey
            root = math.sqrt(max(half * half + square * (radius * radius - ax * ax - ay * ay), 0.0))
            part = (root - half) / square
            x, y, found = line[i, 0] + part * ex, line[i, 1] + part * ey, True
    return x, y, length
