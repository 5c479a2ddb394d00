"""Ray casting in 3D against upright obstacles of finite height, the ground and a ceiling.

A ray can only hit obstacles in its horizontal direction. Obstacles are therefore listed by the buckets of bearing
that they cover, and each ray is tested exactly against its bucket's list.
"""

import math

import numpy as np
from numba import njit

from lme.geometry.fan import bearing
from lme.types import Floats

BUCKETS = 720  # of equal angles from bearing 0
_FLAT = 1e-12  # a ray with a smaller horizontal component is vertical


@njit(cache=True, error_model="numpy")
def cast_rays(
    origin: Floats,
    directions: Floats,
    circles: Floats,
    edges: Floats,
    solids: Floats,
    planes: tuple[float, float],
    range_max: float,
) -> Floats:
    """Distance along each ray to the first hit, inf if there is none within range_max: (N,) [m].

    origin (3,); directions (N, 3) unit vectors; circles (C, 5) solid [x, y, r, bottom, top]; edges (E, 6) thin
    upright walls [x0, y0, x1, y1, bottom, top]; solids (P, 4) [first edge, edge after the last, bottom, top]:
    polygons with a lid at the top and at the bottom; planes (ground, ceiling): heights of infinite planes, −inf and
    inf for none. Inside a disc the distance is 0; inside a polygon a ray hits its wall.
    """
    starts, items = by_bearing(origin, circles, edges, range_max)
    x, y, z = origin[0], origin[1], origin[2]
    distances = np.empty(len(directions))
    for k in range(len(directions)):
        ray = (directions[k, 0], directions[k, 1], directions[k, 2])
        # Ground and ceiling first, then the obstacles in the bucket of the ray.
        best = min(_to_height(z, ray[2], planes[0]), _to_height(z, ray[2], planes[1]))
        bucket = _bucket(ray[0], ray[1])
        for j in range(starts[bucket], starts[bucket + 1]):
            i = items[j]
            if i < len(circles):
                centre = (circles[i, 0] - x, circles[i, 1] - y, circles[i, 2])
                best = min(best, to_circle(ray, centre, circles[i, 3] - z, circles[i, 4] - z))
            else:
                i -= len(circles)
                ends = (edges[i, 0] - x, edges[i, 1] - y, edges[i, 2] - x, edges[i, 3] - y)
                best = min(best, to_edge(ray, ends, edges[i, 4] - z, edges[i, 5] - z))
        # The lids of polygons are not among the edges, so they are tested separately.
        distances[k] = _to_lids(origin, ray, edges, solids, best)
        if distances[k] > range_max:
            distances[k] = np.inf
    return distances


@njit(cache=True, error_model="numpy")
def _bucket(x, y):
    """Index of the bucket that holds the direction (x, y), or of its neighbour; 0 for a vertical ray."""
    if x == 0.0 and y == 0.0:
        return 0
    return min(int(bearing(x, y) * (BUCKETS / (2.0 * math.pi))), BUCKETS - 1)


@njit(cache=True, error_model="numpy")
def by_bearing(origin, circles, edges, range_max):
    """Return starts, items: bucket b holds items[starts[b]:starts[b + 1]]. Item i < C: circle i, else edge i − C."""
    first, number = bucket_spans(origin, circles, edges, range_max)
    starts = np.zeros(BUCKETS + 1, np.int64)
    # Counting sort: count the items of each bucket first.
    for i in range(len(first)):
        for j in range(number[i]):
            starts[_wrapped(first[i] + j) + 1] += 1
    # The sums of the counts are the starts; then fill the buckets.
    starts = np.cumsum(starts)
    items, filled = np.empty(starts[-1], np.int64), starts.copy()
    for i in range(len(first)):
        for j in range(number[i]):
            bucket = _wrapped(first[i] + j)
            items[filled[bucket]] = i
            filled[bucket] += 1
    return starts, items


@njit(cache=True, error_model="numpy")
def _wrapped(bucket):
    """Index of a bucket that is counted on beyond a turn; the remainder would take longer."""
    return bucket if bucket < BUCKETS else bucket - BUCKETS


@njit(cache=True, error_model="numpy")
def bucket_spans(origin, circles, edges, range_max):
    """First bucket and number of the buckets that each circle, then each edge, may cover: 2 × (C + E,).

    Buckets are counted on beyond the last one. A circle beyond `range_max` has none.
    """
    first, number = (
        np.empty(len(circles) + len(edges), np.int64),
        np.empty(len(circles) + len(edges), np.int64),
    )
    for i in range(len(circles)):
        x, y = circles[i, 0] - origin[0], circles[i, 1] - origin[1]
        first[i], number[i] = _circle_buckets(x, y, circles[i, 2], range_max)
    for e in range(len(edges)):
        ax, ay, bx, by = (
            edges[e, 0] - origin[0],
            edges[e, 1] - origin[1],
            edges[e, 2] - origin[0],
            edges[e, 3] - origin[1],
        )
        first[len(circles) + e], number[len(circles) + e] = _edge_buckets(ax, ay, bx, by)
    return first, number


