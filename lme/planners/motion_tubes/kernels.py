"""Motion tubes: the ranges that free beams must exceed, and selection of the best free tube."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Bools, Floats, Ints

Ranges = NDArray[np.float32]

_TWO_PI = 2.0 * math.pi
_STRAIGHT = 1e-9  # [1/m] smaller curvatures are straight


@njit(cache=True, error_model="numpy")
def arc_pose(curvature: float, length: float) -> tuple[float, float, float]:
    """Pose (x, y, yaw) after the distance `length` [m] along an arc from the origin; negative is backwards."""
    turn = curvature * length
    if abs(curvature) < _STRAIGHT:
        return length, 0.0, turn
    return math.sin(turn) / curvature, 2.0 * math.sin(0.5 * turn) ** 2 / curvature, turn


@njit(cache=True, error_model="numpy")
def swept_ranges(
    curvatures: Floats,
    length: float,
    steps: int,
    outline: Floats,
    front: float,
    lidar: tuple[float, float, float],
    increment: float,
    num_beams: int,
) -> tuple[Ranges, Bools]:
    """Range that each beam needs to see past each tube, (N, B) [m], and whether a tube is partly out of view, (N,).

    A tube is the area that the outline newly sweeps while the base drives `length` [m] along an arc: beyond `front`
    [m] on the outside of the turn, beyond the axle (x = 0) on the inside. outline (V, 2): convex, anticlockwise,
    around the lidar. lidar: (x, y) and the bearing of the first beam, in the base frame. The range is 0 if the
    beam does not meet the tube.
    """
    needed = np.zeros((len(curvatures), num_beams))
    hidden = np.zeros(len(curvatures), np.bool_)
    directions = np.empty((num_beams, 2))
    # Unit vectors of the beams in the base frame.
    for i in range(num_beams):
        angle = lidar[2] + i * increment
        directions[i, 0], directions[i, 1] = math.cos(angle), math.sin(angle)
    corners, beams = np.empty_like(outline), np.empty(len(outline))
    for n in range(len(curvatures)):
        for k in range(1, steps + 1):
            # Move the outline along the arc, and raise the ranges of the beams that meet its edges.
            pose = arc_pose(curvatures[n], length * k / steps)
            _place(outline, pose, lidar, increment, corners, beams)
            rule = (np.sign(curvatures[n]), front, lidar[0], lidar[1])
            hidden[n] |= _out_of_view(corners, beams, rule, increment, num_beams)
            for i in range(len(corners)):
                j = i + 1 if i + 1 < len(corners) else 0
                _raise(corners[i], corners[j], beams[i], rule, increment, directions, needed[n])
    return needed.astype(np.float32), hidden


@njit(cache=True, error_model="numpy")
def _place(outline, pose, lidar, increment, corners, beams):
    """Write the outline's corners at `pose` relative to the lidar, and their bearings in beams from the first one."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for i in range(len(outline)):
        x = pose[0] + cos * outline[i, 0] - sin * outline[i, 1] - lidar[0]
        y = pose[1] + sin * outline[i, 0] + cos * outline[i, 1] - lidar[1]
        corners[i, 0], corners[i, 1] = x, y
        beams[i] = ((math.atan2(y, x) - lidar[2]) % _TWO_PI) / increment


@njit(cache=True, error_model="numpy")
def _counts(x, y, rule):
    """Return whether a point, relative to the lidar, is in the newly swept area."""
    side, front, lidar_x, lidar_y = rule
    ahead, across = x + lidar_x, side * (y + lidar_y)
    return ahead >= front or (ahead >= 0.0 and across > 0.0)


@njit(cache=True, error_model="numpy")
def _out_of_view(corners, beams, rule, increment, num_beams):
    """Return whether a corner in the newly swept area is more than half a beam outside the field of view."""
    last_beam = _TWO_PI / increment - 0.5
    for i in range(len(corners)):
        outside = num_beams - 0.5 < beams[i] < last_beam
        if outside and _counts(corners[i, 0], corners[i, 1], rule):
            return True
    return False


@njit(cache=True, error_model="numpy")
def _raise(a, b, beam, rule, increment, directions, need):
    """Raise the ranges of the beams that meet the edge from a to b; `beam`: bearing of a in beams."""
    # Beams between the bearings of a and b; the shifts by a full turn cover both sides of the seam.
    cross, dot = a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]
    span = math.atan2(cross, dot) / increment
    low, high = min(beam, beam + span), max(beam, beam + span)
    turn = _TWO_PI / increment
    for shift in (-turn, 0.0, turn):
        first_beam, last_beam = max(math.ceil(low + shift), 0), min(math.floor(high + shift), len(need) - 1)
        for i in range(first_beam, last_beam + 1):
            c, s = directions[i, 0], directions[i, 1]
            # Distance along the beam d to the line through a and b: (a × b) / (d × (b − a)).
            distance = cross / (c * (b[1] - a[1]) - s * (b[0] - a[0]))
            if distance > need[i] and _counts(distance * c, distance * s, rule):
                need[i] = distance


