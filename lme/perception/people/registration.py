"""A scan beside earlier ones: the evidence of motion in it, and its registration.

Something has moved if it is where a beam of an earlier scan passed, unless something stood there before. A scan is
registered on an earlier one point to line, with the odometry as a prior.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.fan import bearing
from lme.types import Bools, Floats, Ints

_TAU = 2.0 * math.pi
_CHORD = 0.2  # [m] over which a normal is measured; noise tilts shorter ones
_MIN_CHORD = 0.1  # [m] of a small thing
_FARTHEST = 10  # beams to either side
_GAP = 0.3  # [m] between beams that hit the same surface
_MATCHED = (0.25, 0.2, 0.15, 0.1, 0.1)  # [m] greatest distance from a line, in each iteration
_YAW_DEVIATIONS = 2.5  # standard deviations of the yaw by odometry that are searched
_MAX_RANGE_ERROR = 0.3  # [m] a range that differs more is of another surface
_SAMPLES = 480  # points that are used
_CORRELATED = 4.0  # neighbouring points err alike
_MISSING_VOTES = 3  # of scans in which a beam without a return is free: surfaces flicker
_FLICKER = 0.1  # share of standing points missed before; if a lidar misses more, missing returns are ignored
_FADING = 0.98  # share of the counts that is kept from scan to scan
CELLS = 512  # along a side of the grid of what stood
_CELL = 0.1  # [m] side of one


class NewestScan(NamedTuple):
    """The newest scan, for kernels: a row per beam.

    points (B, 2): in the tracker's frame; hits (B,): whether the beam returned; moved (B,): whether the place was
    empty before; stands (B,): whether something stood there before; owner (B,): name of the track, −1 for none.
    movers (N,): whether the track of a name, modulo N, has been confirmed.
    """

    points: Floats
    hits: Bools
    moved: Bools
    stands: Bools
    owner: Ints
    movers: Bools


@njit(cache=True, error_model="numpy")
def unpacked(ranges, directions, limits, missing, guard_beams):
    """Unpack a scan: points (B, 2) in the lidar's frame, hits (B,), and free ranges (B,) and (B,) [m].

    A free range is the least one of the beams up to `guard_beams` to either side. A beam without a return is free up
    to `missing` [m] in the second array, and not at all in the first. A beam that failed (NaN) is never free.
    directions (B, 2); limits: range_min, range_max [m].
    """
    count = len(ranges)
    points, hits, reach = np.empty((count, 2)), np.zeros(count, np.bool_), np.empty(count)
    # Hits and points, and how far each beam alone is free.
    for i in range(count):
        measured = float(ranges[i])
        hits[i] = limits[0] <= measured < limits[1]
        reach[i] = measured if hits[i] else 0.0 if math.isnan(measured) else missing
        points[i, 0], points[i, 1] = reach[i] * directions[i, 0], reach[i] * directions[i, 1]
    sure_ranges, free_ranges = np.empty(count), np.empty(count)
    for i in range(count):
        # The least of the neighbours, which is sure if all of them have a return.
        min_range, all_hit = reach[i], True
        for j in range(max(i - guard_beams, 0), min(i + guard_beams + 1, count)):
            min_range, all_hit = min(min_range, reach[j]), all_hit and hits[j]
        free_ranges[i] = min_range
        sure_ranges[i] = min_range if all_hit else 0.0
    return points, hits, sure_ranges, free_ranges


@njit(cache=True, error_model="numpy", inline="always")
def beam_towards(x, y, angles, count):
    """Beam nearest to a place in the lidar's frame, −1 outside the field of view. angles: first, step [rad]."""
    turn = (bearing(x, y) - angles[0] + 0.5 * angles[1]) / _TAU
    beam = int((turn - math.floor(turn)) * _TAU / angles[1])
    return beam if beam < count else -1


@njit(cache=True, error_model="numpy", inline="always")
def into(x, y, pose, cos, sin):
    """Transform a place from the parent frame to the frame at `pose`; cos, sin: of its yaw."""
    dx, dy = x - pose[0], y - pose[1]
    return cos * dx + sin * dy, cos * dy - sin * dx


@njit(cache=True, error_model="numpy")
def passed_through(positions, view, margin):
    """Return whether a scan saw through each place (P, 2) [m]: 1 yes, −1 no, 0 not known, as behind something.

    view: the scan's pose in the frame of the positions, its free ranges (B,) and (B,), see `unpacked`, and the beams'
    first angle and step [rad]. Yes: the beam ends `margin` [m] behind the place. No: it ends near it.
    """
    lidar, sure_ranges, free_ranges, angles = view
    verdicts = np.zeros(len(positions), np.int8)
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for i in range(len(positions)):
        # Where the beam towards the place ends, compared with the place.
        x, y = into(positions[i, 0], positions[i, 1], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(free_ranges))
        if beam < 0:
            continue
        distance = math.sqrt(x * x + y * y)
        if sure_ranges[beam] > distance + margin:
            verdicts[i] = 1
        elif abs(free_ranges[beam] - distance) <= 2.0 * margin:
            verdicts[i] = -1
    return verdicts


