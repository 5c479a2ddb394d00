"""Distances on a costmap, and the scores of simulated trajectories, as in ROS base_local_planner.

Lattice, `Grid` and `Costs` are those of `lme.kernels.costmap`; outlines are those of `lme.kernels.outline`.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.kernels.costmap import INSCRIBED, Costs, Grid, lattice
from lme.kernels.outline import outline_capacity, outline_cells, outline_cost
from lme.types import Bools, Floats, Ints

Distances = NDArray[np.int32]

NO_WAY = np.iinfo(np.int32).max  # distance of cells that are forbidden or not connected

HITS, LOST = -1.0, -2.0  # scores of trajectories that touch an obstacle, or pass a cell without a way


@njit(cache=True, error_model="numpy")
def way_cells(path: Floats, centre: tuple[float, float], reach: float, grid: Grid, shape: tuple[int, int]) -> Ints:
    """Array indices of the points of a path (K, 2) [m] that are on the map: (C, 2).

    They start at the first point within `reach` [m] of `centre` that is on the array, and end before the next one
    that is not. Points should be at most a cell apart.
    """
    cells = np.empty((len(path), 2), np.int64)
    count = 0
    for k in range(len(path)):
        i, j = lattice(path[k, 0] / grid[2]) - grid[0], lattice(path[k, 1] / grid[2]) - grid[1]
        near = math.hypot(path[k, 0] - centre[0], path[k, 1] - centre[1]) <= reach
        if near and 0 <= i < shape[0] and 0 <= j < shape[1]:
            cells[count, 0], cells[count, 1] = i, j
            count += 1
        elif count > 0:
            break
    return cells[:count]


@njit(cache=True, error_model="numpy")
def distances(costs: Costs, ignored: Bools, cells: Ints) -> Distances:
    """Steps over the sides of cells from each cell to the nearest of `cells` (C, 2): (I, J).

    No way leads through cells of cost ≥ `INSCRIBED`, except those `ignored` (I, J), and the distance of such cells
    is `NO_WAY`; `cells` themselves always have 0. Source: base_local_planner's map_grid.cpp.
    """
    rows, columns = costs.shape
    steps = np.full((rows, columns), NO_WAY, np.int32)
    queue = np.empty(rows * columns, np.int32)
    size = 0
    for k in range(len(cells)):
        if steps[cells[k, 0], cells[k, 1]] != 0:
            steps[cells[k, 0], cells[k, 1]] = 0
            queue[size] = cells[k, 0] * columns + cells[k, 1]
            size += 1
    done = 0
    while done < size:
        i, j = queue[done] // columns, queue[done] % columns
        done += 1
        for side in range(4):
            a, b = i + (side == 0) - (side == 1), j + (side == 2) - (side == 3)
            if a < 0 or b < 0 or a >= rows or b >= columns or steps[a, b] != NO_WAY:
                continue
            if costs[a, b] < INSCRIBED or ignored[a, b]:
                steps[a, b] = steps[i, j] + 1
                queue[size] = a * columns + b
                size += 1
    return steps


@njit(cache=True, error_model="numpy")
def score(
    wanted: Floats,
    pose: tuple[float, float, float],
    twist: tuple[float, float],
    alphas: tuple[float, float],
    simulation: tuple[float, float, float],
    outline: Floats,
    costs: Costs,
    grid: Grid,
    to_path: Distances,
    to_goal: Distances,
    scales: tuple[float, float, float],
) -> tuple[Floats, Floats]:
    """Scores (N,) of the trajectories to the wanted twists (N, 2) [m/s, rad/s], less is better, and ends (N, 3).

    From `pose` and `twist` the velocities approach the wanted ones at `alphas` [m/s², rad/s²]. simulation: (time [s],
    step [m], step [rad per second of turning]). scales: of the distances [cells] to path and goal at the last pose,
    and of the highest cost under the outline or the centre at any pose. The pose after the last step is not scored.
    A score is `HITS` if the outline touches an obstacle or leaves the map, `LOST` if the centre comes to a cell
    without a way to path or goal, whichever is first. Source: base_local_planner's trajectory_planner.cpp.
    """
    scores, ends = np.empty(len(wanted)), np.empty((len(wanted), 3))
    cells = np.empty((outline_capacity(outline, grid[2]), 2), np.int64)
    for n in range(len(wanted)):
        x, y, yaw = pose
        v, omega = twist
        way, turn = abs(wanted[n, 0]) * simulation[0] / simulation[1], abs(wanted[n, 1]) / simulation[2]
        steps = max(int(max(way, turn) + 0.5), 1)
        dt = simulation[0] / steps
        highest, path, goal, failure = 0, 0, 0, 0.0
        for _ in range(steps):
            cost = outline_cost(costs, cells, outline_cells(outline, (x, y, yaw), grid, cells))
            if cost < 0:
                failure = HITS
                break
            i, j = lattice(x / grid[2]) - grid[0], lattice(y / grid[2]) - grid[1]
            path, goal = to_path[i, j], to_goal[i, j]
            if path == NO_WAY or goal == NO_WAY:
                failure = LOST
                break
            highest = max(highest, cost, int(costs[i, j]))
            v = min(max(wanted[n, 0], v - alphas[0] * dt), v + alphas[0] * dt)
            omega = min(max(wanted[n, 1], omega - alphas[1] * dt), omega + alphas[1] * dt)
            ends[n, 0], ends[n, 1], ends[n, 2] = x, y, yaw
            x, y, yaw = x + v * math.cos(yaw) * dt, y + v * math.sin(yaw) * dt, yaw + omega * dt
        scores[n] = failure if failure < 0.0 else scales[0] * path + scales[1] * goal + scales[2] * highest
    return scores, ends
