"""Bands of eband_local_planner on a costmap: expansions, refinement, and forces.

A band is an array (N, 4) of bubbles, rows (x, y, yaw, expansion), in the frame of the grid [m, rad]. The expansion is
read from the cost of the one cell under the centre, which tells the distance to an obstacle only within the inflation
radius. A band that cannot be made is an empty array. Source: github.com/utexas-bwi/eband_local_planner 0.4.0,
src/eband_local_planner.cpp.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.motion import wrapped
from lme.grids.obstacle_grid import HIGHEST, INSCRIBED, Costs, Grid, lattice
from lme.types import Floats

_MOST_FILLED = 2048  # bubbles that close the gaps of a band
_DEEPEST = 128  # intervals that wait for refinement; each is halved
_APART = 1e6  # [m] distance of bubbles with the same centre, so that they do not pull


class Rules(NamedTuple):
    """Settings of the band, with the names of eband_local_planner, and the padded footprint's outer radius [m]."""

    costmap_weight: float
    min_relative_overlap: float
    tiny_bubble_distance: float
    tiny_bubble_expansion: float
    internal_force_gain: float
    external_force_gain: float
    num_iterations: int
    max_recursion_depth: int
    relative_overshoot: float
    significant_force: float
    circumscribed_radius: float


@njit(cache=True, error_model="numpy")
def expansion(costs: Costs, grid: Grid, x: float, y: float, weight: float) -> float:
    """Distance to an obstacle that the cost of the cell at (x, y) stands for [m]: −ln(cost / 252) / weight.

    It is 0 in a forbidden cell. A free cell, and all beyond the map, count as cost 1.
    """
    i, j = lattice(x / grid[2]) - grid[0], lattice(y / grid[2]) - grid[1]
    cost = 1
    if 0 <= i < costs.shape[0] and 0 <= j < costs.shape[1]:
        cost = max(int(costs[i, j]), 1)
    return 0.0 if cost >= INSCRIBED else max(-math.log(cost / HIGHEST) / weight, 0.0)


@njit(cache=True, error_model="numpy")
def overlaps(a: Floats, b: Floats, rules: Rules) -> bool:
    """Return whether two bubbles are nearer than `min_relative_overlap` of the sum of their expansions."""
    return bool(math.hypot(a[0] - b[0], a[1] - b[1]) < rules.min_relative_overlap * (a[3] + b[3]))


@njit(cache=True, error_model="numpy")
def expand(costs: Costs, grid: Grid, band: Floats, rules: Rules) -> bool:
    """Set the expansions of a band in place; return whether no bubble has none."""
    free = True
    for i in range(len(band)):
        band[i, 3] = expansion(costs, grid, band[i, 0], band[i, 1], rules.costmap_weight)
        free = free and band[i, 3] > 0.0
    return free


@njit(cache=True, error_model="numpy")
def refine(costs: Costs, grid: Grid, band: Floats, rules: Rules) -> Floats:
    """Drop redundant bubbles of a band (N, 4), N ≥ 2, and fill its gaps.

    Bubbles between two that overlap are redundant. An interval whose ends do not overlap is split at its middle bubble,
    and one without bubbles inside at a new one between its ends. The band is broken if a new bubble is too small.
    """
    # A linked list of bubbles: band, then new ones.
    bubbles = np.empty((len(band) + _MOST_FILLED, 4))
    bubbles[: len(band)] = band
    after, before = np.arange(1, len(bubbles) + 1), np.arange(-1, len(bubbles) - 1)
    count = len(band)
    # Intervals that wait: first and last bubble, and the middle one if both halves are done, else -1.
    stack = np.empty((_DEEPEST, 3), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], size = 0, len(band) - 1, -1, 1
    while size > 0:
        size -= 1
        first, last, middle = stack[size, 0], stack[size, 1], stack[size, 2]
        if middle >= 0:
            left, right = before[middle], after[middle]
            if overlaps(bubbles[left], bubbles[right], rules):
                after[left], before[right] = right, left
        elif overlaps(bubbles[first], bubbles[last], rules):
            after[first], before[last] = last, first
        elif last < len(band) and last - first > 1:
            middle = first + (last - first) // 2
            stack[size, 0], stack[size, 1], stack[size, 2] = first, last, middle
            stack[size + 1, 0], stack[size + 1, 1], stack[size + 1, 2] = middle, last, -1
            stack[size + 2, 0], stack[size + 2, 1], stack[size + 2, 2] = first, middle, -1
            size += 3
        else:
            count = _fill(costs, grid, bubbles, after, before, count, first, last, rules)
            if count < 0:
                return bubbles[:0]
    refined, kept, index = np.empty((count, 4)), 0, 0
    while True:
        refined[kept] = bubbles[index]
        kept += 1
        if index == len(band) - 1:
            return refined[:kept].copy()
        index = after[index]


