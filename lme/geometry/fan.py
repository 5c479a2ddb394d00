"""Bearings, and the test of a fan of segments from one apex: which of them come too near to a point.

The result is that of testing every segment against every point; the algorithm skips pairs that cannot be near.
A segment comes within the radius of a point only if it lies in the tangent cone of the disc of that radius around
the point, and is long enough to reach the disc. The ends are therefore sorted into bins of bearing about the apex.
Each point is tested against the bins in its cone, and blocked ends are removed from their bins.

Helpers that are called once per point take only numbers: Numba's reference counting makes passing an array from
inside a loop more expensive than the work on it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Bools, Floats

BEARING_ERROR = 2e-5  # [rad] upper bound of the error of `bearing`
_TINY = 1e-300  # avoids 0 / 0
_TAN_PI_8 = math.sqrt(2.0) - 1.0
_ATAN_P = (
    -0.8750608600031904,
    -16.157537187333652,
    -75.00855792314705,
    -122.88666844901361,
    -64.85021904942025,
)
_ATAN_Q = (24.858464901423063, 165.02700983169885, 432.88106049129027, 485.3903996359137, 194.5506571482614)
_SLICES = 720  # of a turn; Taylor series about their middles are exact to 1e-16
_MIDDLES = np.column_stack(
    [f(2.0 * math.pi * (np.arange(_SLICES) + 0.5) / _SLICES) for f in (np.cos, np.sin)]
)
_FEW = 8  # [ends or points] up to this number, sorting does not pay
_ENDS_PER_BIN = 4
_STRIDE = 8  # number of passes over the points, since neighbours in a scan block the same ends
_SLACK = 1e-9  # share of all lengths by which discs are widened, more than any rounding error
_FAR = 1e100  # [m²] products of squares beyond this may overflow


@njit(cache=True, error_model="numpy")
def diamond(x: float, y: float) -> float:
    """Diamond angle: increases with the bearing of (x, y), from −2 above −π to 2 at π; 0 for (0, 0).

    It has no branches, so loops over it are vectorised. A y of −0 counts as negative.
    """
    part = y / max(abs(x) + abs(y), _TINY)
    return part if x >= 0.0 else math.copysign(2.0, y) - part


@njit(cache=True, error_model="numpy")
def bearing(x: float, y: float) -> float:
    """atan2(y, x) in [0, 2π] with an error below 1e-5 rad; NaN for (0, 0). Source: Abramowitz & Stegun 4.4.47."""
    ax, ay = abs(x), abs(y)
    z = min(ax, ay) / max(ax, ay)
    zz = z * z
    angle = z * (0.9998660 + zz * (-0.3302995 + zz * (0.1801410 + zz * (-0.0851330 + zz * 0.0208351))))
    angle = math.pi / 2.0 - angle if ay > ax else angle
    angle = math.pi - angle if x < 0.0 else angle
    return 2.0 * math.pi - angle if y < 0.0 else angle


@njit(cache=True, error_model="numpy", inline="always")
def unsigned_bearing(x: float, y: float) -> float:
    """|atan2(y, x)| in [0, π] with an error below 1e-15 rad; 0 for (0, 0), any value for places nearer than 1e-280.

    It has no branches, so loops over it are vectorised and take a tenth of atan2's time. Source: the rational
    approximation of arctan in the Cephes Mathematical Library (Moshier 1989, Methods and Programs for Mathematical
    Functions), for up to tan(π/8); arctan(t) = π/4 + arctan((t − 1)/(t + 1)) up to 1.
    """
    # Reduce the angle to arctan(t), t ≤ 1, and beyond tan(π/8) to arctan((t − 1)/(t + 1)).
    ax, ay = abs(x), abs(y)
    t = min(ax, ay) / max(ax, ay, _TINY)
    is_large = t > _TAN_PI_8
    t = (t - 1.0) / (t + 1.0) if is_large else t
    # arctan(t) = t + t z P(z)/Q(z) with z = t².
    z = t * t
    p = (((_ATAN_P[0] * z + _ATAN_P[1]) * z + _ATAN_P[2]) * z + _ATAN_P[3]) * z + _ATAN_P[4]
    q = ((((z + _ATAN_Q[0]) * z + _ATAN_Q[1]) * z + _ATAN_Q[2]) * z + _ATAN_Q[3]) * z + _ATAN_Q[4]
    angle = t + t * (z * p / q)
    # Undo the reductions: eighth, quarter and half of a turn.
    angle = angle + 0.25 * math.pi if is_large else angle
    angle = 0.5 * math.pi - angle if ay > ax else angle
    return math.pi - angle if x < 0.0 else angle


@njit(cache=True, error_model="numpy")
def direction(turn: float) -> tuple[float, float]:
    """Cosine and sine of an angle given in turns; the error is below 1e-14."""
    turn -= np.floor(turn)
    # Turn the middle of the slice by the rest, with the Taylor series of cosine and sine.
    i = min(int(turn * _SLICES), _SLICES - 1)
    remainder = 2.0 * math.pi * (turn - (i + 0.5) / _SLICES)
    square = remainder * remainder
    cos = 1.0 - square * (0.5 - square / 24.0)
    sin = remainder * (1.0 - square * (1.0 / 6.0 - square / 120.0))
    return _MIDDLES[i, 0] * cos - _MIDDLES[i, 1] * sin, _MIDDLES[i, 1] * cos + _MIDDLES[i, 0] * sin


@njit(cache=True, error_model="numpy")
def fan_blocked(apex: Floats, ends: Floats, points: Floats, radius: float) -> Bools:
    """Return whether each segment apex–end comes nearer than `radius` [m] to any point (paper Eqs. 4–6): (N,).

    apex (2,), ends (N, 2), points (M, 2) [m], in any order. A distance of exactly `radius` does not block.
    """
    blocked = np.zeros(len(ends), np.bool_)
    arms, sum_ends = _arms(apex, ends)
    rays, sum_points = _arms(apex, points)
    if min(len(ends), len(points)) <= _FEW or not sum_ends + sum_points < _FAR:  # also where one is NaN
        _test_all(arms, rays, radius, blocked)
        return blocked
    # Sort the ends into bins of bearing, and find the bins in the tangent cone of each point.
    padded = radius + _SLACK * (radius + math.sqrt(sum_ends) + math.sqrt(sum_points))
    axis = (arms[0].sum(), arms[1].sum())  # reference for bearings, so that a narrow fan does not wrap around
    bearing = _bearings(arms, axis)
    low = bearing.min()
    num_bins = len(ends) // _ENDS_PER_BIN + 1
    scale = num_bins / (bearing.max() - low + _SLACK)
    cones = _cones(rays, axis, padded, low, scale, num_bins)
    ends_left, arms_left, start, stop, reach = _sort_into_bins(arms, bearing, low, scale, num_bins, padded)
    # Blocked ends leave their bins, so every pass has fewer of them to test.
    for offset in range(_STRIDE):
        _test_stride(offset, rays, cones, ends_left, arms_left, start, stop, reach, radius, blocked)
    return blocked


@njit(cache=True, error_model="numpy")
def _is_near(dx, dy, length_square, qx, qy, radius_square):
    """Return whether q is nearer than the radius to the segment from the origin to d.

    It has no branches, since none could be predicted.
    """
    # Squared distance to the line, replaced by that to the end or to the origin where q projects beyond them.
    along, across, ex, ey = qx * dx + qy * dy, qx * dy - qy * dx, qx - dx, qy - dy
    square, limit = across * across, radius_square * length_square
    past_end = along >= length_square
    square, limit = ex * ex + ey * ey if past_end else square, radius_square if past_end else limit
    past_start = along <= 0.0
    square, limit = qx * qx + qy * qy if past_start else square, radius_square if past_start else limit
    return square < limit


@njit(cache=True, error_model="numpy")
def _test_all(arms, rays, radius, blocked):
    """Test every segment against every point."""
    radius_square = radius * radius
    for j in range(rays.shape[1]):
        for i in range(len(blocked)):
            blocked[i] |= _is_near(arms[0, i], arms[1, i], arms[2, i], rays[0, j], rays[1, j], radius_square)


@njit(cache=True, error_model="numpy")
def _arms(apex, points):
    """x, y and squared length of the points relative to the apex, (3, N), and the sum of the squared lengths."""
    ax, ay = apex[0], apex[1]
    arms = np.empty((3, len(points)))
    total = 0.0
    for i in range(len(points)):
        x, y = points[i, 0] - ax, points[i, 1] - ay
        arms[0, i], arms[1, i], arms[2, i] = x, y, x * x + y * y
        total += arms[2, i]
    return arms, total


@njit(cache=True, error_model="numpy")
def _bearings(arms, axis):
    """Diamond angles of the arms relative to the axis: (N,)."""
    ax, ay = axis
    bearings = np.empty(arms.shape[1])
    for i in range(len(bearings)):
        x, y = arms[0, i], arms[1, i]
        bearings[i] = diamond(x * ax + y * ay, y * ax - x * ay)
    return bearings


@njit(cache=True, error_model="numpy")
def _cones(rays, axis, padded, low, scale, num_bins):
    """First and last bin between the tangents to the disc of radius `padded` around each point: (2, M).

    The tangents are the ray turned by ±asin(padded / length). If the apex is in the disc, the cone covers all bins.
    If the cone contains the direction opposite to the axis, it wraps around: num_bins is added to its last bin.
    It has no branches, so the loop is vectorised.
    """
    ax, ay = axis
    top = float(num_bins)
    bins = np.empty((2, rays.shape[1]), np.int32)
    for j in range(rays.shape[1]):
        x, y = rays[0, j], rays[1, j]
        # The ray in the frame of the axis, turned by ∓α: cos = length · cos α, padded = length · sin α.
        u, v = x * ax + y * ay, y * ax - x * ay
        square = rays[2, j] - padded * padded
        cos = math.sqrt(max(square, 0.0))
        first_bin = (diamond(u * cos + v * padded, v * cos - u * padded) - low) * scale
        last_bin = (diamond(u * cos - v * padded, v * cos + u * padded) - low) * scale
        # Limit the cone to existing bins; one that wraps around ends in the next turn.
        wrap = top if first_bin > last_bin else 0.0
        first_bin, last_bin = min(max(first_bin, 0.0), top), min(max(last_bin, -1.0), top - 1.0) + wrap
        bins[0, j] = int(first_bin) if square > 0.0 else 0
        bins[1, j] = int(last_bin) if square > 0.0 else num_bins - 1
    return bins


@njit(cache=True, error_model="numpy")
def _sort_into_bins(arms, bearing, low, scale, num_bins, padded):
    """Sort the ends into bins by counting.

    Returns the sorted indices (N,), the sorted arms (4, N), the start (num_bins + 1,) and the stop (num_bins,) of
    each bin, and its reach (num_bins,). The fourth row of the arms is the squared distance from which on a point is
    too far away to block the arm. The reach of a bin is the greatest of its ends, 0 if it has none.
    """
    start = np.zeros(num_bins + 1, np.int64)
    bin_of = np.empty(len(bearing), np.int64)
    # Count the ends of each bin; the sums are where the bins start.
    for i in range(len(bearing)):
        bin_of[i] = min(int((bearing[i] - low) * scale), num_bins - 1)
        start[bin_of[i] + 1] += 1
    for k in range(num_bins):
        start[k + 1] += start[k]
    # Put each end into the next free slot of its bin.
    stop = start[:-1].copy()
    reach = np.zeros(num_bins)
    ends = np.empty(len(bearing), np.int64)
    sorted_arms = np.empty((4, len(bearing)))
    for i in range(len(bearing)):
        k = bin_of[i]
        slot, far_square = stop[k], (math.sqrt(arms[2, i]) + padded) ** 2
        ends[slot] = i
        sorted_arms[0, slot], sorted_arms[1, slot] = arms[0, i], arms[1, i]
        sorted_arms[2, slot], sorted_arms[3, slot] = arms[2, i], far_square
        stop[k] = slot + 1
        reach[k] = max(reach[k], far_square)
    return ends, sorted_arms, start, stop, reach


@njit(cache=True, error_model="numpy")
def _test_stride(offset, rays, cones, ends, arms, start, stop, reach, radius, blocked):
    """Test every `_STRIDE`-th point from `offset` on against the ends in its bins, and remove blocked ends."""
    num_bins, radius_square = len(reach), radius * radius
    farthest = 0.0
    for k in range(num_bins):
        farthest = max(farthest, reach[k])
    for j in range(offset, rays.shape[1], _STRIDE):
        qx, qy, square = rays[0, j], rays[1, j], rays[2, j]
        if square >= farthest:
            continue
        # Bins of the point's cone; the first bin follows the last one.
        for unwrapped in range(cones[0, j], cones[1, j] + 1):
            k = unwrapped if unwrapped < num_bins else unwrapped - num_bins
            if square >= reach[k]:
                continue
            # Move the ends that stay to the front of the bin, and recompute its reach.
            bin_stop, free_slot = stop[k], start[k]
            reach[k] = 0.0
            for i in range(start[k], bin_stop):
                end, x, y, length_square, far_square = ends[i], arms[0, i], arms[1, i], arms[2, i], arms[3, i]
                is_blocked = _is_near(x, y, length_square, qx, qy, radius_square)
                blocked[end] |= is_blocked
                ends[free_slot], arms[0, free_slot], arms[1, free_slot] = end, x, y
                arms[2, free_slot], arms[3, free_slot] = length_square, far_square
                free_slot += not is_blocked
                reach[k] = max(reach[k], 0.0 if is_blocked else far_square)
            stop[k] = free_slot
