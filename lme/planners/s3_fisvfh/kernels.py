"""Polar histograms of scan points, their valleys, and a best-first search over headings (VFH*).

A ring of S equal sectors covers all directions; sector s spans [−π + s·w, −π + (s + 1)·w), w = 2π / S.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.types import Bools, Floats, Ints

_TINY = 1e-9  # [m], [rad]
_CHECK_EVERY = 0.02  # [m]
_MAX_NODES = 2048  # more than two steps need: at most 2π / (least width of a valley) children per node


class Valleys(NamedTuple):
    """Rules for headings from a histogram; all angles [rad], distances [m]."""

    window: float  # farther points are ignored
    block_distance: float  # a sector with a shorter mean range is blocked
    narrow: float  # least width of a valley
    wide: float  # up to this width, the heading is the valley's middle
    margin: float  # distance of the heading from the edges of a wider valley


class Costs(NamedTuple):
    """Costs of a step of the search in addition to its length."""

    step: float  # [m]
    deviation: float  # [m/rad] between the heading and the goal
    switch: float  # [m/rad] between the heading and the one before
    depth: int  # steps


@njit(cache=True, error_model="numpy")
def histogram(points: Floats, x: float, y: float, spacing: float, window: float, num_sectors: int) -> Floats:
    """Mean of (window − range) over each sector as seen from (x, y): (S,) [m], from 0 (free) to `window`.

    points (M, 2) [m]: hits of beams that are `spacing` [rad] apart as seen from the origin. A point represents the
    piece of surface up to half way to the neighbouring beams, so it covers the arc of this piece as seen from
    (x, y). Directions without a point within `window` [m] are free. From the origin, it is the mean over the beams.
    """
    density = np.zeros(num_sectors)
    width = 2.0 * math.pi / num_sectors
    for i in range(len(points)):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        distance = math.hypot(dx, dy)
        if distance >= window:
            continue
        # Half of the arc that the piece of surface covers as seen from (x, y), at most 90°.
        half = min(0.5 * spacing * math.hypot(points[i, 0], points[i, 1]) / max(distance, _TINY), math.pi / 2)
        middle = (math.atan2(dy, dx) + math.pi) / width
        low, high = middle - half / width, middle + half / width
        # Add to each sector in proportion to the part of it that is covered.
        for s in range(math.floor(low), math.ceil(high)):
            part = min(high, s + 1.0) - max(low, float(s))
            density[s % num_sectors] += part * (window - distance)
    # Pieces may overlap, so the mean is limited to `window`.
    for s in range(num_sectors):
        density[s] = min(density[s], window)
    return density


@njit(cache=True, error_model="numpy")
def valleys(blocked: Bools) -> Ints:
    """Runs of free sectors on the ring: (K, 2) [first, length]; one full run if no sector is blocked."""
    num_sectors = len(blocked)
    runs = np.empty((num_sectors, 2), np.int64)
    count, first = 0, 0
    # Find a blocked sector to begin with, so that no run is cut at the ends of the array.
    while first < num_sectors and not blocked[first]:
        first += 1
    if first == num_sectors:
        runs[0, 0], runs[0, 1] = 0, num_sectors
        return runs[:1]
    length = 0
    # Go once round the ring and close a run at each blocked sector.
    for k in range(1, num_sectors + 1):
        s = (first + k) % num_sectors
        if not blocked[s]:
            length += 1
        elif length > 0:
            runs[count, 0], runs[count, 1] = (s - length) % num_sectors, length
            count += 1
            length = 0
    return runs[:count]


@njit(cache=True, error_model="numpy")
def headings(blocked: Bools, goal: float, narrow: float, wide: float, margin: float) -> Floats:
    """One heading for each valley at least `narrow` wide: (K,) [rad] in [−π, π].

    In valleys up to `wide` it is the middle, else it is `goal`, limited to `margin` inside the edges [rad].
    """
    runs = valleys(blocked)
    width = 2.0 * math.pi / len(blocked)
    directions = np.empty(len(runs))
    count = 0
    for k in range(len(runs)):
        span = runs[k, 1] * width
        if runs[k, 1] == len(blocked):
            directions[count] = goal
        elif span < narrow - _TINY:
            continue
        else:
            # Middle of the valley, and how far the heading may turn from it towards the goal.
            middle = _wrapped(-math.pi + (runs[k, 0] + 0.5 * runs[k, 1]) * width)
            room = max(0.5 * span - margin, 0.0) if span > wide + _TINY else 0.0
            directions[count] = _wrapped(middle + min(max(_wrapped(goal - middle), -room), room))
            if abs(directions[count]) > math.pi - _TINY:  # straight behind: turn to the side of the goal
                directions[count] = math.copysign(directions[count], goal)
        count += 1
    return directions[:count]


@njit(cache=True, error_model="numpy")
def search(
    points: Floats,
    unseen: Bools,
    goal: Floats,
    previous: float,
    spacing: float,
    rules: Valleys,
    costs: Costs,
) -> tuple[float, bool]:
    """First heading [rad] of the cheapest sequence of steps, and whether there is any.

    points (M, 2) and goal (2,) in the robot frame [m]; unseen (S,): sectors out of view, which count as blocked;
    previous [rad]: the heading until now. Each node has a histogram of the points as seen from there. The rest of
    the path costs at least its length, so the first node taken off the queue at full depth, or at the goal, is the
    best. If there is none, the result is the cheapest of the deepest nodes.
    """
    nodes = np.empty((_MAX_NODES, 6))  # x, y, heading, first heading, cost so far, depth
    estimate = np.empty(_MAX_NODES)  # cost so far plus a lower bound of the rest; inf once expanded
    nodes[0, 0], nodes[0, 1], nodes[0, 2], nodes[0, 3], nodes[0, 4], nodes[0, 5] = 0, 0, previous, 0, 0, 0
    estimate[0] = 0.0
    count, best = 1, 0
    while True:
        # Take the open node with the least estimate (A*).
        cheapest = int(np.argmin(estimate[:count]))
        # No node is left.
        if estimate[cheapest] == np.inf:
            return nodes[best, 3], best > 0
        # The estimates are lower bounds, so this node is optimal.
        if nodes[cheapest, 5] >= costs.depth:
            return nodes[cheapest, 3], True
        if nodes[cheapest, 5] > nodes[best, 5]:  # costs rise, so the first node of a depth is its cheapest
            best = cheapest
        estimate[cheapest] = np.inf
        count = _expand(nodes, estimate, count, cheapest, points, unseen, goal, spacing, rules, costs)


@njit(cache=True, error_model="numpy")
def _expand(nodes, estimate, count, parent, points, is_hidden, goal, spacing, rules, costs):
    """Append the children of a node; return the new number of nodes."""
    x, y, previous_heading, cost, depth = (
        nodes[parent, 0],
        nodes[parent, 1],
        nodes[parent, 2],
        nodes[parent, 4],
        nodes[parent, 5],
    )
    to_goal = math.hypot(goal[0] - x, goal[1] - y)
    bearing = math.atan2(goal[1] - y, goal[0] - x)
    # Free headings as seen from this node; an obstacle beyond the goal does not block.
    density = histogram(points, x, y, spacing, rules.window, len(is_hidden))
    limit = rules.window - min(rules.block_distance, to_goal)
    blocked = is_hidden | (density > limit)
    ahead = headings(blocked, bearing, rules.narrow, rules.wide, rules.margin)
    for k in range(min(len(ahead), len(nodes) - count)):
        heading, arrived = ahead[k], to_goal <= costs.step
        # Extra cost for heading away from the goal and for turning.
        turn = costs.deviation * abs(_wrapped(heading - bearing)) + costs.switch * abs(
            _wrapped(heading - previous_heading)
        )
        first = heading if parent == 0 else nodes[parent, 3]
        # The child, and as a bound of the rest the length of the steps that are left.
        nodes[count, 0] = x + costs.step * math.cos(heading)
        nodes[count, 1] = y + costs.step * math.sin(heading)
        nodes[count, 2], nodes[count, 3], nodes[count, 4] = heading, first, cost + costs.step + turn
        nodes[count, 5] = costs.depth if arrived else depth + 1
        estimate[count] = nodes[count, 4] + costs.step * (costs.depth - nodes[count, 5])
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def _wrapped(angle):
    """Wrap an angle to [−π, π]; an odd function, so that mirrored angles stay mirrored."""
    while angle > math.pi:
        angle -= 2.0 * math.pi
    while angle < -math.pi:
        angle += 2.0 * math.pi
    return angle


@njit(cache=True, error_model="numpy")
def nearest_ahead(points: Floats, half_angle: float) -> tuple[float, float]:
    """Least distance from the origin to a point within `half_angle` [rad] of straight ahead: left, right [m].

    points (M, 2) in the robot frame [m]; a point straight ahead counts on both sides; inf without points.
    """
    left, right = np.inf, np.inf
    cosine = math.cos(half_angle)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        distance = math.hypot(x, y)
        # Outside the cone: cos(bearing) < cos(half_angle).
        if x < cosine * distance:
            continue
        if y >= 0.0:
            left = min(left, distance)
        if y <= 0.0:
            right = min(right, distance)
    return left, right


@njit(cache=True, error_model="numpy")
def least_clearance(
    points: Floats, box: tuple[float, float, float], v: float, omega: float, time: float
) -> tuple[float, float]:
    """Clearance [m] of a footprint to the points now, and the least clearance while it drives (v, ω) for `time` [s].

    points (M, 2) in the robot frame [m]; box (half_length, half_width, rounding) [m]. The clearance is at least
    −rounding. It is exact at sampled poses, between which no corner moves more than 2 cm.
    """
    # As many steps as keep the corners from moving more than `_CHECK_EVERY` in one.
    reach = math.hypot(box[0], box[1]) + box[2]
    steps = max(1, math.ceil((abs(v) + abs(omega) * reach) * time / _CHECK_EVERY))
    x, y, yaw, half_turn = 0.0, 0.0, 0.0, 0.5 * omega * time / steps
    initial = _clearance(points, box, x, y, yaw)
    min_clearance = initial
    for _ in range(steps):
        # Midpoint rule: half of the turn, the way, and the other half.
        yaw += half_turn
        x += v * time / steps * math.cos(yaw)
        y += v * time / steps * math.sin(yaw)
        yaw += half_turn
        min_clearance = min(min_clearance, _clearance(points, box, x, y, yaw))
    return initial, min_clearance


@njit(cache=True, error_model="numpy")
def _clearance(points, box, x, y, yaw):
    """Distance from the footprint at (x, y, yaw) to the nearest point [m]."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    min_square = np.inf
    for i in range(len(points)):
        dx, dy = points[i, 0] - x, points[i, 1] - y
        along = max(abs(cos * dx + sin * dy) - box[0], 0.0)
        across = max(abs(cos * dy - sin * dx) - box[1], 0.0)
        min_square = min(min_square, along * along + across * across)
    return math.sqrt(min_square) - box[2]
