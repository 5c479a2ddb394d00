"""Free distances of a point robot among scan points grown to discs, and the ends of obstacles.

A robot of radius R among points is equivalent to a point among discs of radius R. A jump of the free distance
from one direction to the next is therefore an end of an obstacle, which a robot of that size can pass.
"""

import math

import numpy as np
from numba import njit

from lme.types import Floats, Ints


@njit(cache=True, error_model="numpy")
def first_on_way(points: Floats, radii: Floats, end: Floats) -> int:
    """Index of the disc that the segment from the origin to `end` (2,) meets first; −1 if it meets none.

    points (M, 2) and radii (M,) of the discs [m]. A segment at a distance of exactly the radius is free.
    """
    length = math.hypot(end[0], end[1])
    best, min_hit = -1, np.inf
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        # Foot of the disc's centre on the line, and by how much it is outside the segment.
        along = (x * end[0] + y * end[1]) / length if length > 0.0 else 0.0
        past_end = along - min(max(along, 0.0), length)
        across_square = max(x * x + y * y - along * along, 0.0)
        depth = radii[i] * radii[i] - across_square - past_end * past_end
        if depth > 0.0:
            # Place at which the line enters the disc.
            hit = along - math.sqrt(radii[i] * radii[i] - across_square)
            if hit < min_hit:
                best, min_hit = i, hit
    return best


def directions(number: int) -> Floats:
    """Unit vectors (K, 2) at bearings −π + (k + ½)·2π/K, symmetric about the x axis."""
    bearings = (np.arange(number) + 0.5) * (2.0 * math.pi / number) - math.pi
    return np.column_stack((np.cos(bearings), np.sin(bearings)))


@njit(cache=True, error_model="numpy")
def free_ways(points: Floats, radii: Floats, units: Floats) -> tuple[Floats, Ints]:
    """Free distance in each of the `directions`, (K,) [m], and the index of the disc that ends it, (K,).

    points (M, 2), radii (M,) [m], units (K, 2). A disc narrower than the angle between two directions counts in
    the nearest one; a disc that contains the origin is ignored. Without a disc: inf and −1.
    """
    num_directions = len(units)
    free_lengths, owners = np.full(num_directions, np.inf), np.full(num_directions, -1)
    per_radian = num_directions / (2.0 * math.pi)
    for i in range(len(points)):
        px, py, square = points[i, 0], points[i, 1], radii[i] * radii[i]
        distance = math.sqrt(px * px + py * py)
        if not radii[i] < distance:
            continue
        # Directions within asin(radius / distance) of the disc's centre, at least the nearest one.
        bearing, half = math.atan2(py, px) + math.pi, math.asin(radii[i] / distance)
        middle = math.floor(bearing * per_radian)
        first_direction = min(math.ceil((bearing - half) * per_radian - 0.5), middle)
        last_direction = max(math.floor((bearing + half) * per_radian - 0.5), middle)
        for unwrapped in range(first_direction, last_direction + 1):
            k = unwrapped % num_directions
            # Distance at which the direction enters the disc.
            across = px * units[k, 1] - py * units[k, 0]
            along = px * units[k, 0] + py * units[k, 1]
            length = along - math.sqrt(max(square - across * across, 0.0))
            if length < free_lengths[k]:
                free_lengths[k], owners[k] = length, i
    return free_lengths, owners


@njit(cache=True, error_model="numpy")
def breaks_before(points: Floats, gap: float, slope: float) -> Ints:
    """Number of breaks of the scan before each point, and of all breaks, including last to first: (M + 1,).

    points (M, 2) in the order of the beams. A break is a gap between neighbours of more than `gap` [m] plus `slope`
    times the distance of the nearer one.
    """
    num_points = len(points)
    breaks = np.zeros(num_points + 1, np.int64)
    for i in range(num_points):
        x, y = points[i, 0], points[i, 1]
        u, v = points[(i + 1) % num_points, 0], points[(i + 1) % num_points, 1]
        # The gap that belongs to one surface grows with the distance.
        near_range = math.sqrt(min(x * x + y * y, u * u + v * v))
        breaks[i + 1] = breaks[i] + (math.hypot(u - x, v - y) > gap + slope * near_range)
    return breaks


