"""When a footprint that keeps its velocity first touches a scan point, met exactly.

A robot at constant (v, ω) drives a circle about its centre of rotation (0, R), R = v/ω. Seen from the robot the
points go round that centre the other way, each on a circle of its own, and touch where that circle enters the
footprint. A turn to the right is its mirror image to the left, so R ≥ 0 and every point moves clockwise. Angles
about the centre are measured from the foot of the robot's y axis: ψ = atan2(x, R − y), falling as it drives.
"""

import math

import numpy as np
from numba import njit

from lme.types import Floats

STRAIGHT = 1e-6  # [1/m] a curvature below this is none: 0.05 mm off the line after 10 m
EDGE = 1e-9  # [m] by which edges overlap at their corners, lest a point slip through between two
SLACK = (
    0.9  # part of its present distance that a point inside a margin may keep; all of it would be no motion
)


def contact_times(
    twists: Floats,
    points: Floats,
    box: tuple[float, float, float],
    margins: Floats,
    least: Floats,
    horizons: Floats,
) -> Floats:
    """Time until the footprint touches a point if each twist is kept for ever: (N,) [s], inf if never.

    twists (N, 2) [m/s, rad/s], v ≥ 0; points (M, 2) in the robot frame [m]; box (half_length, half_width,
    rounding) [m]; margins (N,) [m], by which the footprint grows for each twist, but for a point that lies within
    the margin already by SLACK of its distance only. least (N,) [s]: a contact before this settles the matter; it
    is returned, be it the first or not. horizons (N,) [s]: a contact after this is none. Standing still touches
    nothing. A point inside the footprint is touched at 0, unless the robot stands still.
    """
    half_length, half_width, rounding = box
    sizes = float(half_length), float(half_width), float(rounding)
    times: Floats = _contact_times(twists, points, sizes, margins, least, horizons)
    return times


@njit(cache=True, error_model="numpy")
def clearances(points: Floats, box: tuple[float, float, float]) -> Floats:
    """Distance of each of the (M, 2) points from the footprint [m], negative inside its rounding: (M,)."""
    out = np.empty(len(points))
    for i in range(len(points)):
        dx, dy = max(abs(points[i, 0]) - box[0], 0.0), max(abs(points[i, 1]) - box[1], 0.0)
        out[i] = math.sqrt(dx * dx + dy * dy) - box[2]
    return out


@njit(cache=True, error_model="numpy")
def _contact_times(twists, points, box, margins, least, horizons):
    """`contact_times` in plain numbers: points nearest first, so that one contact ends the search early."""
    r_max = math.hypot(box[0], box[1]) + box[2] + margins.max()
    near, ranges = _nearest_first(points, _reach(twists, horizons) + r_max)
    gaps = clearances(near, box)
    times = np.empty(len(twists))
    for i in range(len(twists)):
        v, omega = twists[i, 0], twists[i, 1]
        if v == 0.0 and omega == 0.0:
            times[i] = np.inf
        elif abs(omega) < STRAIGHT * v:
            ways = v * least[i], v * horizons[i]
            times[i] = _straight(near, ranges, gaps, box, margins[i], ways) / v
        else:
            turns = abs(omega) * least[i], abs(omega) * horizons[i]
            times[i] = _turn(near, ranges, gaps, box, margins[i], v / omega, turns) / abs(omega)
    return times


@njit(cache=True, error_model="numpy")
def _reach(twists, horizons):
    """How far the base gets at most [m]."""
    reach = 0.0
    for i in range(len(twists)):
        reach = max(reach, twists[i, 0] * horizons[i])
    return reach


@njit(cache=True, error_model="numpy")
def _nearest_first(points, reach):
    """Points within reach of the origin, nearest first (M, 2), and their distances (M,)."""
    ranges = np.empty(len(points))
    for i in range(len(points)):
        ranges[i] = math.sqrt(points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1])
    within = np.flatnonzero(ranges <= reach)
    order = within[np.argsort(ranges[within])]
    return points[order], ranges[order]


@njit(cache=True, error_model="numpy")
def _rounding(gap, rounding, margin):
    """Rounding of the footprint grown by the margin, or by as much of it as the point's distance allows."""
    return rounding + min(margin, SLACK * gap)


@njit(cache=True, error_model="numpy")
def _straight(points, ranges, gaps, box, margin, limits):
    """Way straight ahead until contact [m]; inf beyond the second of the limits, any one before the first."""
    enough, limit = limits
    half_length, half_width, rounding = box
    r_max = math.hypot(half_length, half_width) + rounding + margin
    best, found = limit, np.inf
    for i in range(len(points)):
        if ranges[i] > best + r_max:
            break
        if gaps[i] <= 0.0:
            return 0.0
        r = _rounding(gaps[i], rounding, margin)
        beside = abs(points[i, 1]) - half_width
        if points[i, 0] <= 0.0 or beside > r:
            continue
        front = half_length + (r if beside <= 0.0 else math.sqrt(r * r - beside * beside))
        way = points[i, 0] - front
        if 0.0 <= way <= best:  # less than 0: beside the footprint, and left behind
            best, found = way, way
            if way < enough:
                break
    return found


