"""Exact time until a footprint at constant velocity touches a scan point.

A robot at constant (v, ω) drives a circle about its centre of rotation (0, R), R = v/ω. In the robot frame, each
point moves on a circle about that centre in the opposite direction. Contact is where this circle enters the
footprint. A right turn is mirrored to a left turn, so R ≥ 0 and every point moves clockwise. The angle of a point
about the centre is ψ = atan2(x, R − y); it decreases during the motion.
"""

import math

import numpy as np
from numba import njit

from lme.types import Floats

STRAIGHT = 1e-6  # [1/m] smaller curvatures are straight: an error of 0.05 mm after 10 m
EDGE = 1e-9  # [m] overlap of edges at their corners, so that no point passes between them
_RINGS = 128  # around the origin, into which points are sorted
SLACK = 0.9  # share of its distance that a point inside the margin must keep; 1 would forbid all motion


@njit(cache=True, error_model="numpy")
def clearances(points: Floats, box: tuple[float, float, float]) -> Floats:
    """Distance of each of the (M, 2) points from the footprint [m], negative inside: (M,)."""
    distances = np.empty(len(points))
    for i in range(len(points)):
        dx, dy = max(abs(points[i, 0]) - box[0], 0.0), max(abs(points[i, 1]) - box[1], 0.0)
        distances[i] = math.sqrt(dx * dx + dy * dy) - box[2]
    return distances


@njit(cache=True, error_model="numpy")
def first_contacts(
    twists: Floats,
    points: Floats,
    box: tuple[float, float, float],
    margins: Floats,
    min_distances: Floats,
    horizons: Floats,
    slack: float = SLACK,
) -> Floats:
    """Time until the footprint touches a point at constant twist, for each twist: (N,) [s], inf if never.

    twists (N, 2) [m/s, rad/s], v ≥ 0; points (M, 2) in the robot frame [m]; box (half_length, half_width,
    rounding) [m]; margins (N,) [m]: growth of the footprint for each twist, limited to `slack` of a point's current
    distance. min_distances (N,) [s]: any contact before it may be returned, not only the first. horizons (N,) [s]:
    later contacts are ignored. A standing robot touches nothing; for a moving one, a point inside the footprint
    gives 0. Points are sorted by distance, coarsely, so that a contact ends the search early.
    """
    # The points and their order serve all twists.
    near = within_reach(twists, points, box, margins, horizons, slack)
    times = np.empty(len(twists))
    for i in range(len(twists)):
        times[i] = first_contact(
            twists[i, 0], twists[i, 1], near, box, margins[i], min_distances[i], horizons[i]
        )
    return times


@njit(cache=True, error_model="numpy")
def within_reach(
    twists: Floats,
    points: Floats,
    box: tuple[float, float, float],
    margins: Floats,
    horizons: Floats,
    slack: float,
) -> tuple[Floats, Floats, Floats]:
    """Return the points that any of the twists can reach, nearest first, as `first_contact` takes them.

    Returns the points (M, 2), lower bounds of their distances in ascending order (M,), and the distance that each
    point must keep (M,) [m].
    """
    # No point farther than the longest drive plus the grown footprint's radius can be met.
    r_max = math.hypot(box[0], box[1]) + box[2] + margins.max()
    near, ranges = _nearest_first(points, _reach(twists, horizons) + r_max)
    return near, ranges, slack * clearances(near, box)


@njit(cache=True, error_model="numpy")
def first_contact(
    v: float,
    omega: float,
    near: tuple[Floats, Floats, Floats],
    box: tuple[float, float, float],
    margin: float,
    min_distance: float,
    horizon: float,
) -> float:
    """Return the result of `first_contacts` for one twist. near: the points of `within_reach`."""
    points, ranges, keep_distances = near
    if v == 0.0 and omega == 0.0:
        return np.inf
    # Straight ahead: the distance until contact, divided by v.
    if abs(omega) < STRAIGHT * v:
        distance: float = _straight(
            points, ranges, keep_distances, box, margin, (v * min_distance, v * horizon)
        )
        return distance / v
    # On an arc: the angle about the centre of rotation until contact, divided by |ω|.
    turns = abs(omega) * min_distance, abs(omega) * horizon
    turn: float = _turn(points, ranges, keep_distances, box, margin, v / omega, turns)
    return turn / abs(omega)


@njit(cache=True, error_model="numpy")
def _reach(twists, horizons):
    """Greatest distance that the base drives [m]."""
    reach = 0.0
    for i in range(len(twists)):
        reach = max(reach, twists[i, 0] * horizons[i])
    return reach


