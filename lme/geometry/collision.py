"""Exact clearance between a moving footprint and the world.

The distance from the middle pose bounds the distance from every pose of the motion. A broad phase therefore drops
the obstacles that cannot be the nearest at any pose; the others are tested exactly at every pose.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def sweep(
    poses: Floats, box: tuple[float, float, float], circles: Floats, edges: Floats
) -> tuple[float, int]:
    """Least clearance [m] along a motion and the first pose in contact.

    poses (K, 3) of the footprint in the world, K ≥ 1; box (half_length, half_width, rounding) [m];
    circles (C, 3) solid [x, y, r]; edges (E, 4) thin [x0, y0, x1, y1].
    Returns the least distance over the poses up to the first contact, 0.0 with contact and inf in an empty world,
    and the index of the first pose in contact, −1 without contact. A distance of 0 is contact.
    """
    half_length, half_width, rounding = box
    near_circles, near_edges = _broad_phase(poses, half_length, half_width, rounding, circles, edges)
    min_clearance = np.inf
    # Distance to the sharp rectangle at each pose, less the rounding of its corners.
    for k in range(len(poses)):
        frame = (poses[k, 0], poses[k, 1], math.cos(poses[k, 2]), math.sin(poses[k, 2]))
        clearance = min(
            _to_circles(frame, half_length, half_width, circles, near_circles),
            _to_edges(frame, half_length, half_width, edges, near_edges),
        )
        min_clearance = min(min_clearance, clearance - rounding)
        if min_clearance <= 0.0:
            return 0.0, k
    return min_clearance, -1


@njit(cache=True, error_model="numpy")
def _broad_phase(poses, half_length, half_width, rounding, circles, edges):
    """Indices of the circles and of the edges that may be the nearest, or in contact, at some pose.

    For an obstacle at distance d from the middle position, the clearance is at most d − r_min at the middle pose,
    and at least d − r_max − travel at every pose.
    """
    x, y = poses[len(poses) // 2, 0], poses[len(poses) // 2, 1]
    # Greatest distance of a pose from the middle one.
    travel = 0.0
    for k in range(len(poses)):
        travel = max(travel, math.hypot(poses[k, 0] - x, poses[k, 1] - y))
    to_circle, to_edge = _circle_distances(x, y, circles), _edge_distances(x, y, edges)
    # Distance from the middle position to the nearest obstacle.
    nearest = np.inf
    for i in range(len(circles)):
        nearest = min(nearest, to_circle[i])
    for i in range(len(edges)):
        nearest = min(nearest, to_edge[i])
    # The clearance at the middle pose is at most nearest − r_min, so farther obstacles cannot be the nearest.
    r_min = min(half_length, half_width) + rounding
    r_max = math.hypot(half_length, half_width) + rounding
    limit = (max(nearest - r_min, 0.0) + r_max + travel) * (1.0 + 1e-9)
    return _up_to(to_circle, limit), _up_to(to_edge, limit)


@njit(cache=True, error_model="numpy")
def _up_to(distances, limit):
    """Indices of the distances up to the limit. This loop compiles much faster than NumPy's functions."""
    indices = np.empty(len(distances), np.int64)
    count = 0
    for i in range(len(distances)):
        indices[count] = i
        count += distances[i] <= limit
    return indices[:count]


@njit(cache=True, error_model="numpy")
def _circle_distances(x, y, circles):
    """Distance from (x, y) to each circle, negative inside."""
    distances = np.empty(len(circles))
    for i in range(len(circles)):
        dx, dy = circles[i, 0] - x, circles[i, 1] - y
        distances[i] = math.sqrt(dx * dx + dy * dy) - circles[i, 2]
    return distances


@njit(cache=True, error_model="numpy")
def _edge_distances(x, y, edges):
    """Distance from (x, y) to each edge."""
    distances = np.empty(len(edges))
    for i in range(len(edges)):
        distances[i] = math.sqrt(point_to_segment(x, y, edges[i, 0], edges[i, 1], edges[i, 2], edges[i, 3]))
    return distances


