"""The planar scan of a level 3D lidar among upright obstacles, without its cloud.

Obstacles reach above every height that counts, so a beam's first hit follows from its azimuth alone. Most beams of
a cloud pass above or below the heights that count wherever they hit; they are left out by their elevation.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.kernels.bearing import direction
from lme.kernels.edge_grid import first_hit, nearest
from lme.sim.mid360.kernels.beam_pattern import MOST_NOISE, noise_of, rise_share, turn_share
from lme.sim.mid360.kernels.raycast3d import BUCKETS, by_bearing, to_circle, to_edge
from lme.types import Floats, Ints


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
    (`beam_pattern.py`); noise (seed, σ [m]); sensor (height above the ground [m], lowest and highest
    elevation [rad], nearest and farthest distance [m]); heights (lowest, highest) and spans (nearest, farthest):
    limits of the points that count [m]; circles (C, 3), edges (E, 4) and those of an
    `EdgeGrid`. The middle of bin i is at −π + i · 2π / bins.
    """
    ranges = np.full(num_bins, np.float32(np.inf))
    first, number, phase = beams[0], beams[1], (beams[2], beams[3])
    height, elevation_min, rise_span = sensor[0], sensor[1], sensor[2] - sensor[1]
    most = MOST_NOISE * noise[1]
    frame, cells, in_cells = grid
    starts, items = by_bearing(pose, circles, edges, min(sensor[4], spans[1] + most))
    near = np.minimum(
        _nearest(pose, starts, items, circles, edges), nearest(pose[0], pose[1], frame, cells, in_cells)
    )
    low, high = _elevations(near, sensor, heights, most)
    lowest, highest = (low.min() - elevation_min) / rise_span, (high.max() - elevation_min) / rise_span
    heading = pose[2] / (2.0 * math.pi)
    for beam in _between(first, number, phase[1], lowest, highest):
        turn, rise = turn_share(beam, phase[0]), rise_share(beam, phase[1])
        place = turn + heading
        place -= np.floor(place)
        bucket = min(int(place * BUCKETS), BUCKETS - 1)
        elevation = elevation_min + rise_span * rise
        if elevation < low[bucket] or elevation > high[bucket]:
            continue
        flat = direction(place)
        reach = _first_hit(flat, pose, items, starts[bucket], starts[bucket + 1], circles, edges)
        reach = first_hit(pose[0], pose[1], (1.0, 0.0), flat, reach, frame, cells, in_cells)
        cos, sin = direction(elevation / (2.0 * math.pi))
        if height * cos + reach * sin < 0.0:
            reach = -height * cos / sin  # the ground is nearer
        distance = reach / cos
        if distance > sensor[4]:
            continue
        if noise[1] > 0.0:
            distance += noise[1] * noise_of(beam, np.uint64(noise[0]))
        up, flat = height + distance * sin, distance * cos
        if distance >= sensor[3] and heights[0] <= up <= heights[1] and spans[0] <= flat <= spans[1]:
            k = int((turn + 0.5 - np.floor(turn + 0.5)) * num_bins + 0.5) % num_bins
            ranges[k] = min(ranges[k], np.float32(flat))
    return ranges


@njit(cache=True, error_model="numpy")
def _between(first, number, phase, lowest, highest):
    """The beams with an elevation between two shares of the field of view. No branches, for speed."""
    kept, count = np.empty(number, np.int64), 0
    for beam in range(first, first + number):
        rise = rise_share(beam, phase)
        kept[count] = beam
        count += (rise >= lowest) & (rise <= highest)
    return kept[:count]


@njit(cache=True, error_model="numpy")
def _nearest(pose, starts, items, circles, edges):
    """Distance to the nearest obstacle of each bucket [m], inf if it has none: (BUCKETS,)."""
    gaps, near = _gaps(pose, circles, edges), np.full(BUCKETS, np.inf)
    for bucket in range(BUCKETS):
        for j in range(starts[bucket], starts[bucket + 1]):
            near[bucket] = min(near[bucket], gaps[items[j]])
    return near


@njit(cache=True, error_model="numpy")
def _elevations(near, sensor, heights, most):
    """Lowest and highest elevation of the beams in each bucket that may give a point that counts: 2 × (BUCKETS,).

    A beam hits nothing nearer than the nearest obstacle of its bucket, at near (BUCKETS,) [m], or the ground, and its
    noise is at most `most` [m].
    """
    low, high = np.full(BUCKETS, -math.pi / 2.0), np.full(BUCKETS, math.pi / 2.0)
    below, above = max(sensor[0] - heights[0], 0.0), max(heights[1] - sensor[0], 0.0)
    ground_counts = heights[0] <= most
    for bucket in range(BUCKETS):
        if near[bucket] > most:
            high[bucket] = math.atan(above / (near[bucket] - most))
            if not ground_counts:
                low[bucket] = -math.atan(below / (near[bucket] - most))
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