@njit(cache=True, error_model="numpy")
def _nearest_first(points, reach):
    """Points within reach of the origin, sorted into rings (M, 2), and the inner radius of each one's ring (M,)."""
    scale = _RINGS / max(reach, EDGE)
    ring_of, start = np.empty(len(points), np.int64), np.zeros(_RINGS + 2, np.int64)
    # Ring of each point by its distance; −1 for points out of reach.
    for i in range(len(points)):
        distance = math.sqrt(points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1])
        ring_of[i] = min(int(distance * scale), _RINGS) if distance <= reach else -1
    for i in range(len(points)):
        if ring_of[i] >= 0:
            start[ring_of[i] + 1] += 1
    # Counting sort: start[ring] becomes the index of the ring's first point.
    for ring in range(_RINGS + 1):
        start[ring + 1] += start[ring]
    rings, ranges = np.empty((start[_RINGS + 1], 2)), np.empty(start[_RINGS + 1])
    for i in range(len(points)):
        ring = ring_of[i]
        if ring >= 0:
            k = start[ring]
            start[ring] = k + 1
            rings[k, 0], rings[k, 1], ranges[k] = points[i, 0], points[i, 1], (ring - EDGE) / scale
    return rings, ranges


@njit(cache=True, error_model="numpy")
def _rounding(keep_distance, rounding, margin):
    """Rounding of the footprint grown by the margin, limited by the distance that the point must keep [m]."""
    return rounding + min(margin, keep_distance)


@njit(cache=True, error_model="numpy")
def _straight(points, ranges, keep_distances, box, margin, limits):
    """Distance straight ahead until contact [m], inf if there is none.

    limits (sufficient, limit) [m]: the first contact below `sufficient` is returned, be it the first of the motion or
    not; contacts beyond `limit` are ignored.
    """
    sufficient, limit = limits
    half_length, half_width, rounding = box
    r_max = math.hypot(half_length, half_width) + rounding + margin
    best, contact = limit, np.inf
    for i in range(len(points)):
        # All points from here on are too far away to be met before the best contact.
        if ranges[i] > best + r_max:
            break
        if keep_distances[i] <= 0.0:
            return 0.0
        r = _rounding(keep_distances[i], rounding, margin)
        lateral = abs(points[i, 1]) - half_width
        if points[i, 0] <= 0.0 or lateral > r:
            continue
        # Front of the footprint at this lateral offset: on the straight edge or on the rounded corner.
        front = half_length + (r if lateral <= 0.0 else math.sqrt(r * r - lateral * lateral))
        distance = points[i, 0] - front
        if 0.0 <= distance <= best:  # less than 0: beside the footprint, so the robot moves away from it
            best, contact = distance, distance
            if distance < sufficient:
                break
    return contact


@njit(cache=True, error_model="numpy")
def _turn(points, ranges, keep_distances, box, margin, radius, limits):
    """Angle about the centre until contact [rad], inf if there is none within a full circle.

    limits: as in `_straight`, but angles [rad].
    """
    sufficient, limit = limits
    half_length, half_width, rounding = box
    grown = rounding + margin
    front = half_length + grown
    r_max = math.hypot(half_length, half_width) + grown
    # Mirror a right turn to a left one; `low` and `high` bound the annulus that the footprint sweeps.
    side, R = math.copysign(1.0, radius), abs(radius)
    low, high = _annulus(R, half_length, half_width, grown)
    best, contact = min(limit, 2.0 * math.pi), np.inf
    cos, sin = _rotation(best)
    leaving = R > half_width + grown and best <= math.pi
    # From near to far: every contact found shortens the rest of the search.
    for i in range(len(points)):
        if ranges[i] > min(best, 2.0) * R + r_max:  # the chord is at most 2R
            break
        if keep_distances[i] <= 0.0:
            return 0.0
        x, y = points[i, 0], side * points[i, 1]
        square = x * x + y * y - 2.0 * R * y  # squared distance from the centre, minus R²
        if square < low or square > high:
            continue
        if x > front and x * cos - (R - y) * sin > front:  # still ahead after `best`: no contact
            continue
        if x < 0.0 and leaving and (y > 0.0 or x < -front):  # already behind
            continue
        r = _rounding(keep_distances[i], rounding, margin)
        angle = _entry(x, y, square, R, half_length, half_width, r)
        if angle <= best:
            best, contact = angle, angle
            if angle < sufficient:
                break
            cos, sin = _rotation(best)
    return contact