@njit(cache=True, error_model="numpy")
def free_ranges(ranges: Ranges, range_min: float, range_max: float) -> Ranges:
    """Free range of each beam: (B,) [m], inf without a hit (see `lme.perception.scan_points`)."""
    low, high = np.float32(range_min), np.float32(range_max)
    free = np.empty(len(ranges), np.float32)
    for i in range(len(ranges)):
        free[i] = ranges[i] if low <= ranges[i] < high else np.float32(np.inf)
    return free


@njit(cache=True, error_model="numpy")
def free_tubes(ranges: Ranges, needs: Ranges, farthest: Ranges, hidden: Bools) -> Bools:
    """Return whether each tube is free: it is in view, and every beam sees past it: (N,).

    ranges (B,) from `free_ranges`; needs (B, N), beam by beam, and hidden (N,) from `swept_ranges`; farthest (B,): the
    greatest of the needs of each beam.
    """
    blocked = hidden.copy()
    # A beam blocks the tubes inside which it ends. Most beams see past all tubes, and need no look at each.
    for i in range(len(ranges)):
        if ranges[i] < farthest[i]:
            reach, needs_of_beam = ranges[i], needs[i]
            for n in range(len(blocked)):
                blocked[n] |= reach < needs_of_beam[n]
    return ~blocked


@njit(cache=True, error_model="numpy")
def whisker_free(beam_ranges: Ranges, beams: Ints, ranges: Ranges) -> bool:
    """Return whether every sample of a whisker is in view and free: beams (S,), −1 out of view; ranges (S,)."""
    for k in range(len(beams)):  # noqa: SIM110
        if beams[k] < 0 or beam_ranges[beams[k]] < ranges[k]:
            return False
    return True


@njit(cache=True, error_model="numpy")
def choose(
    free: Bools,
    curvatures: Floats,
    reach: float,
    goal: tuple[float, float, float],
    bins: tuple[float, float, int],
    twist: tuple[float, float],
    ranges: Ranges,
    whisker_beams: Ints,
    whisker_ranges: Ranges,
) -> tuple[int, int]:
    """Choose the best free tube; return it and the bin of its distance to the goal, (−1, −1) if none is suitable.

    Sort keys in order: distance from goal (x, y) to the pose after `reach` [m], in bins; outer, front and inner
    whisker free; deviation from the goal's heading, in bins; change of the turn rate at the current v; distance.
    A tube more than bins[2] bins away, or more than 90° from the goal's heading, is not suitable. bins: (width of a
    distance bin [m], width of a heading bin [rad], greatest bin). whisker_beams, whisker_ranges (3, N, S): outer,
    front, inner.
    """
    best, best_bin = -1, bins[2] + 1
    key, best_key = np.empty(6), np.empty(6)
    for n in range(len(free)):
        if not free[n]:
            continue
        # Compare the end of the tube with the goal, in position and in heading.
        x, y, yaw = arc_pose(curvatures[n], reach)
        distance = math.hypot(goal[0] - x, goal[1] - y)
        deviation = abs(yaw - goal[2])
        deviation = min(deviation, _TWO_PI - deviation)
        distance_bin = math.floor(distance / bins[0])
        if distance_bin > best_bin or distance_bin > bins[2] or deviation > 0.5 * math.pi:
            continue
        # Keys that order the tubes within the same distance bin.
        for k in range(3):
            key[k] = 0.0 if whisker_free(ranges, whisker_beams[k, n], whisker_ranges[k, n]) else 1.0
        key[3] = math.floor(deviation / bins[1])
        key[4] = abs(twist[0] * curvatures[n] - twist[1]) if twist[0] > 0.0 else 0.0
        key[5] = distance
        if distance_bin < best_bin or _is_less(key, best_key):
            best, best_bin = n, distance_bin
            best_key[:] = key
    return best, best_bin if best >= 0 else -1


@njit(cache=True, error_model="numpy")
def _is_less(a, b):
    """Return whether a comes before b in lexicographic order."""
    for k in range(len(a)):
        if a[k] != b[k]:
            return a[k] < b[k]
    return False