@njit(cache=True, error_model="numpy")
def _circle_buckets(x, y, r, range_max):
    """First bucket and number of the buckets that a disc around (x, y) may cover."""
    distance = math.hypot(x, y)
    if distance - r > range_max:
        return 0, 0
    if distance <= r:
        return 0, BUCKETS
    middle, half = math.atan2(y, x), math.asin(r / distance)
    low, high = middle - half, middle + half
    return _span(_bucket(math.cos(low), math.sin(low)), _bucket(math.cos(high), math.sin(high)))


@njit(cache=True, error_model="numpy")
def _edge_buckets(ax, ay, bx, by):
    """First bucket and number of the buckets that an edge may cover; all if the origin is on it or almost."""
    cross, dot = ax * by - ay * bx, ax * bx + ay * by
    is_everywhere = (abs(cross) <= -1e-6 * dot) | ((ax == 0.0) & (ay == 0.0)) | ((bx == 0.0) & (by == 0.0))
    # An end at the origin has no bearing.
    a = 0.0 if is_everywhere else bearing(ax, ay) * (BUCKETS / (2.0 * math.pi))
    b = 0.0 if is_everywhere else bearing(bx, by) * (BUCKETS / (2.0 * math.pi))
    low, high = min(a if cross >= 0.0 else b, BUCKETS - 1.0), min(b if cross >= 0.0 else a, BUCKETS - 1.0)
    first, number = _span(int(low), int(high))
    return (0 if is_everywhere else first), (BUCKETS if is_everywhere else number)


@njit(cache=True, error_model="numpy")
def _span(low, high):
    """First bucket and number of the buckets counter-clockwise from one to another, and one more at either end."""
    number = high - low + 3
    number += BUCKETS if high < low else 0
    return (low - 1 if low > 0 else BUCKETS - 1), min(number, BUCKETS)


@njit(cache=True, error_model="numpy")
def _to_height(z, rise, height):
    """Distance along a ray from height z to another height; inf if the ray does not reach it."""
    gap = height - z
    return gap / rise if gap * rise > 0.0 else np.inf


@njit(cache=True, error_model="numpy")
def to_circle(ray, centre, bottom, top):
    """Distance along a ray from the origin to an upright cylinder with lids: 0 inside, inf if the ray misses.

    The cylinder is the intersection of an infinite cylinder and the space between two heights.
    """
    dx, dy, rise = ray
    x, y, r = centre
    flat = dx * dx + dy * dy
    # Interval of t with |t d − c| ≤ r in the plane; all t if a vertical ray starts inside.
    if flat < _FLAT * _FLAT:
        if x * x + y * y > r * r:
            return np.inf
        enter, leave = -np.inf, np.inf
    else:
        across = x * dy - y * dx
        depth = r * r * flat - across * across
        if depth < 0.0:
            return np.inf
        along, half = (x * dx + y * dy) / flat, math.sqrt(depth) / flat
        enter, leave = along - half, along + half
    if rise == 0.0:
        return max(enter, 0.0) if bottom <= 0.0 <= top and leave >= max(enter, 0.0) else np.inf
    # Intersect it with the interval between bottom and top.
    low, high = bottom / rise, top / rise
    enter, leave = max(enter, min(low, high), 0.0), min(leave, max(low, high))
    return enter if enter <= leave else np.inf


@njit(cache=True, error_model="numpy")
def to_edge(ray, ends, bottom, top):
    """Distance along a ray from the origin to an upright wall; inf if the ray misses it or runs along it.

    A hit is decided by the sides of the ray on which the wall's ends lie, as in the planar kernel, so that no ray
    slips through a shared corner.
    """
    dx, dy, rise = ray
    ax, ay, bx, by = ends
    # Both ends on the same side of the ray: no crossing.
    across_start, across_end = ax * dy - ay * dx, bx * dy - by * dx
    if (across_start > 0.0) == (across_end > 0.0):
        return np.inf
    # Distance to the wall: t = (a × b) / (a × d − b × d).
    distance = (ax * by - ay * bx) / (across_start - across_end)
    hit = distance >= 0.0 and bottom <= distance * rise <= top
    return distance if hit else np.inf


@njit(cache=True, error_model="numpy")
def _to_lids(origin, ray, edges, solids, nearest):
    """Distance along a ray to the nearest lid that it hits from outside, at most `nearest`."""
    for p in range(len(solids)):
        height = solids[p, 3] if ray[2] < 0.0 else solids[p, 2]
        distance = _to_height(origin[2], ray[2], height)
        if distance < nearest:
            x, y = origin[0] + distance * ray[0], origin[1] + distance * ray[1]
            if _inside(x, y, edges, int(solids[p, 0]), int(solids[p, 1])):
                nearest = distance
    return nearest


@njit(cache=True, error_model="numpy")
def _inside(x, y, edges, start, stop):
    """Return whether a point lies in the polygon of edges start…stop − 1, by the even–odd rule."""
    is_inside = False
    for i in range(start, stop):
        x0, y0, x1, y1 = edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]
        if (y0 > y) != (y1 > y) and x < x0 + (y - y0) * (x1 - x0) / (y1 - y0):
            is_inside = not is_inside
    return is_inside
