"""The stages of VFH+ (Ulrich & Borenstein 1998): cells, density, turning limits, candidate directions.

Sector k is centred on the direction k·α, α = 2π / num_sectors, in the odometry frame, so that sectors do not
rotate with the robot.
"""

import math

import numpy as np
from numba import njit

from lme.grids.obstacle_grid import lattice
from lme.types import Bools, Floats


@njit(cache=True, error_model="numpy")
def active_cells(points: Floats, cell_size: float, reach: float) -> Floats:
    """Occupied cells of the circular active window, each at the mean of the returns in it: (C, 2) [m].

    points (M, 2), cell_size, reach: radius of the window [m]. A cell counts once, however many beams hit it. An
    obstacle's weight therefore depends neither on the lidar's resolution nor on the distance.
    """
    half = math.ceil(_farthest(points, reach) / cell_size)
    side = 2 * half + 1
    hits = np.zeros((side, side, 3))  # number of returns, sums of x and y
    # Count and add up the returns in each cell.
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        if x * x + y * y > reach * reach:
            continue
        hit = hits[lattice(x / cell_size) + half, lattice(y / cell_size) + half]
        hit[0] += 1.0
        hit[1] += x
        hit[2] += y
    cells, count = np.empty((min(side * side, len(points)), 2)), 0
    # List the mean of each cell that has a return.
    for row in range(side):
        for column in range(side):
            hit = hits[row, column]
            if hit[0] > 0.0:
                cells[count, 0], cells[count, 1] = hit[1] / hit[0], hit[2] / hit[0]
                count += 1
    return cells[:count]


@njit(cache=True, error_model="numpy")
def _farthest(points, reach):
    """Distance from the origin to the farthest point within `reach`, 0 without points [m]; it bounds the grid."""
    square = 0.0
    for i in range(len(points)):
        point_square = points[i, 0] * points[i, 0] + points[i, 1] * points[i, 1]
        if square < point_square <= reach * reach:
            square = point_square
    return math.sqrt(square)


@njit(cache=True, error_model="numpy")
def polar_density(
    cells: Floats, yaw: float, radius: float, reach: float, peak: float, num_sectors: int
) -> Floats:
    """Primary polar histogram (first stage): obstacle density of each sector, (num_sectors,).

    cells (C, 2) in the robot frame [m], yaw of the robot [rad]. A cell at distance d has the weight a − b·d², which
    is `peak` at the robot and 1 at the window's radius `reach` [m], in every sector within asin(radius / d) of its
    direction. `radius` [m] enlarges the obstacles: the robot's radius plus its safety distance.
    """
    density = np.zeros(num_sectors)
    alpha = 2.0 * math.pi / num_sectors
    for i in range(len(cells)):
        distance = math.sqrt(cells[i, 0] ** 2 + cells[i, 1] ** 2)
        weight = peak - (peak - 1.0) * (distance / reach) ** 2
        # Sectors whose centres are within asin(radius / d) of the cell's direction, or a quarter turn if d ≤ radius.
        middle = (math.atan2(cells[i, 1], cells[i, 0]) + yaw) / alpha
        half = math.asin(radius / distance) / alpha if distance > radius else 0.25 * num_sectors
        first_sector, last_sector = math.ceil(middle - half), math.floor(middle + half)
        if first_sector > last_sector:  # the cell is narrower than a sector and between two centres
            first_sector = last_sector = lattice(middle)
        for k in range(first_sector, last_sector + 1):
            density[k % num_sectors] += weight
    return density


@njit(cache=True, error_model="numpy")
def turning_limits(cells: Floats, turn_radius: float, radius: float) -> tuple[float, float]:
    """Directions (right ≤ 0, left ≥ 0) [rad] between which the robot can steer past every cell (third stage).

    cells (C, 2) in the robot frame [m]. A cell limits its side if the tightest arc to that side, with radius
    `turn_radius` [m], comes within `radius` [m] of it.
    """
    right, left = -math.pi, math.pi
    touch = (turn_radius + radius) ** 2
    for i in range(len(cells)):
        x, y = cells[i, 0], cells[i, 1]
        # Skip cells that the tightest arc on their side passes at `radius` or more.
        if x * x + (abs(y) - turn_radius) ** 2 >= touch:
            continue
        bearing = math.atan2(y, x)
        if y > 0.0:
            left = min(left, bearing)
        elif y < 0.0:
            right = max(right, bearing)
    return right, left


