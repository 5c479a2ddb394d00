"""Planar scan of a level 3D lidar among upright obstacles, computed without its cloud.

Obstacles reach above every height that counts, so a beam's first hit follows from its azimuth alone. Most beams of
a cloud hit above or below the heights that count, wherever they hit; they are skipped because of their elevation.
Of those that are left in a bin of the scan, most cannot be the nearest: neither a beam's noise nor the walls of its
bucket are near enough. Only the rest is aimed and cast.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.fan import direction, unsigned_bearing
from lme.grids.edge_grid import first_hit, nearest
from lme.simulation.mid360.pattern import (
    MOST_NOISE,
    SECTORS,
    beams_within,
    noise_of,
    rise_share,
    share_error,
    turn_share,
)
from lme.simulation.mid360.raycast3d import BUCKETS, to_circle, to_edge
from lme.simulation.mid360.visibility import visible
from lme.types import Floats, Ints

_SURE, _SLACK_RAD = 1e-6, 1e-12  # [m], [rad] far above the rounding errors of ranges and angles
_MOST_ELEVATION = 0.6  # [rad] up to which the bound of the tangent in `_contenders` holds


@njit(cache=True, error_model="numpy")
def cloud_scan(
    pose: tuple[float, float, float],
    beams: tuple[int, int, float, float],
    table: tuple[NDArray[np.int32], NDArray[np.int32]],
    noise: tuple[int, float],
    sensor: tuple[float, float, float, float, float],
    heights: tuple[float, float],
    spans: tuple[float, float],
    num_bins: int,
    circles: Floats,
    edges: Floats,
    grid: tuple[tuple[float, float, float, int, int], Ints, Floats],
) -> NDArray[np.float32]:
    """Least horizontal range of a cloud's points in each bin, inf for a bin without points: (num_bins,) [m].

    pose: of the sensor in the world; beams (first, number, phase in azimuth, phase in elevation) of the pattern, and
    the `BeamTable` of that number (`lme.simulation.mid360.pattern`); noise (seed, σ [m]); sensor (height above the
    ground [m], lowest and highest elevation [rad], nearest and farthest distance [m]); heights (lowest, highest) and
    spans (nearest, farthest): limits of the points that count [m]; circles (C, 3), edges (E, 4) and those of an
    `EdgeGrid`. The middle of bin i is at −π + i · 2π / bins.
    """
    first, phase, rises = beams[0], (beams[2], beams[3]), (sensor[1], sensor[2] - sensor[1])
    max_noise = MOST_NOISE * noise[1]
    # What a beam may hit first in each bucket of bearing, and bounds of how far it gets.
    frame, cells, in_cells = grid
    range_max = min(sensor[4], spans[1] + max_noise)
    bounds, edge_in, link_of, links, shapes = visible(pose, circles, edges, range_max)
    bounds[0] = np.minimum(bounds[0], nearest(pose[0], pose[1], frame, cells, in_cells))
    # Beams with an elevation that can give a point that counts.
    error = share_error(first, beams[1])
    gaps = _sector_gaps(bounds[0], turn_share(first, phase[0]) + pose[2] / (2.0 * math.pi), error)
    low, high = _elevations(gaps, sensor, heights, max_noise)
    chosen = beams_within(first, phase[1], table, (low - rises[0]) / rises[1], (high - rises[0]) / rises[1])
    buckets, bins, aims = _aim(chosen, first, phase, pose[2], rises, noise, num_bins)
    # Those of them that can be the nearest in their bins.
    surely = _countable(bounds, sensor, heights, spans, max_noise)
    contenders = _contenders(
        buckets, bins, aims, bounds[0], surely, (sensor[0], *heights), max_noise, num_bins
    )
    buckets, bins, aims = _copied(contenders, buckets, bins, aims)
    directions = _directions(aims)
    reaches = _reaches(buckets, directions, edge_in, link_of, links, shapes, len(circles))
    if len(in_cells):
        for n in range(len(reaches)):
            beam = (directions[0, n], directions[1, n])
            reaches[n] = first_hit(pose[0], pose[1], (1.0, 0.0), beam, reaches[n], frame, cells, in_cells)
    ranges: NDArray[np.float32]
    ranges = _nearest_points(bins, aims, directions, reaches, sensor, heights, spans, num_bins)
    return ranges


@njit(cache=True, error_model="numpy")
def _highest_ground(sensor, max_noise):
    """Greatest height of a noisy point of the ground, whose noise is along the beam [m]."""
    return max_noise * math.sin(max(-sensor[1], 0.0)) + _SURE


@njit(cache=True, error_model="numpy")
def _sector_gaps(nearest, turn, error):
    """Lower bound of the range to the first obstacle in each sector of azimuth from a turn on: (SECTORS,) [m].

    nearest (BUCKETS,): that of each bucket; error: of azimuths, as a share of a turn.
    """
    gaps = np.full(SECTORS, np.inf)
    turn -= error
    for s in range(SECTORS):
        start = turn + s / SECTORS
        bucket = min(int((start - np.floor(start)) * BUCKETS), BUCKETS - 1)
        # The buckets that the sector may touch.
        for _ in range(BUCKETS // SECTORS + 2):
            gaps[s] = min(gaps[s], nearest[bucket])
            bucket = bucket + 1 if bucket + 1 < BUCKETS else 0
    return gaps


@njit(cache=True, error_model="numpy")
def _aim(chosen, first, phase, yaw, rises, noise, num_bins):
    """Bucket (N,) and bin (N,) of each beam, and (3, N): its bearing in turns, elevation [rad] and error [m].

    chosen: numbers of the beams, counted from `first`; rises: lowest elevation and span [rad]. The loops are
    vectorised.
    """
    heading, seed, start = yaw / (2.0 * math.pi), np.uint64(noise[0]), float(first)
    buckets, bins = np.empty(len(chosen), np.uint32), np.empty(len(chosen), np.uint32)
    aims = np.empty((3, len(chosen)))
    for n in range(len(chosen)):
        turn = turn_share(start + chosen[n], phase[0])
        half_turned = turn + 0.5 - np.floor(turn + 0.5)
        nearest_bin = np.int32(half_turned * num_bins + 0.5)
        bins[n] = 0 if nearest_bin == num_bins else nearest_bin
        turn += heading
        turn -= np.floor(turn)
        bucket = np.int32(turn * BUCKETS)
        buckets[n] = bucket if bucket < BUCKETS else BUCKETS - 1
        aims[0, n] = turn
        aims[1, n] = rises[0] + rises[1] * rise_share(start + chosen[n], phase[1])
    for n in range(len(chosen)):
        aims[2, n] = noise[1] * noise_of(first + chosen[n], seed)
    return buckets, bins, aims


@njit(cache=True, error_model="numpy")
def _countable(bounds, sensor, heights, spans, max_noise):
    """Upper bound of the range in each bucket, inf where not all points between the heights are sure to count [m]."""
    surely = np.full(BUCKETS, np.inf)
    # Nothing is sure if the ground may be nearer and count, or if the sensor is not between the heights.
    if heights[0] <= _highest_ground(sensor, max_noise) or not heights[0] <= sensor[0] <= heights[1]:
        return surely
    steepest = math.cos(min(max(abs(sensor[1]), abs(sensor[2])), math.pi / 2.0))
    nearest, farthest = max(spans[0], sensor[3]) + max_noise, min(spans[1] - max_noise, sensor[4] * steepest)
    for bucket in range(BUCKETS):
        if bounds[0, bucket] > nearest + _SURE and bounds[1, bucket] < farthest - _SURE:
            surely[bucket] = bounds[1, bucket]
    return surely


@njit(cache=True, error_model="numpy")
def _contenders(buckets, bins, aims, nearest, surely, heights, max_noise, num_bins):
    """Indices of the beams that may give the nearest point of their bin: (K,).

    nearest, surely (BUCKETS,): bounds of the range, the upper one as from `_countable`; heights: of the sensor, lowest
    and highest that count [m].
    """
    below, above = heights[0] - heights[1], heights[2] - heights[0]
    ranges, bounds = np.empty((2, len(bins))), np.empty((2, len(bins)))
    for n in range(len(bins)):
        ranges[0, n], ranges[1, n] = nearest[buckets[n]], surely[buckets[n]]
    # Bounds of a point's horizontal range; the upper one is inf if the point does not surely count. It is vectorised.
    for n in range(len(bins)):
        rise, error = aims[1, n], aims[2, n]
        steep, cos = abs(rise), 1.0 - 0.5 * rise * rise  # 1 − x²/2 < cos(x)
        # tan(x) < x + 0.4 x³ up to 0.6
        most_height = (ranges[1, n] + max_noise) * steep * (1.0 + 0.4 * rise * rise)
        counts = (most_height < (below if rise < 0.0 else above) - _SURE) & (steep < _MOST_ELEVATION)
        bounds[0, n] = ranges[0, n] + min(error, error * cos) - _SURE
        bounds[1, n] = ranges[1, n] + max(error, error * cos) + _SURE if counts else np.inf
    # The bound of each bin, and the beams that may come below it.
    least = np.full(num_bins, np.inf)
    for n in range(len(bins)):
        least[bins[n]] = min(least[bins[n]], bounds[1, n])
    contenders, count = np.empty(len(bins), np.uint32), 0
    for n in range(len(bins)):
        contenders[count] = n
        count += bounds[0, n] <= least[bins[n]]
    return contenders[:count]


@njit(cache=True, error_model="numpy")
def _copied(contenders, buckets, bins, aims):
    """Buckets, bins and aims of some beams; loops over the copies are vectorised."""
    few_buckets, few_bins = np.empty(len(contenders), buckets.dtype), np.empty(len(contenders), bins.dtype)
    few_aims = np.empty((3, len(contenders)))
    for n in range(len(contenders)):
        few_buckets[n], few_bins[n] = buckets[contenders[n]], bins[contenders[n]]
        for k in range(3):
            few_aims[k, n] = aims[k, contenders[n]]
    return few_buckets, few_bins, few_aims


@njit(cache=True, error_model="numpy")
def _directions(aims):
    """Cosine and sine of each beam's bearing in the world and of its elevation: (4, N). The loops are vectorised."""
    directions = np.empty((4, aims.shape[1]))
    for n in range(aims.shape[1]):
        directions[0, n], directions[1, n] = direction(aims[0, n])
    for n in range(aims.shape[1]):
        directions[2, n], directions[3, n] = direction(aims[1, n] / (2.0 * math.pi))
    return directions


