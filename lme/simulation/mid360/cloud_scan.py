"""Planar scan of a level 3D lidar among upright obstacles, computed without its cloud.

Obstacles reach above every height that counts, so a beam's first hit follows from its azimuth alone. Most beams of
a cloud hit above or below the heights that count, wherever they hit; they are skipped because of their elevation.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.collision import point_to_segment
from lme.geometry.fan import direction, unsigned_bearing
from lme.grids.edge_grid import first_hit, nearest
from lme.simulation.mid360.raycast3d import BUCKETS, by_bearing, to_circle, to_edge
from lme.types import Floats, Ints

# Kronecker sequence of the plastic number ρ, ρ³ = ρ + 1: (1/ρ, 1/ρ²) fills a square most evenly.
# Source: M. Roberts 2018, "The unreasonable effectiveness of quasirandom sequences".
_TURN, _RISE = 0.7548776662466927, 0.5698402909980532

MOST_NOISE = 2.0 * math.sqrt(3.0)  # [σ] bound of `noise_of`

# SplitMix64. Source: G. Steele, D. Lea, C. Flood 2014, "Fast splittable pseudorandom number generators".
_STEP = np.uint64(0x9E3779B97F4A7C15)
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_SHIFTS = (np.uint64(30), np.uint64(27), np.uint64(31))
_PART, _PARTS = np.uint64(0xFFFF), (np.uint64(16), np.uint64(32), np.uint64(48))

_BORDERS = np.column_stack([f(2.0 * math.pi * np.arange(BUCKETS + 1) / BUCKETS) for f in (np.cos, np.sin)])
_WIDTH_COS = math.cos(2.0 * math.pi / BUCKETS)  # of the angle between the borders of a bucket
_ROUNDING = 1e-15  # bound of the rounding error of a share, per beam since the start of the pattern
_SLACK, _SURE, _SLACK_RAD = (
    1e-9,
    1e-9,
    1e-12,
)  # [-], [m], [rad] far above the rounding errors of ranges and angles


@njit(cache=True, error_model="numpy")
def beam_pattern(
    first: int, number: int, phase: tuple[float, float], elevations: tuple[float, float]
) -> Floats:
    """Unit vectors of `number` beams from beam `first` on, at all azimuths between two elevations: (number, 3).

    phase: position of beam 0 in azimuth and in elevation, as shares of the field of view; elevations: lowest and
    highest [rad].
    """
    beams = np.empty((number, 3))
    low, span = elevations[0], elevations[1] - elevations[0]
    for i in range(number):
        turn, rise = turn_share(first + i, phase[0]), rise_share(first + i, phase[1])
        azimuth, elevation = 2.0 * math.pi * turn, low + span * rise
        # Spherical to Cartesian coordinates.
        flat = math.cos(elevation)
        beams[i, 0], beams[i, 1] = flat * math.cos(azimuth), flat * math.sin(azimuth)
        beams[i, 2] = math.sin(elevation)
    return beams


@njit(cache=True, error_model="numpy")
def beam_noise(first: int, number: int, seed: int) -> Floats:
    """Noise of mean 0, variance 1 and at most MOST_NOISE, of `number` beams from beam `first` on: (number,).

    It is nearly normal: the sum of four uniform numbers, with a kurtosis of 2.7 instead of 3.
    """
    noise = np.empty(number)
    for i in range(number):
        noise[i] = noise_of(first + i, np.uint64(seed))
    return noise


@njit(cache=True, error_model="numpy")
def turn_share(beam, phase):
    """Azimuth of a beam as a share of a turn, in [0, 1)."""
    turn = phase + beam * _TURN
    return turn - np.floor(turn)


@njit(cache=True, error_model="numpy")
def rise_share(beam, phase):
    """Elevation of a beam as a share of the field of view, in [0, 1)."""
    rise = phase + beam * _RISE
    return rise - np.floor(rise)


@njit(cache=True, error_model="numpy")
def noise_of(beam, seed):
    """Noise of one beam, which depends only on beam and seed, not on the other beams requested."""
    mixed = seed + (np.uint64(beam) + np.uint64(1)) * _STEP
    mixed = (mixed ^ (mixed >> _SHIFTS[0])) * _MIX_1
    mixed = (mixed ^ (mixed >> _SHIFTS[1])) * _MIX_2
    mixed = mixed ^ (mixed >> _SHIFTS[2])
    total = (mixed & _PART) + ((mixed >> _PARTS[0]) & _PART) + ((mixed >> _PARTS[1]) & _PART)
    total += mixed >> _PARTS[2]
    return (float(total) - 131070.0) * (
        math.sqrt(3.0) / 65536.0
    )  # four of mean 65535 / 2, variance 65536² / 12


@njit(cache=True, error_model="numpy")
def cloud_scan(
    pose: tuple[float, float, float],
    beams: tuple[int, int, float, float],
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

    pose: of the sensor in the world; beams (first, number, phase in azimuth, phase in elevation) of the pattern
    (`beam_pattern`); noise (seed, σ [m]); sensor (height above the ground [m], lowest and highest
    elevation [rad], nearest and farthest distance [m]); heights (lowest, highest) and spans (nearest, farthest):
    limits of the points that count [m]; circles (C, 3), edges (E, 4) and those of an
    `EdgeGrid`. The middle of bin i is at −π + i · 2π / bins.
    """
    ranges = np.full(num_bins, np.float32(np.inf))
    first, number, phase = beams[0], beams[1], (beams[2], beams[3])
    height, elevation_min, rise_span = sensor[0], sensor[1], sensor[2] - sensor[1]
    max_noise = MOST_NOISE * noise[1]
    frame, cells, in_cells = grid
    # Sort the obstacles by bearing, and keep those of each bucket that a beam may hit first.
    starts, items = by_bearing(pose, circles, edges, min(sensor[4], spans[1] + max_noise))
    stops, shapes, nearest_gaps = _visible(pose, starts, items, circles, edges)
    nearest_gaps = np.minimum(nearest_gaps, nearest(pose[0], pose[1], frame, cells, in_cells))
    # Elevations within which a beam can give a point that counts, for each bucket and over all of them.
    low, high = _elevations(nearest_gaps, sensor, heights, max_noise)
    lowest, highest = (low.min() - elevation_min) / rise_span, (high.max() - elevation_min) / rise_span
    chosen = beams_between(first, number, phase[1], lowest, highest)
    turns, buckets, elevations = _aim(chosen, phase, pose[2], (elevation_min, rise_span))
    chosen, turns, buckets, elevations = _within(low, high, chosen, turns, buckets, elevations)
    directions, errors = _directions(chosen, turns, pose[2], elevations, noise)
    for n in range(len(chosen)):
        # Horizontal range to the first obstacle, of infinite height, or to the ground if that is nearer.
        bucket, ray, reach = buckets[n], (directions[0, n], directions[1, n], 0.0), np.inf
        for j in range(starts[bucket], stops[0, bucket]):
            centre = (shapes[j, 0], shapes[j, 1], shapes[j, 2])
            reach = min(reach, to_circle(ray, centre, -np.inf, np.inf))
        for j in range(stops[0, bucket], stops[1, bucket]):
            ends = (shapes[j, 0], shapes[j, 1], shapes[j, 2], shapes[j, 3])
            reach = min(reach, to_edge(ray, ends, -np.inf, np.inf))
        if len(in_cells):
            beam = (ray[0], ray[1])
            reach = first_hit(pose[0], pose[1], (1.0, 0.0), beam, reach, frame, cells, in_cells)
        cos, sin = directions[2, n], directions[3, n]
        if height * cos + reach * sin < 0.0:
            reach = -height * cos / sin  # the ground is nearer
        distance = reach / cos
        if distance > sensor[4]:
            continue
        # Height and horizontal range of the noisy point; if it counts, it goes into the bin of its azimuth.
        distance += errors[n]
        z, horizontal = height + distance * sin, distance * cos
        if distance >= sensor[3] and heights[0] <= z <= heights[1] and spans[0] <= horizontal <= spans[1]:
            k = int((turns[n] + 0.5 - np.floor(turns[n] + 0.5)) * num_bins + 0.5)
            k = 0 if k == num_bins else k
            ranges[k] = min(ranges[k], np.float32(horizontal))
    return ranges