@njit(cache=True, error_model="numpy")
def points_along(path: Floats, distances: Floats, window: float) -> tuple[Floats, float]:
    """Points (D, 2) at distances [m] along a polyline (K, 2) from where it is nearest to the origin, and its rest.

    The nearest point is searched for in the first `window` [m]. A distance past the end gives the end point.
    """
    # Begin at the point of the path that is nearest to the origin.
    start, part = _nearest(path, window)
    x = path[start, 0] + part * (path[min(start + 1, len(path) - 1), 0] - path[start, 0])
    y = path[start, 1] + part * (path[min(start + 1, len(path) - 1), 1] - path[start, 1])
    points = np.empty((len(distances), 2))
    count, length = 0, 0.0
    for i in range(start + 1, len(path)):
        # Interpolate all the distances that end on this segment.
        step = math.hypot(path[i, 0] - x, path[i, 1] - y)
        while count < len(distances) and distances[count] <= length + step:
            blend = (distances[count] - length) / step if step > 0.0 else 0.0
            points[count, 0], points[count, 1] = x + blend * (path[i, 0] - x), y + blend * (path[i, 1] - y)
            count += 1
        length += step
        x, y = path[i, 0], path[i, 1]
    # Distances past the end give the end point.
    points[count:, 0], points[count:, 1] = x, y
    return points, length


@njit(cache=True, error_model="numpy")
def _nearest(path, window):
    """Index of the segment nearest to the origin, and the nearest point as a share of its length."""
    best, nearest, at_part, length = np.inf, 0, 0.0, 0.0
    for i in range(len(path) - 1):
        dx, dy = path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1]
        square = dx * dx + dy * dy
        # Project the origin onto the segment: t = −p · d / |d|², limited to [0, 1].
        part = -(path[i, 0] * dx + path[i, 1] * dy) / square if square > 0.0 else 0.0
        part = min(max(part, 0.0), 1.0)
        distance = math.hypot(path[i, 0] + part * dx, path[i, 1] + part * dy)
        if distance < best:
            best, nearest, at_part = distance, i, part
        length += math.sqrt(square)
        if length > window:
            break
    return nearest, at_part


@njit(cache=True, error_model="numpy")
def known_free(
    points: Floats,
    bodies: Floats,
    lidars: Floats,
    ranges: Ranges,
    increment: float,
    box: tuple[float, float, float],
) -> Bools:
    """Return whether the robot has stood on or seen past each of the points (P, 2): (P,).

    bodies, lidars (M, 3): poses of the base and of the lidar, with the yaw of its first beam, at the scans, in the
    frame of the points; ranges (M, B): the scans from `free_ranges`; box (half_length, half_width, rounding) [m].
    """
    turn = _TWO_PI / increment
    is_free = np.zeros(len(points), np.bool_)
    for p in range(len(points)):
        for m in range(len(bodies)):
            # Under the footprint: inside the rounded box at the pose of this scan.
            dx, dy = points[p, 0] - bodies[m, 0], points[p, 1] - bodies[m, 1]
            cos, sin = math.cos(bodies[m, 2]), math.sin(bodies[m, 2])
            beside_x = max(abs(cos * dx + sin * dy) - box[0], 0.0)
            beside_y = max(abs(cos * dy - sin * dx) - box[1], 0.0)
            if beside_x * beside_x + beside_y * beside_y <= box[2] * box[2]:
                is_free[p] = True
                break
            # Seen past: the beam towards the point is longer than the distance to it.
            dx, dy = points[p, 0] - lidars[m, 0], points[p, 1] - lidars[m, 1]
            bearing = ((math.atan2(dy, dx) - lidars[m, 2]) % _TWO_PI) / increment
            beam = 0 if bearing >= turn - 0.5 else round(bearing)
            if beam < ranges.shape[1] and ranges[m, beam] > math.hypot(dx, dy):
                is_free[p] = True
                break
    return is_free


@njit(cache=True, error_model="numpy")
def out_of_sight(
    points: Floats,
    pose: tuple[float, float, float],
    lidar: tuple[float, float, float],
    increment: float,
    num_beams: int,
    reach: float,
) -> Floats:
    """Select the points within `reach` [m] of the base and out of the field of view, in the base frame: (K, 2).

    points (P, 2); pose: of the base in the frame of the points; lidar as in `swept_ranges`.
    """
    cos, sin, turn = math.cos(pose[2]), math.sin(pose[2]), _TWO_PI / increment
    hidden = np.empty_like(points)
    count = 0
    for p in range(len(points)):
        dx, dy = points[p, 0] - pose[0], points[p, 1] - pose[1]
        if dx * dx + dy * dy >= reach * reach:
            continue
        # Point in the base frame, and its bearing about the lidar in beams from the first one.
        x, y = cos * dx + sin * dy, cos * dy - sin * dx
        bearing = ((math.atan2(y - lidar[1], x - lidar[0]) - lidar[2]) % _TWO_PI) / increment
        # Bearings between the last beam and the first are out of view.
        if num_beams - 0.5 < bearing < turn - 0.5:
            hidden[count, 0], hidden[count, 1] = x, y
            count += 1
    return hidden[:count]