@njit(cache=True, error_model="numpy")
def _reaches(buckets, directions, edge_in, link_of, links, shapes, num_circles):
    """Horizontal range of each beam to the first obstacle, of infinite height; inf without any: (N,) [m].

    edge_in, link_of, links, shapes: see `visible`. The first loop is vectorised: most buckets have one edge only.
    """
    reaches, ends = np.empty(len(buckets)), np.empty((4, len(buckets)))
    for n in range(len(buckets)):
        for k in range(4):
            ends[k, n] = edge_in[k, buckets[n]]
    for n in range(len(buckets)):
        dx, dy, ax, ay, bx, by = (
            directions[0, n],
            directions[1, n],
            ends[0, n],
            ends[1, n],
            ends[2, n],
            ends[3, n],
        )
        # The arithmetic of `to_edge`.
        across_start, across_end = ax * dy - ay * dx, bx * dy - by * dx
        distance = (ax * by - ay * bx) / (across_start - across_end)
        is_hit = ((across_start > 0.0) != (across_end > 0.0)) & (distance >= 0.0)
        reaches[n] = distance if is_hit else np.inf
    for n in range(len(buckets)):
        ray, link = (directions[0, n], directions[1, n], 0.0), link_of[buckets[n]]
        while link >= 0:
            i = links[0, link]
            if i < num_circles:
                distance = to_circle(ray, (shapes[0, i], shapes[1, i], shapes[2, i]), -np.inf, np.inf)
            else:
                edge = (shapes[0, i], shapes[1, i], shapes[2, i], shapes[3, i])
                distance = to_edge(ray, edge, -np.inf, np.inf)
            reaches[n] = min(reaches[n], distance)
            link = links[1, link]
    return reaches