@njit(cache=True, error_model="numpy")
def _fill(costs, grid, bubbles, after, before, count, first, last, rules):
    """Insert bubbles between two neighbours until all overlap; return the new number of bubbles, -1 if they cannot."""
    stack = np.empty((_DEEPEST, 2), np.int64)
    stack[0, 0], stack[0, 1], size = first, last, 1
    while size > 0:
        size -= 1
        a, b = stack[size, 0], stack[size, 1]
        x, y = 0.5 * (bubbles[a, 0] + bubbles[b, 0]), 0.5 * (bubbles[a, 1] + bubbles[b, 1])
        radius = expansion(costs, grid, x, y, rules.costmap_weight)
        if radius <= rules.tiny_bubble_expansion or count == len(bubbles) or size + 2 > _DEEPEST:
            return -1
        bubbles[count, 0], bubbles[count, 1] = x, y
        bubbles[count, 2] = wrapped(bubbles[a, 2] + 0.5 * wrapped(bubbles[b, 2] - bubbles[a, 2]))
        bubbles[count, 3] = radius
        after[a], before[count], after[count], before[b] = count, a, b, count
        if not overlaps(bubbles[a], bubbles[count], rules):
            stack[size, 0], stack[size, 1], size = a, count, size + 1
        if not overlaps(bubbles[count], bubbles[b], rules):
            stack[size, 0], stack[size, 1], size = count, b, size + 1
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def optimize(costs: Costs, grid: Grid, band: Floats, rules: Rules) -> Floats:
    """Return a band (N, 4), N ≥ 2, on the current map, after `num_iterations` rounds of forces; empty if broken."""
    band = band.copy()
    if not expand(costs, grid, band, rules):
        return band[:0]
    band = refine(costs, grid, band, rules)
    for _ in range(rules.num_iterations):
        if len(band) == 0:
            break
        # Move all bubbles but the ends, once forwards and once backwards.
        inner = len(band) - 2
        for k in range(2 * inner):
            _move(costs, grid, band, 1 + k if k < inner else 2 * inner - k, rules)
        band = refine(costs, grid, band, rules)
    return band


@njit(cache=True, error_model="numpy")
def _move(costs, grid, band, i, rules):
    """Move bubble i by its force, unless it becomes too small or loses its neighbours."""
    force = _force(costs, grid, band, i, band[i], rules)
    jump_x, jump_y = band[i, 3] * force[0], band[i, 3] * force[1]
    jump_yaw = wrapped(band[i, 3] / rules.circumscribed_radius * force[2])
    moved = _shifted(costs, grid, band[i], jump_x, jump_y, jump_yaw, rules)
    if moved[3] <= rules.tiny_bubble_expansion:
        return
    # A force that reverses and stays strong has passed the equilibrium.
    if _overshoots(_force(costs, grid, band, i, moved, rules), force, rules):
        moved = _equilibrium(costs, grid, band, i, moved, force, (jump_x, jump_y, jump_yaw), rules)
    pair = np.empty((2, 4))
    for k in (i - 1, i + 1):
        pair[0], pair[1] = band[k], moved
        if len(refine(costs, grid, pair, rules)) == 0:
            return
    band[i] = moved