@njit(cache=True, error_model="numpy")
def masked(blocked: Bools, yaw: float, right: float, left: float) -> Bools:
    """Masked polar histogram (third stage): blocked, or outside [right, left] about the heading `yaw` [rad]."""
    num_sectors = len(blocked)
    alpha = 2.0 * math.pi / num_sectors
    mask = np.empty(num_sectors, np.bool_)
    for k in range(num_sectors):
        bearing = _remainder(k * alpha - yaw, 2.0 * math.pi)
        mask[k] = blocked[k] or bearing < right or bearing > left
    return mask


@njit(cache=True, error_model="numpy")
def candidate_directions(blocked: Bools, target: float, wide: float) -> Floats:
    """Candidate directions (fourth stage), in sectors: (K,), K = 0 if every sector is blocked.

    target: its direction, wide: s_max, both in sectors. A valley of fewer than `wide` free sectors gives its middle.
    A wider one gives a direction `wide`/2 from either edge, and the target's if it lies between them.
    """
    num_sectors = len(blocked)
    # Start at a blocked sector, so that no valley is divided.
    edge = 0
    while edge < num_sectors and not blocked[edge]:
        edge += 1
    if edge == num_sectors:
        return np.array([target])
    directions = np.empty(3 * num_sectors)
    count, k = 0, edge
    while k < edge + num_sectors:
        if blocked[k % num_sectors]:
            k += 1
            continue
        # One valley: all free sectors up to the next blocked one.
        first = k
        while not blocked[k % num_sectors]:
            k += 1
        count = _append_valley(first, k - 1, target, wide, num_sectors, directions, count)
    return directions[:count]


@njit(cache=True, error_model="numpy")
def cheapest(
    candidates: Floats, costs: tuple[float, float, float], towards: tuple[float, float, float], n: int
) -> int:
    """Index of the candidate with the least Σ μ·Δ (fourth stage), in a tie the one nearest to the target.

    costs (μ1, μ2, μ3); towards: directions of the target, of the heading, of the previous choice. All directions
    are in sectors; n: number of sectors.
    """
    best, lowest, gap = -1, np.inf, np.inf
    for i in range(len(candidates)):
        # Weighted sum of the differences from the target, the heading and the previous choice.
        cost = 0.0
        for j in range(3):
            cost += costs[j] * abs(_remainder(candidates[i] - towards[j], float(n)))
        offset = abs(_remainder(candidates[i] - towards[0], float(n)))
        if cost < lowest - 1e-9 or (cost < lowest + 1e-9 and offset < gap - 1e-9):  # tolerance for rounding
            best, lowest, gap = i, cost, offset
    return best


@njit(cache=True, error_model="numpy")
def _append_valley(first_sector, last_sector, target, wide_valley, num_sectors, directions, count):
    """Append the candidates of a valley, given by its first and last sector; return the new number of candidates."""
    # A narrow valley gives its middle.
    if last_sector - first_sector + 1 < wide_valley:
        directions[count] = 0.5 * (first_sector + last_sector)
        return count + 1
    # A wide one gives a direction near either edge, and the target's between them.
    right, left = first_sector + 0.5 * wide_valley, last_sector - 0.5 * wide_valley
    if right >= left:
        directions[count] = 0.5 * (first_sector + last_sector)
        return count + 1
    directions[count], directions[count + 1] = right, left
    middle = 0.5 * (first_sector + last_sector)
    ahead = middle + _remainder(target - middle, float(num_sectors))
    if right < ahead < left:
        directions[count + 2] = ahead
        return count + 3
    return count + 2


@njit(cache=True, error_model="numpy")
def _remainder(value, turn):
    """`value` minus whole turns, in [−turn/2, turn/2]."""
    return value - turn * np.rint(value / turn)