@njit(cache=True, error_model="numpy")
def _aim(beams, phase, yaw, rises):
    """Azimuth about the sensor as a share of a turn, bucket, and elevation [rad] of each beam: 3 × (N,).

    rises: lowest elevation and span [rad]. The loop is vectorised.
    """
    heading = yaw / (2.0 * math.pi)
    turns, buckets, elevations = np.empty(len(beams)), np.empty(len(beams), np.int64), np.empty(len(beams))
    for n in range(len(beams)):
        turns[n] = turn_share(beams[n], phase[0])
        beam_turn = turns[n] + heading
        beam_turn -= np.floor(beam_turn)
        buckets[n] = min(int(beam_turn * BUCKETS), BUCKETS - 1)
        elevations[n] = rises[0] + rises[1] * rise_share(beams[n], phase[1])
    return turns, buckets, elevations


@njit(cache=True, error_model="numpy")
def _within(low, high, beams, turns, buckets, elevations):
    """Keep the beams within the elevations of their buckets; the arrays are overwritten. No branches, for speed."""
    count = 0
    for n in range(len(beams)):
        bucket, elevation = buckets[n], elevations[n]
        beams[count], turns[count], buckets[count], elevations[count] = beams[n], turns[n], bucket, elevation
        count += (elevation >= low[bucket]) & (elevation <= high[bucket])
    return beams[:count], turns[:count], buckets[:count], elevations[:count]