@njit(cache=True, error_model="numpy")
def _equilibrium(costs, grid, band, i, moved, force, jump, rules):
    """Approach the equilibrium of bubble i by halved steps: back where the force reverses, else on; else `moved`."""
    here, share = band[i].copy(), 0.5
    for depth in range(rules.max_recursion_depth + 1):
        here = _shifted(costs, grid, here, share * jump[0], share * jump[1], share * jump[2], rules)
        if here[3] == 0.0:
            break
        moved = here
        if depth == rules.max_recursion_depth:
            break
        previous, force = force, _force(costs, grid, band, i, here, rules)
        if _dot(force, previous) >= 0.0:
            share *= 0.5
        elif _overshoots(force, previous, rules):
            share *= -0.5
        else:
            break
    return moved


@njit(cache=True, error_model="numpy")
def _force(costs, grid, band, i, bubble, rules):
    """Force (x, y) and torque on a bubble in the place of bubble i, without the part along the band."""
    previous, following = band[i - 1], band[i + 1]
    # Neighbours pull: the sum of their differences by their distances.
    to_previous, to_following = _difference(bubble, previous, rules), _difference(bubble, following, rules)
    near, far = math.hypot(to_previous[0], to_previous[1]), math.hypot(to_following[0], to_following[1])
    near = near if near > rules.tiny_bubble_distance else _APART
    far = far if far > rules.tiny_bubble_distance else _APART
    fx = rules.internal_force_gain * (to_previous[0] / near + to_following[0] / far)
    fy = rules.internal_force_gain * (to_previous[1] / near + to_following[1] / far)
    torque = rules.internal_force_gain * (to_previous[2] / near + to_following[2] / far)
    # Obstacles push: the gradient of the expansion, from one side of the bubble to the other.
    x, y, radius, weight = bubble[0], bubble[1], bubble[3], rules.costmap_weight
    slope = rules.external_force_gain / (2.0 * max(radius, rules.tiny_bubble_expansion))
    fx += slope * (
        expansion(costs, grid, x + radius, y, weight) - expansion(costs, grid, x - radius, y, weight)
    )
    fy += slope * (
        expansion(costs, grid, x, y + radius, weight) - expansion(costs, grid, x, y - radius, weight)
    )
    # Leave out the part along the line between the neighbours: F − (F · d) d / |d|².
    along = _difference(following, previous, rules)
    square = along[0] * along[0] + along[1] * along[1] + along[2] * along[2]
    part = _dot((fx, fy, torque), along) / square if square > 0.0 else 0.0
    return fx - part * along[0], fy - part * along[1], torque - part * along[2]


@njit(cache=True, error_model="numpy")
def _difference(a, b, rules):
    """Difference of the poses of two bubbles; that of the yaw is times the outer radius."""
    return b[0] - a[0], b[1] - a[1], wrapped(b[2] - a[2]) * rules.circumscribed_radius


@njit(cache=True, error_model="numpy")
def _overshoots(force, previous, rules):
    """Return whether a force reverses and stays strong. As in the source, the old one counts x twice and not y."""
    strength = math.sqrt(_dot(force, force))
    old = math.sqrt(2.0 * previous[0] * previous[0] + previous[2] * previous[2])
    reverses = _dot(force, previous) < 0.0
    return reverses and strength > rules.relative_overshoot * old and strength > rules.significant_force


@njit(cache=True, error_model="numpy")
def _shifted(costs, grid, bubble, dx, dy, dyaw, rules):
    """Return the bubble at a place further on."""
    moved = np.empty(4)
    moved[0], moved[1], moved[2] = bubble[0] + dx, bubble[1] + dy, wrapped(bubble[2] + dyaw)
    moved[3] = expansion(costs, grid, moved[0], moved[1], rules.costmap_weight)
    return moved


@njit(cache=True, error_model="numpy", inline="always")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