@njit(cache=True, error_model="numpy")
def weigh(points, hits, view, margin, votes):
    """Add what an earlier scan says about each point (B, 2) with a hit (B,) to `votes` (B, 2).

    votes: number of scans that saw through its place, and of those that did if a beam without a return is free. view:
    of the earlier scan, see `passed_through`.
    """
    lidar, sure_ranges, free_ranges, angles = view
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for i in range(len(points)):
        if not hits[i]:
            continue
        # The earlier beam towards the point; it saw through the place if it ended behind it.
        x, y = into(points[i, 0], points[i, 1], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(free_ranges))
        if beam < 0:
            continue
        distance = math.sqrt(x * x + y * y)
        if sure_ranges[beam] > distance + margin:
            votes[i, 0] += 1
        elif free_ranges[beam] > distance + margin:
            votes[i, 1] += 1


@njit(cache=True, error_model="numpy")
def flickered(votes, stands, counts):
    """Update the numbers of standing points, and of those that a beam without a return missed before.

    votes (B, 2): see `weigh`; stands (B,): whether a point stands. The former `counts` fade.
    """
    standing, missing = _FADING * counts[0], _FADING * counts[1]
    for i in range(len(votes)):
        if stands[i]:
            standing += 1.0
            missing += votes[i, 1] > 0
    return standing, missing


@njit(cache=True, error_model="numpy")
def moved_points(votes, stands, counts):
    """Return whether each point (B,) has moved, by the votes of earlier scans; not where something stood before (B,).

    counts: numbers of points that stand and that were missed before, see `flickered`.
    """
    trusted = counts[1] <= _FLICKER * counts[0]
    has_moved = np.zeros(len(votes), np.bool_)
    for i in range(len(votes)):
        has_moved[i] = (votes[i, 0] > 0 or (trusted and votes[i, 1] >= _MISSING_VOTES)) and not stands[i]
    return has_moved


@njit(cache=True, error_model="numpy")
def remember(stood, points, hits, owner, movers, time):
    """Note in `stood` (CELLS, CELLS) the time at which something returned that is not known to move.

    points (B, 2), hits (B,), owner (B,): of a scan taken at `time` [s], with the track of each point.
    """
    for i in range(len(points)):
        if hits[i] and (owner[i] < 0 or not movers[owner[i] % len(movers)]):
            column, row = _cell(points[i, 0]), _cell(points[i, 1])
            stood[row % CELLS, column % CELLS] = time


@njit(cache=True, error_model="numpy")
def recall(stood, points, hits, since):
    """Return whether each point (B, 2) is where something stood after a time [s]: (B,)."""
    stands = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if hits[i]:
            column, row = _cell(points[i, 0] - 0.5 * _CELL), _cell(points[i, 1] - 0.5 * _CELL)
            # Any of the four cells around the point.
            for k in range(2):
                for m in range(2):
                    stands[i] |= stood[(row + k) % CELLS, (column + m) % CELLS] >= since
    return stands


@njit(cache=True, error_model="numpy", inline="always")
def _cell(x):
    return math.floor(x / _CELL)


@njit(cache=True, error_model="numpy")
def normals(points, hits):
    """Unit normals (B, 2) of the surfaces that a scan shows; NaN where there is no surface."""
    count = len(points)
    unit_normals = np.full((count, 2), np.nan)
    for i in range(count):
        if not hits[i]:
            continue
        low = high = i
        chord = dx = dy = 0.0
        # Widen the chord on both sides, as long as the surface goes on, until it is long enough.
        for _ in range(_FARTHEST):
            if low > 0 and _joined(points, hits, low, low - 1):
                low -= 1
            if high < count - 1 and _joined(points, hits, high, high + 1):
                high += 1
            dx, dy = points[high, 0] - points[low, 0], points[high, 1] - points[low, 1]
            chord = math.sqrt(dx * dx + dy * dy)
            if chord >= _CHORD and low < i < high:
                break
        # The normal is at a right angle to the chord.
        if chord >= _MIN_CHORD and low < i < high:
            unit_normals[i, 0], unit_normals[i, 1] = -dy / chord, dx / chord
    return unit_normals


@njit(cache=True, error_model="numpy", inline="always")
def _joined(points, hits, i, j):
    return hits[j] and abs(points[i, 0] - points[j, 0]) + abs(points[i, 1] - points[j, 1]) < _GAP