@njit(cache=True, error_model="numpy")
def _nearest_points(bins, aims, directions, reaches, sensor, heights, spans, num_bins):
    """Least horizontal range of the points of the beams in each bin: (num_bins,) [m].

    reaches: see `_reaches`. The first loop is vectorised.
    """
    points = np.empty(len(bins), np.float32)
    for n in range(len(bins)):
        cos, sin, height, reach = directions[2, n], directions[3, n], sensor[0], reaches[n]
        # The ground may be nearer.
        reach = -height * cos / sin if height * cos + reach * sin < 0.0 else reach
        distance = reach / cos
        is_return = distance <= sensor[4]
        # Height and horizontal range of the noisy point.
        distance += aims[2, n]
        z, horizontal = height + distance * sin, distance * cos
        counts = is_return & (distance >= sensor[3]) & (heights[0] <= z) & (z <= heights[1])
        counts &= (spans[0] <= horizontal) & (horizontal <= spans[1])
        points[n] = horizontal if counts else np.inf
    ranges = np.full(num_bins, np.float32(np.inf))
    for n in range(len(bins)):
        k = bins[n]
        ranges[k] = min(ranges[k], points[n])
    return ranges


@njit(cache=True, error_model="numpy")
def _elevations(nearest, sensor, heights, max_noise):
    """Lowest and highest elevation of the beams in each sector that may give a point that counts: 2 × (SECTORS,).

    A beam hits nothing nearer than the nearest obstacle of its sector, at nearest (SECTORS,) [m], or the ground, and
    its noise is at most `max_noise` [m].
    """
    low, high = np.full(SECTORS, -math.pi / 2.0), np.full(SECTORS, math.pi / 2.0)
    below, above = max(sensor[0] - heights[0], 0.0), max(heights[1] - sensor[0], 0.0)
    ground_counts = heights[0] <= _highest_ground(sensor, max_noise)
    for s in range(SECTORS):
        # A steeper beam is above or below the heights that count where it meets the nearest obstacle.
        gap = nearest[s] - max_noise
        if gap > 0.0:
            high[s] = unsigned_bearing(gap, above) + _SLACK_RAD
            if not ground_counts:
                low[s] = -unsigned_bearing(gap, below) - _SLACK_RAD
    return low, high
