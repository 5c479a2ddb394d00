"""Runs of neighbouring scan points that may be a person, and the middle of the circle that they lie on."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_LEG = 0.05  # [m] from the front of a leg to its middle
LEGS_RADIUS = 0.35  # [m] a track with a lesser radius may be two legs
UNKNOWN = 0.04  # [m²] variance of the radius of a person seen as legs
_WIDEST_LEGS = 0.3  # [m] radius of a person seen as legs, at most
_THIN = 0.2  # [m] what is narrower is a leg
_AS_LEGS = 0.3  # share of the scans with legs from which on a track is no longer fitted as a circle
_KNOWN_ERROR = 0.02  # [m] error of a radius that is known
_FEWEST = 5  # points that show a circle
_ITERATIONS = 6
_MAX_POINTS = 40  # points that a circle is fitted to
_RESIDUAL_SCALE = 0.05  # [m] points that are farther from the circle of a track are of something else
_MIN_RADIUS, _MAX_RADIUS = 0.05, 0.65  # [m]
FEWEST = 2  # points of a run
_LEG_WIDTH = 0.3  # [m] widest run that may be a leg


@njit(cache=True, error_model="numpy", inline="always")
def gap_at(distance):
    """Distance from which on neighbouring points do not belong together [m]; distance: of the points [m]."""
    return 0.1 + 0.02 * distance


@njit(cache=True, error_model="numpy")
def middle_of(points, chosen, lidar, prior, noise, settings):
    """Middle x, y [m], radius [m], and variances of the middle and of the radius [m²], of the chosen points.

    points (B, 2), chosen (K,): indices in the order of the beams. prior: radius, its variance and the share of scans
    with legs; radius 0: not known. Points that lie on a circle give its middle; others the mean of their runs, as of
    two legs.
    """
    parts, extent, mean_x, mean_y = _runs(points, chosen, lidar)
    # A circle, if the track is known to be a wide one, or if the points are one wide run and it has not had legs.
    is_wide = prior[0] > LEGS_RADIUS and prior[1] < _KNOWN_ERROR**2
    if is_wide or (prior[2] < _AS_LEGS and parts == 1 and extent > _THIN and len(chosen) >= _FEWEST):
        x, y, radius, rms, spread = _circle(points, chosen, lidar, (mean_x, mean_y), extent, prior, noise)
        if rms < 0.02 + 2.0 * noise and radius <= _MAX_RADIUS:
            return x, y, radius, settings.surface**2 + 4.0 * max(rms, 0.5 * noise) ** 2 / len(chosen), spread
    # Otherwise legs: the mean of the runs, moved from the front of a leg to its middle.
    dx, dy = mean_x - lidar[0], mean_y - lidar[1]
    distance = math.sqrt(dx * dx + dy * dy)
    push = _LEG / max(distance, _LEG)
    variance = settings.legs**2 + noise**2 / len(chosen)
    return (
        mean_x + push * dx,
        mean_y + push * dy,
        min(max(0.5 * extent + _LEG, 0.15), _WIDEST_LEGS),
        variance,
        UNKNOWN,
    )


@njit(cache=True, error_model="numpy")
def _runs(points, members, lidar):
    """Number of runs of points without a gap, the extent of all [m], and the mean of the runs' means."""
    parts, x, y, sum_x, sum_y, count = 0, 0.0, 0.0, 0.0, 0.0, 0
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for n in range(len(members)):
        px, py = points[members[n], 0], points[members[n], 1]
        # A gap ends a run: add its mean.
        if n > 0:
            qx, qy = points[members[n - 1], 0], points[members[n - 1], 1]
            distance = math.sqrt((px - lidar[0]) ** 2 + (py - lidar[1]) ** 2)
            if math.sqrt((px - qx) ** 2 + (py - qy) ** 2) > gap_at(distance):
                x, y, parts = x + sum_x / count, y + sum_y / count, parts + 1
                sum_x, sum_y, count = 0.0, 0.0, 0
        sum_x, sum_y, count = sum_x + px, sum_y + py, count + 1
        low_x, low_y, high_x, high_y = min(low_x, px), min(low_y, py), max(high_x, px), max(high_y, py)
    x, y, parts = x + sum_x / count, y + sum_y / count, parts + 1
    return parts, math.sqrt((high_x - low_x) ** 2 + (high_y - low_y) ** 2), x / parts, y / parts