@njit(cache=True, error_model="numpy")
def _rotation(angle):
    """Cosine and sine of the angle; beyond half a turn (−inf, 0), which disables the test for points still ahead."""
    if angle > math.pi:
        return -np.inf, 0.0
    return math.cos(angle), math.sin(angle)


@njit(cache=True, error_model="numpy")
def _annulus(R, half_length, half_width, r):
    """Least and greatest squared distance of the footprint from the centre of rotation, minus R²."""
    inner = half_width + r
    low = inner * inner - 2.0 * R * inner if R > inner else -R * R
    high = half_length**2 + half_width**2 + 2.0 * R * half_width + r * r
    high += 2.0 * r * math.hypot(half_length, R + half_width)
    return low - EDGE, high + EDGE


@njit(cache=True, error_model="numpy")
def _entry(x, y, square, R, half_length, half_width, r):
    """Angle until a point outside the footprint enters it through an edge or a rounded corner.

    The footprint is the union of two rectangles and four discs; contact is the first entry into one of them.
    """
    psi = math.atan2(x, R - y)
    first = np.inf
    # Edges of the two rectangles; a disc has none.
    if half_length > 0.0 or half_width > 0.0:
        first = _edge_entry(x, y, psi, square, R, half_length, half_width, r)
    # Discs at the left corners, then at the right corners.
    if r > 0.0:
        rho = math.sqrt(max(square + R * R, 0.0))
        first = min(first, _corner_entry(x, y, psi, rho, R, half_length, half_width, r))
        if half_width > 0.0:
            first = min(first, _corner_entry(x, y, psi, rho, R, half_length, -half_width, r))
    return first


@njit(cache=True, error_model="numpy")
def _edge_entry(x, y, psi, square, R, half_length, half_width, r):
    """Angle until the point crosses an edge inwards.

    On the point's circle, (x, R − y) has the squared length R² + square. Moving clockwise, it enters the front
    below the centre, the rear above it, the left side at x > 0 and the right side at x < 0.
    """
    first = np.inf
    # Front and rear: the circle meets x = ±front at R − y = ±√(R² + square − front²).
    front = half_length + r
    y_square = R * R + square - front * front  # (R − y)² where the circle meets x = ±front
    if y_square >= 0.0:
        root = math.sqrt(y_square)
        # R − root, without cancellation.
        y_front = (front * front - square) / (R + root) if R > 0.0 else -root
        if abs(y_front) <= half_width + EDGE:
            first = min(first, _wrap_positive(psi - math.atan2(front, root)))
        if abs(R + root) <= half_width + EDGE:
            first = min(first, _wrap_positive(psi - math.atan2(-front, -root)))
    # Left and right side: the circle meets y = side at x² = R² + square − (R − side)².
    for side in (half_width + r, -half_width - r):
        x_square = x * x + y * y - side * side + 2.0 * R * (side - y)
        if 0.0 <= x_square <= (half_length + EDGE) ** 2:
            crossing = math.copysign(math.sqrt(x_square), side)
            first = min(first, _wrap_positive(psi - math.atan2(crossing, R - side)))
    return first


@njit(cache=True, error_model="numpy")
def _corner_entry(x, y, psi, rho, R, half_length, half_width, r):
    """Angle until the point enters a disc of radius r about one of the corners (±half_length, half_width).

    For the distances ρ of the point and D of the corner from the centre, the angle β between them at contact
    satisfies r² = (ρ − D)² + 4 ρ D sin²(β/2).
    """
    to_corner_y = R - half_width
    D = math.sqrt(half_length * half_length + to_corner_y * to_corner_y)
    # r² = (ρ − D)² + 4 ρ D sin²(β/2), with ρ − D = (ρ² − D²) / (ρ + D) to avoid cancellation.
    squares = x * x + y * y - half_length * half_length - half_width * half_width
    difference = (squares + 2.0 * R * (half_width - y)) / (rho + D)
    numerator, denominator = r * r - difference * difference, 4.0 * rho * D
    if numerator < 0.0 or numerator > denominator:  # the circle misses the disc or is inside it
        return np.inf
    beta, corner = 2.0 * math.asin(math.sqrt(numerator / denominator)), math.atan2(half_length, to_corner_y)
    return min(_wrap_positive(psi - corner - beta), _wrap_positive(psi + corner - beta))


@njit(cache=True, error_model="numpy")
def _wrap_positive(angle):
    """Wrap an angle to [0, 2π)."""
    if angle < 0.0:
        angle += 2.0 * math.pi
    if angle < 0.0:
        angle += 2.0 * math.pi
    return angle if angle < 2.0 * math.pi else angle - 2.0 * math.pi