@njit(cache=True, error_model="numpy")
def _directions(beams, turns, yaw, elevations, noise):
    """Cosine and sine of each beam's bearing in the world and of its elevation, (4, N), and its error (N,) [m].

    The loops are vectorised.
    """
    heading, seed = yaw / (2.0 * math.pi), np.uint64(noise[0])
    directions, errors = np.empty((4, len(beams))), np.empty(len(beams))
    for n in range(len(beams)):
        beam_turn = turns[n] + heading
        directions[0, n], directions[1, n] = direction(beam_turn - np.floor(beam_turn))
    for n in range(len(beams)):
        directions[2, n], directions[3, n] = direction(elevations[n] / (2.0 * math.pi))
    for n in range(len(beams)):
        errors[n] = noise[1] * noise_of(beams[n], seed)
    return directions, errors


@njit(cache=True, error_model="numpy")
def beams_between(first, number, phase, lowest, highest):
    """Beams whose elevation lies between two shares of the field of view, in order, and perhaps some next to them.

    From beam to beam the elevation rotates by _RISE, and a rotation returns to an interval after one of three
    numbers of steps. Source: N. B. Slater 1967, "Gaps and steps for the sequence nθ mod 1".
    """
    chosen, count = np.empty(number, np.int64), 0
    # The interval is wider than asked for by the rounding errors, which thus cannot hide a beam.
    slack = _ROUNDING * (first + number)
    low, length = max(lowest, 0.0) - slack, min(highest, 1.0) - max(lowest, 0.0) + 2.0 * slack
    # The least numbers of steps that lead up, and down, by less than its length.
    up, down = 1, 1
    while rise_share(up, 0.0) >= length and up < number:
        up += 1
    while 1.0 - rise_share(down, 0.0) >= length and down < number:
        down += 1
    rise, fall = rise_share(up, 0.0), 1.0 - rise_share(down, 0.0)
    beam, is_found = first, False
    while beam < first + number:
        above = rise_share(beam, phase) - low + slack
        above -= np.floor(above) + slack
        if 0.0 <= above <= length:
            chosen[count] = beam
            count += 1
            is_found = True
        # Up, down, or both if one alone leads outside.
        if not is_found:
            beam += 1
        elif above + rise < length:
            beam += up
        elif above >= fall:
            beam += down
        else:
            beam += up + down
    return chosen[:count]