@njit(cache=True, error_model="numpy")
def _circle(points, members, lidar, mean, extent, prior, noise):
    """Fit a circle by Gauss-Newton: middle, radius, root mean square of the residuals, variance of the radius."""
    # Start with the known radius or half of the extent, and a middle behind the points as the lidar sees them.
    prior_radius, variance = (prior[0], prior[1]) if prior[0] > 0.0 else (0.5 * extent, 0.15**2)
    r = min(max(prior_radius, _MIN_RADIUS), _MAX_RADIUS)
    dx, dy = mean[0] - lidar[0], mean[1] - lidar[1]
    distance = max(math.sqrt(dx * dx + dy * dy), 1e-6)
    x, y = mean[0] + 0.7 * r * dx / distance, mean[1] + 0.7 * r * dy / distance
    step = max(len(members) // _MAX_POINTS, 1)
    weight = max(noise, 0.005) ** 2
    rms, spread = math.inf, variance
    for _ in range(_ITERATIONS):
        # Normal equations of the residuals d − r for changes of x, y and r; d: distance from the middle.
        a = np.zeros((3, 3))
        b0 = b1 = b2 = total = 0.0
        count = 0.0
        for n in range(0, len(members), step):
            px, py = points[members[n], 0] - x, points[members[n], 1] - y
            d = max(math.sqrt(px * px + py * py), 1e-6)
            residual, nx, ny = d - r, px / d, py / d
            # Points off the circle of a known track count less.
            w = 1.0 / (1.0 + (residual / _RESIDUAL_SCALE) ** 2) if prior[0] > 0.0 else 1.0
            a[0, 0] += w * nx * nx
            a[0, 1] += w * nx * ny
            a[1, 1] += w * ny * ny
            a[0, 2] += w * nx
            a[1, 2] += w * ny
            b0, b1, b2 = b0 + w * nx * residual, b1 + w * ny * residual, b2 + w * residual
            total += w * residual * residual
            count += w
        rms = math.sqrt(total / count)
        # The expected radius as a prior, and a small diagonal against a singular matrix.
        pull = 2.0 * weight / variance
        a22 = count + pull
        b2 += pull * (prior_radius - r)
        a00, a11 = a[0, 0] + 1e-3 * count, a[1, 1] + 1e-3 * count
        # Eliminate the radius, then solve for the middle.
        m00, m01 = a00 - a[0, 2] * a[0, 2] / a22, a[0, 1] - a[0, 2] * a[1, 2] / a22
        m11 = a11 - a[1, 2] * a[1, 2] / a22
        c0, c1 = b0 - a[0, 2] * b2 / a22, b1 - a[1, 2] * b2 / a22
        det = m00 * m11 - m01 * m01
        change_x, change_y = (m11 * c0 - m01 * c1) / det, (m00 * c1 - m01 * c0) / det
        change_r = (b2 - a[0, 2] * change_x - a[1, 2] * change_y) / a22
        longest = max(abs(change_x), abs(change_y), abs(change_r))
        # No step changes a value by more than 0.3 m.
        fraction = min(1.0, 0.3 / longest) if longest > 0.0 else 1.0
        x, y = x + fraction * change_x, y + fraction * change_y
        r = min(max(r + fraction * change_r, _MIN_RADIUS), 2.0 * _MAX_RADIUS)
        # Variance of the radius: the inverse's last entry, by the Schur complement.
        inner = a00 * a11 - a[0, 1] ** 2
        schur = a22 - (a11 * a[0, 2] ** 2 - 2.0 * a[0, 1] * a[0, 2] * a[1, 2] + a00 * a[1, 2] ** 2) / inner
        spread = 2.0 * weight / max(schur, 1e-9)
        if longest < 1e-4:
            break
    return x, y, r, rms, min(spread, variance)


@njit(cache=True, error_model="numpy")
def runs_of(points, free_points, moved, lidar, settings):
    """Group of each point, −1 for none, and the number of groups.

    points (B, 2), moved (B,); free_points (B,): hits that belong to no track. A group is a run that is not wider than
    a person, or the part of a wider one that has moved; two legs that have moved are one group.
    """
    count = len(points)
    group = np.full(count, -1, np.int64)
    num_runs, start = 0, -1
    starts, stops = np.empty(count, np.int64), np.empty(count, np.int64)
    # Divide the free points into runs without a gap.
    for i in range(count + 1):
        ends = i == count or not free_points[i]
        if start >= 0 and (ends or apart(points, i - 1, i, lidar)):
            num_runs = _add(points, moved, (start, i), starts, stops, num_runs, settings)
            start = -1
        if not ends and start < 0:
            start = i
    # Number the runs as groups; a leg beside an earlier one shares its group.
    groups = 0
    for n in range(num_runs):
        partner = _leg_before(points, moved, starts, stops, n, group, settings)
        label = partner if partner >= 0 else groups
        groups += partner < 0
        for i in range(starts[n], stops[n]):
            group[i] = label
    return group, groups


@njit(cache=True, error_model="numpy", inline="always")
def apart(points, i, j, lidar):
    """Return whether neighbouring points do not belong together."""
    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
    distance = math.sqrt((points[j, 0] - lidar[0]) ** 2 + (points[j, 1] - lidar[1]) ** 2)
    return math.sqrt(dx * dx + dy * dy) > gap_at(distance)


@njit(cache=True, error_model="numpy")
def _add(points, has_moved, run, starts, stops, num_runs, settings):
    """Add a run of points, or its moved parts if it is too wide, and return the number of runs."""
    start, end = run
    if end - start < FEWEST:
        return num_runs
    if _width(points, start, end) <= settings.widest:
        starts[num_runs], stops[num_runs] = start, end
        return num_runs + 1
    # Too wide for a person: add the parts that have moved.
    part_start = -1
    for i in range(start, end + 1):
        continues = i < end and has_moved[i]
        if continues and part_start < 0:
            part_start = i
        if not continues and part_start >= 0:
            if i - part_start >= FEWEST and _width(points, part_start, i) <= settings.widest:
                starts[num_runs], stops[num_runs] = part_start, i
                num_runs += 1
            part_start = -1
    return num_runs


@njit(cache=True, error_model="numpy")
def _width(points, start, end):
    """Diagonal of the box around the points from `start` to `end` − 1 [m]."""
    low_x = low_y = math.inf
    high_x = high_y = -math.inf
    for i in range(start, end):
        low_x, high_x = min(low_x, points[i, 0]), max(high_x, points[i, 0])
        low_y, high_y = min(low_y, points[i, 1]), max(high_y, points[i, 1])
    return math.sqrt((high_x - low_x) ** 2 + (high_y - low_y) ** 2)


@njit(cache=True, error_model="numpy")
def _leg_before(points, has_moved, starts, stops, n, group, settings):
    """Group of an earlier leg beside this one; −1 if this is not a leg, or alone."""
    if not _is_leg(points, has_moved, starts[n], stops[n]):
        return -1
    x, y = _mean(points, starts[n], stops[n])
    # Only the last few runs can be beside it.
    for m in range(n - 1, max(n - 5, -1), -1):
        if _is_leg(points, has_moved, starts[m], stops[m]):
            earlier_x, earlier_y = _mean(points, starts[m], stops[m])
            if math.sqrt((x - earlier_x) ** 2 + (y - earlier_y) ** 2) < settings.joint:
                return group[starts[m]]
    return -1


@njit(cache=True, error_model="numpy")
def _is_leg(points, has_moved, start, end):
    return 2 * has_moved[start:end].sum() >= end - start and _width(points, start, end) <= _LEG_WIDTH


@njit(cache=True, error_model="numpy")
def _mean(points, start, end):
    x = y = 0.0
    for i in range(start, end):
        x, y = x + points[i, 0], y + points[i, 1]
    return x / (end - start), y / (end - start)