@njit(cache=True, error_model="numpy")
def _to_circles(frame, half_length, half_width, circles, indices):
    """Distance from the rectangle at `frame` to the nearest of the chosen circles; negative in contact."""
    x, y, cos, sin = frame
    nearest = np.inf
    for i in indices:
        dx, dy = circles[i, 0] - x, circles[i, 1] - y
        outside_x = max(abs(cos * dx + sin * dy) - half_length, 0.0)
        outside_y = max(abs(cos * dy - sin * dx) - half_width, 0.0)
        nearest = min(nearest, math.sqrt(outside_x * outside_x + outside_y * outside_y) - circles[i, 2])
    return nearest


@njit(cache=True, error_model="numpy")
def _to_edges(frame, half_length, half_width, edges, indices):
    """Distance from the rectangle at `frame` to the nearest of the chosen edges; 0 where they meet."""
    x, y, cos, sin = frame
    min_square = np.inf
    for i in indices:
        # The segment in the frame of the rectangle.
        ax, ay, bx, by = edges[i, 0] - x, edges[i, 1] - y, edges[i, 2] - x, edges[i, 3] - y
        segment = (cos * ax + sin * ay, cos * ay - sin * ax, cos * bx + sin * by, cos * by - sin * bx)
        if _crosses(segment, half_length, half_width):
            return 0.0
        min_square = min(min_square, _rectangle_to_segment(segment, half_length, half_width))
    return math.sqrt(min_square)


@njit(cache=True, error_model="numpy")
def _crosses(segment, half_length, half_width):
    """Return whether a segment meets the rectangle centred on the origin, by the separating axis theorem."""
    ax, ay, bx, by = segment
    if min(ax, bx) > half_length or max(ax, bx) < -half_length:
        return False
    if min(ay, by) > half_width or max(ay, by) < -half_width:
        return False
    # The third axis is the normal of the segment.
    dx, dy = bx - ax, by - ay
    return abs(ax * dy - ay * dx) <= half_length * abs(dy) + half_width * abs(dx)


@njit(cache=True, error_model="numpy")
def _rectangle_to_segment(segment, half_length, half_width):
    """Squared distance between a rectangle and a segment that do not meet.

    It is attained at an end of the segment or at a corner of the rectangle.
    """
    ax, ay, bx, by = segment
    min_square = min(
        _point_to_box(ax, ay, half_length, half_width), _point_to_box(bx, by, half_length, half_width)
    )
    # Corners of the rectangle to the segment.
    for x in (-half_length, half_length):
        for y in (-half_width, half_width):
            min_square = min(min_square, point_to_segment(x, y, ax, ay, bx, by))
    return min_square


@njit(cache=True, error_model="numpy")
def _point_to_box(x, y, half_length, half_width):
    """Squared distance from a point to the rectangle."""
    outside_x, outside_y = max(abs(x) - half_length, 0.0), max(abs(y) - half_width, 0.0)
    return outside_x * outside_x + outside_y * outside_y


@njit(cache=True, error_model="numpy")
def point_to_segment(x, y, x0, y0, x1, y1):
    """Squared distance from a point to a segment, which may have length 0."""
    ex, ey, qx, qy = x1 - x0, y1 - y0, x - x0, y - y0
    length = max(ex * ex + ey * ey, 1e-300)
    part = min(max((qx * ex + qy * ey) / length, 0.0), 1.0)
    dx, dy = qx - part * ex, qy - part * ey
    return dx * dx + dy * dy


@njit(cache=True, error_model="numpy")
def first_event(travel, goal, tolerance, box, circles, edges):
    """Number of poses up to the first event, least clearance [m], whether in contact, and whether arrived.

    travel (K, 3); goal (2,) with its tolerance [m]; box (half_length, half_width, rounding) [m] of what collides;
    circles (C, 3) and edges (E, 4). The motion ends with the first pose in contact or within the tolerance, and
    contact on arrival counts as contact only.
    """
    # Poses after the arrival do not count.
    num_driven, arrived = first_arrival(travel, goal, tolerance)
    clearance, contact = sweep(travel[:num_driven], box, circles, edges)
    if contact >= 0:
        return contact + 1, clearance, True, False
    return num_driven, clearance, False, arrived


@njit(cache=True, error_model="numpy")
def first_arrival(travel, goal, tolerance):
    """Number of poses (K, 3) up to the first within the tolerance of the goal (2,) [m], and whether there is one."""
    for k in range(len(travel)):
        if math.hypot(travel[k, 0] - goal[0], travel[k, 1] - goal[1]) <= tolerance:
            return k + 1, True
    return len(travel), False