@njit(cache=True, error_model="numpy")
def sweep(
    free_lengths: Floats,
    owners: Ints,
    breaks: Ints,
    slope: float,
    units: Floats,
    start: int,
    step: int,
    target: Floats,
) -> tuple[int, bool, float]:
    """Turn from direction `start` by `step` (±1) to the end of the obstacle seen there.

    The end is a break at which the free distance grows, or drops because a nearer obstacle hides the rest, by more
    than `slope` times the shorter distance.
    Returns the last direction before the end, −1 if there is no end; whether the free distance grows there; and
    the least distance of the visible boundary to `target` (2,) [m].
    """
    num_directions = len(free_lengths)
    min_distance = np.inf
    k = start
    for _ in range(num_directions):
        # Boundary in this direction, relative to the target.
        x, y = free_lengths[k] * units[k, 0] - target[0], free_lengths[k] * units[k, 1] - target[1]
        min_distance = min(min_distance, math.hypot(x, y))
        next_k = (k + step) % num_directions
        # A break is an end if the free distance changes by more than on a grazing wall.
        if _broken(owners[k], owners[next_k], breaks, step):
            if _longer(free_lengths[k], free_lengths[next_k], slope):
                return k, True, min_distance
            if _longer(free_lengths[next_k], free_lengths[k], slope):
                return k, False, min_distance
        k = next_k
    return -1, False, min_distance


@njit(cache=True, error_model="numpy")
def all_ends(free_lengths: Floats, owners: Ints, breaks: Ints, slope: float) -> Ints:
    """Directions at which an obstacle ends, as in `sweep`, and the steps (±1) to the end: (E, 2)."""
    num_directions = len(free_lengths)
    ends = np.empty((2 * num_directions, 2), np.int64)
    count = 0
    for k in range(num_directions):
        for step in (-1, 1):
            next_k = (k + step) % num_directions
            # An end, seen from the nearer side: the free distance grows at a break.
            is_longer = _longer(free_lengths[k], free_lengths[next_k], slope)
            if is_longer and _broken(owners[k], owners[next_k], breaks, step):
                ends[count, 0], ends[count, 1] = k, step
                count += 1
    return ends[:count]


@njit(cache=True, error_model="numpy")
def _longer(near, far, slope):
    """Return whether `far` exceeds `near` by more than on a wall seen at a grazing angle."""
    return far - near > slope * near


@njit(cache=True, error_model="numpy")
def _broken(i, j, breaks, step):
    """Return whether there is a break between points i and j, turning from i by `step`; −1 means no point.

    Neighbours may swap places as seen from the base, so the direction with fewer points between i and j counts.
    """
    if i < 0 or j < 0:
        return i != j
    first, last = (i, j) if step > 0 else (j, i)
    num_points = len(breaks) - 1
    if (last - first) % num_points > num_points // 2:
        first, last = last, first
    # Breaks between the two, across the last point if need be.
    wrap_breaks = breaks[-1] if last < first else 0
    return breaks[last] - breaks[first] + wrap_breaks > 0


@njit(cache=True, error_model="numpy")
def joined(i: int, j: int, breaks: Ints) -> bool:
    """Return whether points i and j have no break between them in at least one direction; −1 means no point."""
    return not (_broken(i, j, breaks, 1) and _broken(i, j, breaks, -1))


@njit(cache=True, error_model="numpy")
def first_longer(free_lengths: Floats, start: int, step: int, length: float) -> int:
    """First direction from `start` on, by `step`, with a free distance of at least `length` [m]; −1 if none."""
    num_directions = len(free_lengths)
    for offset in range(num_directions):
        k = (start + step * offset) % num_directions
        if free_lengths[k] >= length:
            return k
    return -1