@njit(cache=True, error_model="numpy")
def _visible(pose, starts, items, circles, edges):
    """Obstacles of each bucket without those that others hide: stops (2, BUCKETS), shapes (N, 4), nearest (BUCKETS,).

    Bucket b has the circles [x, y, r, 0] from starts[b] to stops[0, b], and then the edges [x0, y0, x1, y1] to
    stops[1, b], relative to the pose. nearest: lower bound of the horizontal range to the first of them [m], inf
    without any.
    """
    relative, gaps = _relative(pose, circles, edges)
    stops, shapes = np.empty((2, BUCKETS), np.int64), np.empty((len(items), 4))
    nearest, least = np.full(BUCKETS, np.inf), np.empty(len(items))
    for bucket in range(BUCKETS):
        start, stop = starts[bucket], starts[bucket + 1]
        x0, y0, x1, y1 = (
            _BORDERS[bucket, 0],
            _BORDERS[bucket, 1],
            _BORDERS[bucket + 1, 0],
            _BORDERS[bucket + 1, 1],
        )
        # Least range to each obstacle; and the farthest that a beam gets, since an obstacle covers the whole bucket.
        farthest = np.inf
        for j in range(start, stop):
            i = items[j]
            least[j] = gaps[i]
            ax, ay, bx, by = relative[i, 0], relative[i, 1], relative[i, 2], relative[i, 3]
            # Signed distances of the centre, with radius bx, or of the first end from the borders.
            a0, a1 = ax * y0 - ay * x0, ax * y1 - ay * x1
            if i < len(circles):
                if gaps[i] > 0.0 and ax * x0 + ay * y0 > 0.0 and max(abs(a0), abs(a1)) < bx - _SURE:
                    farthest = min(farthest, gaps[i] + bx)
                continue
            b0, b1 = bx * y0 - by * x0, bx * y1 - by * x1
            if (max(a0, a1) < -_SURE and min(b0, b1) > _SURE) or (
                min(a0, a1) > _SURE and max(b0, b1) < -_SURE
            ):
                # Between the borders the range is at most that on one of them, and hardly less than on both.
                cross = ax * by - ay * bx
                range_0, range_1 = cross / (a0 - b0), cross / (a1 - b1)
                if range_0 > 0.0 and range_1 > 0.0:
                    farthest = min(farthest, max(range_0, range_1))
                    least[j] = max(least[j], min(range_0, range_1) * _WIDTH_COS)
        # Copy the obstacles that are not farther away.
        stops[0, bucket] = stops[1, bucket] = start
        for j in range(start, stop):
            if least[j] <= farthest * (1.0 + _SLACK):
                i, slot = items[j], stops[1, bucket]
                for k in range(4):
                    shapes[slot, k] = relative[i, k]
                stops[0, bucket] += i < len(circles)
                stops[1, bucket] += 1
                nearest[bucket] = min(nearest[bucket], least[j])
    return stops, shapes, nearest


@njit(cache=True, error_model="numpy")
def _relative(pose, circles, edges):
    """Circles, then edges, relative to the pose, (C + E, 4), and the horizontal distance to each (C + E,) [m]."""
    relative, gaps = np.zeros((len(circles) + len(edges), 4)), np.empty(len(circles) + len(edges))
    for i in range(len(circles)):
        x, y, r = circles[i, 0] - pose[0], circles[i, 1] - pose[1], circles[i, 2]
        relative[i, 0], relative[i, 1], relative[i, 2] = x, y, r
        gaps[i] = math.sqrt(x * x + y * y) - r
    for e in range(len(edges)):
        i = len(circles) + e
        for k in range(4):
            relative[i, k] = edges[e, k] - pose[k % 2]
        square = point_to_segment(0.0, 0.0, relative[i, 0], relative[i, 1], relative[i, 2], relative[i, 3])
        gaps[i] = math.sqrt(square)
    return relative, gaps


@njit(cache=True, error_model="numpy")
def _elevations(nearest, sensor, heights, max_noise):
    """Lowest and highest elevation of the beams in each bucket that may give a point that counts: 2 × (BUCKETS,).

    A beam hits nothing nearer than the nearest obstacle of its bucket, at nearest (BUCKETS,) [m], or the ground, and
    its noise is at most `max_noise` [m].
    """
    low, high = np.full(BUCKETS, -math.pi / 2.0), np.full(BUCKETS, math.pi / 2.0)
    below, above = max(sensor[0] - heights[0], 0.0), max(heights[1] - sensor[0], 0.0)
    ground_counts = heights[0] <= max_noise
    for bucket in range(BUCKETS):
        # A steeper beam is above or below the heights that count where it meets the nearest obstacle.
        gap = nearest[bucket] - max_noise
        if gap > 0.0:
            high[bucket] = unsigned_bearing(gap, above) + _SLACK_RAD
            if not ground_counts:
                low[bucket] = -unsigned_bearing(gap, below) - _SLACK_RAD
    return low, high