@njit(cache=True, error_model="numpy")
def _turn(points, ranges, gaps, box, margin, radius, limits):
    """Angle about the centre until contact [rad]; limits as for `_straight`, and a full circle at most."""
    enough, limit = limits
    half_length, half_width, rounding = box
    grown = rounding + margin
    front = half_length + grown
    r_max = math.hypot(half_length, half_width) + grown
    side, R = math.copysign(1.0, radius), abs(radius)
    low, high = _annulus(R, half_length, half_width, grown)
    best, found = min(limit, 2.0 * math.pi), np.inf
    cos, sin = _rotation(best)
    leaving = R > half_width + grown and best <= math.pi
    for i in range(len(points)):
        if ranges[i] > min(best, 2.0) * R + r_max:  # the chord is at most 2R
            break
        if gaps[i] <= 0.0:
            return 0.0
        x, y = points[i, 0], side * points[i, 1]
        square = x * x + y * y - 2.0 * R * y  # of the distance from the centre, less R²
        if square < low or square > high:
            continue
        if x > front and x * cos - (R - y) * sin > front:  # still ahead after the best: so all the while
            continue
        if x < 0.0 and leaving and (y > 0.0 or x < -front):  # passed already
            continue
        r = _rounding(gaps[i], rounding, margin)
        angle = _entry(x, y, square, R, half_length, half_width, r)
        if angle <= best:
            best, found = angle, angle
            if angle < enough:
                break
            cos, sin = _rotation(best)
    return found


@njit(cache=True, error_model="numpy")
def _rotation(angle):
    """Cosine and sine; beyond a half turn, of what turns everything behind: there a point may have passed by."""
    if angle > math.pi:
        return -np.inf, 0.0
    return math.cos(angle), math.sin(angle)


@njit(cache=True, error_model="numpy")
def _annulus(R, half_length, half_width, r):
    """Squared distances from the centre of rotation that the footprint sweeps, less R²: least and greatest."""
    inner = half_width + r
    low = inner * inner - 2.0 * R * inner if R > inner else -R * R
    high = half_length**2 + half_width**2 + 2.0 * R * half_width + r * r
    high += 2.0 * r * math.hypot(half_length, R + half_width)
    return low - EDGE, high + EDGE


@njit(cache=True, error_model="numpy")
def _entry(x, y, square, R, half_length, half_width, r):
    """Angle until a point outside the footprint enters it: through an edge, or a rounded corner.

    The footprint is the union of two rectangles and four discs; whichever is entered first is the contact.
    """
    psi = math.atan2(x, R - y)
    first = np.inf
    if half_length > 0.0 or half_width > 0.0:
        first = _edge_entry(x, y, psi, square, R, half_length, half_width, r)
    if r > 0.0:
        rho = math.sqrt(max(square + R * R, 0.0))
        first = min(first, _corner_entry(x, y, psi, rho, R, half_length, half_width, r))
        if half_width > 0.0:
            first = min(first, _corner_entry(x, y, psi, rho, R, half_length, -half_width, r))
    return first


@njit(cache=True, error_model="numpy")
def _edge_entry(x, y, psi, square, R, half_length, half_width, r):
    """Angle until the point crosses an edge inwards: ahead and behind it moves along x, to the sides along y.

    On the circle (x, R − y) has the squared length R² + square. Clockwise, it enters the front below the centre,
    the rear above it, the left side where x > 0 and the right side where x < 0.
    """
    first = np.inf
    front = half_length + r
    below = R * R + square - front * front  # (R − y)² where the circle meets x = ±front
    if below >= 0.0:
        root = math.sqrt(below)
        y_front = (
            (front * front - square) / (R + root) if R > 0.0 else -root
        )  # R − root, without cancellation
        if abs(y_front) <= half_width + EDGE:
            first = min(first, _ahead(psi - math.atan2(front, root)))
        if abs(R + root) <= half_width + EDGE:
            first = min(first, _ahead(psi - math.atan2(-front, -root)))
    for left in (half_width + r, -half_width - r):
        beside = x * x + y * y - left * left + 2.0 * R * (left - y)  # x² where the circle meets y = left
        if 0.0 <= beside <= (half_length + EDGE) ** 2:
            crossing = math.copysign(math.sqrt(beside), left)
            first = min(first, _ahead(psi - math.atan2(crossing, R - left)))
    return first


@njit(cache=True, error_model="numpy")
def _corner_entry(x, y, psi, rho, R, half_length, half_width, r):
    """Angle until the point enters a disc of radius r about one of the corners (±half_length, half_width).

    With ρ and D the distances of point and corner from the centre, the angle β between them at contact obeys
    r² = (ρ − D)² + 4 ρ D sin²(β/2).
    """
    below = R - half_width
    D = math.sqrt(half_length * half_length + below * below)
    squares = x * x + y * y - half_length * half_length - half_width * half_width
    difference = (squares + 2.0 * R * (half_width - y)) / (rho + D)
    rest, whole = r * r - difference * difference, 4.0 * rho * D
    if rest < 0.0 or rest > whole:  # it misses the disc, or never leaves it
        return np.inf
    beta, corner = 2.0 * math.asin(math.sqrt(rest / whole)), math.atan2(half_length, below)
    return min(_ahead(psi - corner - beta), _ahead(psi + corner - beta))


@njit(cache=True, error_model="numpy")
def _ahead(angle):
    """The angle in [0, 2π)."""
    if angle < 0.0:
        angle += 2.0 * math.pi
    if angle < 0.0:
        angle += 2.0 * math.pi
    return angle if angle < 2.0 * math.pi else angle - 2.0 * math.pi
