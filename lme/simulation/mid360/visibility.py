"""What a horizontal beam may hit first, for each bucket of bearing.

An obstacle that covers a bucket hides what lies behind it there. All others are kept, so the least of a beam's exact
ranges to the obstacles that its bucket keeps is that to all obstacles.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64

from lme.geometry.collision import point_to_segment
from lme.simulation.mid360.raycast3d import BUCKETS, bucket_spans

_SLACK, _SURE = 1e-9, 1e-9  # [-], [m] far above the rounding errors of ranges
_WIDTH_COS = math.cos(2.0 * math.pi / BUCKETS)  # of the angle between the borders of a bucket
# Borders of the buckets of two turns, since the buckets of an obstacle are counted on beyond the last one.
_BORDER_COS, _BORDER_SIN = (f(2.0 * math.pi * np.arange(2 * BUCKETS + 1) / BUCKETS) for f in (np.cos, np.sin))


@njit(cache=True, error_model="numpy")
def visible(pose, circles, edges, range_max):
    """Obstacles that a horizontal beam may hit first, by bucket of its bearing.

    pose: x and y of the sensor; circles (C, 3), edges (E, 4) in the world; range_max: farther circles do not count [m].
    Returns

    - bounds (2, BUCKETS): lower and upper bound of the range [m], inf where a beam may hit nothing;
    - edge_in (4, BUCKETS): an edge of each bucket [x0, y0, x1, y1] relative to the pose, zeros where there is none;
    - link_of (BUCKETS,), links (2, K): its other obstacles, as a list of links [obstacle, next link] that ends with −1;
    - shapes (4, C + E): circles [x, y, r, 0], then edges, relative to the pose.
    """
    shapes, gaps = _relative(pose, circles, edges)
    first, number = bucket_spans(pose, circles, edges, range_max)
    nearness, cover = _nearness(shapes, gaps, first, number, len(circles))
    # Keep the obstacles that are not behind what covers the bucket.
    nearest, edge_of = np.zeros(BUCKETS), np.full(BUCKETS, -1, np.int32)
    link_of, links = np.full(BUCKETS, -1, np.int32), np.empty((2, len(nearness)), np.int32)
    num_links, start = 0, uint64(0)
    for i in range(len(gaps)):
        # Most obstacles are hidden everywhere; this loop is vectorised.
        begin, size, count = uint64(first[i]), uint64(number[i]), 0
        for j in range(size):
            count += nearness[start + j] >= cover[begin + j]
        for j in range(size if count else uint64(0)):
            if nearness[start + j] >= cover[begin + j]:
                bucket = first[i] + int(j)
                bucket = bucket - BUCKETS if bucket >= BUCKETS else bucket
                if i >= len(circles) and edge_of[bucket] < 0:
                    edge_of[bucket] = i
                else:
                    links[0, num_links], links[1, num_links] = i, link_of[bucket]
                    link_of[bucket] = num_links
                    num_links += 1
                nearest[bucket] = max(nearest[bucket], nearness[start + j])
        start += size + uint64(1)
    bounds, edge_in = np.empty((2, BUCKETS)), np.zeros((4, BUCKETS))
    for bucket in range(BUCKETS):
        bounds[0, bucket] = (1.0 - _SLACK) / nearest[bucket]
        bounds[1, bucket] = (1.0 + _SLACK) / cover[bucket]
        for k in range(4 if edge_of[bucket] >= 0 else 0):
            edge_in[k, bucket] = shapes[k, edge_of[bucket]]
    return bounds, edge_in, link_of, links, shapes


@njit(cache=True, error_model="numpy")
def _relative(pose, circles, edges):
    """Circles, then edges, relative to the pose, (4, C + E), and the distance to each (C + E,) [m]."""
    shapes, gaps = np.zeros((4, len(circles) + len(edges))), np.empty(len(circles) + len(edges))
    for i in range(len(circles)):
        x, y, r = circles[i, 0] - pose[0], circles[i, 1] - pose[1], circles[i, 2]
        shapes[0, i], shapes[1, i], shapes[2, i] = x, y, r
        gaps[i] = max(math.sqrt(x * x + y * y) - r, 0.0)
    for e in range(len(edges)):
        i = len(circles) + e
        ax, ay, bx, by = (
            edges[e, 0] - pose[0],
            edges[e, 1] - pose[1],
            edges[e, 2] - pose[0],
            edges[e, 3] - pose[1],
        )
        shapes[0, i], shapes[1, i], shapes[2, i], shapes[3, i] = ax, ay, bx, by
        gaps[i] = math.sqrt(point_to_segment(0.0, 0.0, ax, ay, bx, by))
    return shapes, gaps


@njit(cache=True, error_model="numpy")
def _nearness(shapes, gaps, first, number, num_circles):
    """Reciprocals of ranges [1/m]: they are linear between the borders of a bucket, and cost no division there.

    Returns an upper bound for each obstacle in each of its buckets, where one value follows after each obstacle, and
    that beyond which an obstacle of a bucket is hidden, for two turns: 0 where none covers the bucket.
    """
    nearness, cover = np.empty(number.sum() + len(number)), np.zeros(2 * BUCKETS)
    start, one = uint64(0), uint64(1)
    for i in range(len(number)):
        begin, size = uint64(first[i]), uint64(number[i])
        ax, ay, bx, by, nearest = shapes[0, i], shapes[1, i], shapes[2, i], shapes[3, i], 1.0 / gaps[i]
        if i < num_circles:
            for j in range(size):
                x0, y0 = _BORDER_COS[begin + j], _BORDER_SIN[begin + j]
                x1, y1 = _BORDER_COS[begin + j + one], _BORDER_SIN[begin + j + one]
                across = max(abs(ax * y0 - ay * x0), abs(ax * y1 - ay * x1))
                is_covered = gaps[i] > 0.0 and ax * x0 + ay * y0 > 0.0 and across < bx - _SURE
                cover[begin + j] = max(cover[begin + j], 1.0 / (gaps[i] + bx) if is_covered else 0.0)
                nearness[start + j] = nearest
        else:
            # At each border, if the edge surely crosses it; else 0.
            along_x, along_y, cross = bx - ax, by - ay, ax * by - ay * bx
            for j in range(size + one):
                cos, sin = _BORDER_COS[begin + j], _BORDER_SIN[begin + j]
                a, b = ax * sin - ay * cos, bx * sin - by * cos
                at_border = (along_y * cos - along_x * sin) / cross
                is_crossed = (min(a, b) < -_SURE) & (max(a, b) > _SURE) & (at_border > 0.0)
                nearness[start + j] = at_border if is_crossed else 0.0
            for j in range(size):
                low = min(nearness[start + j], nearness[start + j + one])
                high = max(nearness[start + j], nearness[start + j + one])
                cover[begin + j] = max(cover[begin + j], low)
                nearness[start + j] = min(high / _WIDTH_COS, nearest) if low > 0.0 else nearest
        start += size + one
    for bucket in range(BUCKETS):
        cover[bucket] = max(cover[bucket], cover[bucket + BUCKETS]) * (1.0 - _SLACK)
        cover[bucket + BUCKETS] = cover[bucket]
    return nearness, cover