@njit(cache=True, error_model="numpy")
def register(points, is_used, reference, facing, angles, guess, spread, noise):
    """Estimate the lidar's motion (x, y, yaw) since the reference scan, and the mean distance of points to lines [m].

    points (B, 2), is_used (B,): of the new scan; reference, facing (B, 2): points and normals of the earlier one.
    guess: motion by odometry; spread: its standard deviations [m, m, rad]; noise: of a range [m]. The distance is
    NaN if fewer than 20 points match; the guess is returned then.
    """
    step, error = max(len(points) // _SAMPLES, 1), math.nan
    x, y = guess[0], guess[1]
    yaw = start = guess[2] + _coarse_turn(points, is_used, reference, angles, guess, spread[2], step)
    # Gauss-Newton: n · (R p + t − q) = 0 for every point p near the line through q with normal n.
    for max_residual in _MATCHED:
        scale = max(2.0 * noise, 0.01, 0.5 * (max_residual - 0.1))
        a, b = np.zeros((3, 3)), np.zeros(3)
        cos, sin = math.cos(yaw), math.sin(yaw)
        matched, total = 0, 0.0
        for i in range(0, len(points), step):
            if not is_used[i]:
                continue
            turned_x = cos * points[i, 0] - sin * points[i, 1]
            turned_y = sin * points[i, 0] + cos * points[i, 1]
            px, py = turned_x + x, turned_y + y
            beam = beam_towards(px, py, angles, len(reference))
            if beam < 0 or math.isnan(facing[beam, 0]):
                continue
            # Distance from the line, and its derivative by the yaw.
            nx, ny = facing[beam, 0], facing[beam, 1]
            ex, ey = px - reference[beam, 0], py - reference[beam, 1]
            residual = nx * ex + ny * ey
            if abs(residual) > max_residual or ex * ex + ey * ey > 4.0 * max_residual * max_residual:
                continue
            lever = ny * turned_x - nx * turned_y
            weight = 1.0 / (1.0 + (residual / scale) ** 2)
            _add(a, b, (nx, ny, lever), residual, weight)
            matched += 1
            total += abs(residual)
        if matched < 20:
            return guess[0], guess[1], start, math.nan
        error = total / matched
        # The odometry as a prior, then the step to the solution.
        variance = _CORRELATED * scale * scale
        for k, (value, first) in enumerate(((x, guess[0]), (y, guess[1]), (yaw, guess[2]))):
            prior = variance / (spread[k] * spread[k])
            a[k, k] += prior
            b[k] -= prior * (value - first)
        change = _solved(a, b)
        x, y, yaw = x + change[0], y + change[1], yaw + change[2]
    return x, y, yaw, error


@njit(cache=True, error_model="numpy")
def _coarse_turn(points, is_used, reference, angles, guess, spread, step):
    """Turn beyond the guess, in whole beams, at which the ranges agree best [rad]."""
    count = len(reference)
    max_shift = min(int(_YAW_DEVIATIONS * spread / angles[1]), count // 8)
    if max_shift < 1:
        return 0.0
    # Cost of each turn: its squared ratio to the odometry's error, plus the differences of the ranges.
    costs = _MAX_RANGE_ERROR * (np.arange(-max_shift, max_shift + 1) * angles[1] / spread) ** 2
    ranges = np.sqrt(reference[:, 0] ** 2 + reference[:, 1] ** 2)
    cos, sin = math.cos(guess[2]), math.sin(guess[2])
    for i in range(0, len(points), step):
        if not is_used[i]:
            continue
        px = cos * points[i, 0] - sin * points[i, 1] + guess[0]
        py = sin * points[i, 0] + cos * points[i, 1] + guess[1]
        beam = beam_towards(px, py, angles, count)
        if beam < max_shift or beam >= count - max_shift:
            continue
        distance = math.sqrt(px * px + py * py)
        for k in range(2 * max_shift + 1):
            costs[k] += min(abs(ranges[beam + k - max_shift] - distance), _MAX_RANGE_ERROR)
    # The turn with the least cost; none if that is as good.
    best = max_shift
    for k in range(2 * max_shift + 1):
        best = k if costs[k] < costs[best] else best
    return (best - max_shift) * angles[1]


@njit(cache=True, error_model="numpy", inline="always")
def _add(a, b, row, residual, weight):
    for k in range(3):
        b[k] -= weight * row[k] * residual
        for m in range(3):
            a[k, m] += weight * row[k] * row[m]


@njit(cache=True, error_model="numpy")
def _solved(a, b):
    """Solve a x = b for a positive definite matrix (3, 3), by its adjugate: LAPACK differs in the last bits."""
    m00, m01, m02, m11, m12, m22 = a[0, 0], a[0, 1], a[0, 2], a[1, 1], a[1, 2], a[2, 2]
    # Cofactors of the symmetric matrix.
    c00, c01, c02 = m11 * m22 - m12 * m12, m02 * m12 - m01 * m22, m01 * m12 - m02 * m11
    c11, c12, c22 = m00 * m22 - m02 * m02, m01 * m02 - m00 * m12, m00 * m11 - m01 * m01
    det = m00 * c00 + m01 * c01 + m02 * c02
    return (
        (c00 * b[0] + c01 * b[1] + c02 * b[2]) / det,
        (c01 * b[0] + c11 * b[1] + c12 * b[2]) / det,
        (c02 * b[0] + c12 * b[1] + c22 * b[2]) / det,
    )
