"""Planar scan of a level 3D lidar among upright obstacles, computed without its cloud.

Obstacles reach above every height that counts, so a beam's first hit follows from its azimuth alone. Most beams of
a cloud hit above or below the heights that count, wherever they hit; they are skipped because of their elevation.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.fan import direction
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
    # Sort the obstacles by bearing, and find the distance to the nearest one in each bucket.
    starts, items = by_bearing(pose, circles, edges, min(sensor[4], spans[1] + max_noise))
    nearest_gaps = np.minimum(
        _nearest(pose, starts, items, circles, edges), nearest(pose[0], pose[1], frame, cells, in_cells)
    )
    # Elevations within which a beam can give a point that counts, for each bucket and over all of them.
    low, high = _elevations(nearest_gaps, sensor, heights, max_noise)
    lowest, highest = (low.min() - elevation_min) / rise_span, (high.max() - elevation_min) / rise_span
    heading = pose[2] / (2.0 * math.pi)
    for beam in _between(first, number, phase[1], lowest, highest):
        turn, rise = turn_share(beam, phase[0]), rise_share(beam, phase[1])
        beam_turn = turn + heading
        beam_turn -= np.floor(beam_turn)
        bucket = min(int(beam_turn * BUCKETS), BUCKETS - 1)
        elevation = elevation_min + rise_span * rise
        if elevation < low[bucket] or elevation > high[bucket]:
            continue
        # Horizontal range to the first obstacle, of infinite height, or to the ground if that is nearer.
        horizontal = direction(beam_turn)
        reach = _first_hit(horizontal, pose, items, starts[bucket], starts[bucket + 1], circles, edges)
        reach = first_hit(pose[0], pose[1], (1.0, 0.0), horizontal, reach, frame, cells, in_cells)
        cos, sin = direction(elevation / (2.0 * math.pi))
        if height * cos + reach * sin < 0.0:
            reach = -height * cos / sin  # the ground is nearer
        distance = reach / cos
        if distance > sensor[4]:
            continue
        if noise[1] > 0.0:
            distance += noise[1] * noise_of(beam, np.uint64(noise[0]))
        # Height and horizontal range of the noisy point; if it counts, it goes into the bin of its azimuth.
        z, horizontal = height + distance * sin, distance * cos
        if distance >= sensor[3] and heights[0] <= z <= heights[1] and spans[0] <= horizontal <= spans[1]:
            k = int((turn + 0.5 - np.floor(turn + 0.5)) * num_bins + 0.5) % num_bins
            ranges[k] = min(ranges[k], np.float32(horizontal))
    return ranges


@njit(cache=True, error_model="numpy")
def _between(first, number, phase, lowest, highest):
    """Beams with an elevation between two shares of the field of view. Without branches, for speed."""
    chosen, count = np.empty(number, np.int64), 0
    for beam in range(first, first + number):
        rise = rise_share(beam, phase)
        chosen[count] = beam
        count += (rise >= lowest) & (rise <= highest)
    return chosen[:count]


@njit(cache=True, error_model="numpy")
def _nearest(pose, starts, items, circles, edges):
    """Distance to the nearest obstacle of each bucket [m], inf if it has none: (BUCKETS,)."""
    gaps, nearest = _gaps(pose, circles, edges), np.full(BUCKETS, np.inf)
    for bucket in range(BUCKETS):
        for j in range(starts[bucket], starts[bucket + 1]):
            nearest[bucket] = min(nearest[bucket], gaps[items[j]])
    return nearest


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
        if nearest[bucket] > max_noise:
            high[bucket] = math.atan(above / (nearest[bucket] - max_noise))
            if not ground_counts:
                low[bucket] = -math.atan(below / (nearest[bucket] - max_noise))
    return low, high


@njit(cache=True, error_model="numpy")
def _gaps(pose, circles, edges):
    """Horizontal distance to each circle, then to each edge [m]."""
    gaps = np.empty(len(circles) + len(edges))
    for i in range(len(circles)):
        gaps[i] = math.hypot(circles[i, 0] - pose[0], circles[i, 1] - pose[1]) - circles[i, 2]
    for i in range(len(edges)):
        x0, y0 = edges[i, 0] - pose[0], edges[i, 1] - pose[1]
        along_x, along_y = edges[i, 2] - edges[i, 0], edges[i, 3] - edges[i, 1]
        length = max(along_x * along_x + along_y * along_y, 1e-300)
        part = min(max(-(x0 * along_x + y0 * along_y) / length, 0.0), 1.0)
        gaps[len(circles) + i] = math.hypot(x0 + part * along_x, y0 + part * along_y)
    return gaps


@njit(cache=True, error_model="numpy")
def _first_hit(flat, pose, items, start, end, circles, edges):
    """Distance along a level direction to the first of some obstacles, inf if there is none [m]."""
    best, ray = np.inf, (flat[0], flat[1], 0.0)
    for j in range(start, end):
        # Items below C are circles and the others edges; their heights are infinite here.
        i = items[j]
        if i < len(circles):
            centre = (circles[i, 0] - pose[0], circles[i, 1] - pose[1], circles[i, 2])
            best = min(best, to_circle(ray, centre, -np.inf, np.inf))
        else:
            i -= len(circles)
            ends = (
                edges[i, 0] - pose[0],
                edges[i, 1] - pose[1],
                edges[i, 2] - pose[0],
                edges[i, 3] - pose[1],
            )
            best = min(best, to_edge(ray, ends, -np.inf, np.inf))
    return best
