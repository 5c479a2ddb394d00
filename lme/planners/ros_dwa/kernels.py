"""Distances on a costmap, and the scores of simulated trajectories, as in ROS base_local_planner.

Lattice, `Grid`, `Costs` and outlines are those of `lme.grids.obstacle_grid`.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.grids.obstacle_grid import INSCRIBED, Costs, Grid, lattice, outline_capacity, outline_cost
from lme.types import Bools, Floats, Ints

Distances = NDArray[np.int32]

_WALL, _OPEN, _WANTED = -1, -2, -3  # forbidden; not reached yet; not reached yet and in the window
_STRIDE = 8

HITS, LOST = -1.0, -2.0  # scores of trajectories that touch an obstacle, or pass a cell without a way


@njit(cache=True, error_model="numpy")
def way_cells(
    path: Floats, centre: tuple[float, float], reach: float, grid: Grid, shape: tuple[int, int]
) -> Ints:
    """Array indices of the points of a path (K, 2) [m] that are on the map: (C, 2).

    They start at the first point within `reach` [m] of `centre` that is on the array, and end before the next one
    that is not. Points should be at most a cell apart.
    """
    cells = np.empty((len(path), 2), np.int64)
    count = 0
    for k in range(len(path)):
        i, j = lattice(path[k, 0] / grid[2]) - grid[0], lattice(path[k, 1] / grid[2]) - grid[1]
        # Skip points until one is near `centre` and on the map; then stop at the first that is not.
        in_reach = math.hypot(path[k, 0] - centre[0], path[k, 1] - centre[1]) <= reach
        if in_reach and 0 <= i < shape[0] and 0 <= j < shape[1]:
            cells[count, 0], cells[count, 1] = i, j
            count += 1
        elif count > 0:
            break
    return cells[:count]


@njit(cache=True, error_model="numpy")
def distances(costs: Costs, ignored: Bools, cells: Ints, window: tuple[int, int, int, int]) -> Distances:
    """Steps across the sides of cells from each cell to the nearest of `cells` (C, 2): (I, J); negative: no way.

    Cells of cost ≥ `INSCRIBED` cannot be crossed, except those `ignored` (I, J); `cells` themselves always have 0.
    Only the distances in the window (first row, row after the last, first column, column after the last) are
    guaranteed. Source: base_local_planner's map_grid.cpp.
    """
    rows, columns = costs.shape
    width = columns + 2  # with a wall around, so that no index leaves the map
    steps = np.full((rows + 2) * width, _WALL, np.int32)
    # Open the cells that may be crossed.
    for i in range(rows):
        for j in range(columns):
            if costs[i, j] < INSCRIBED or ignored[i, j]:
                steps[(i + 1) * width + j + 1] = _OPEN
    # Count the cells of the window that still need a distance, so that the search can stop early.
    missing = 0
    for i in range(max(window[0], 0), min(window[1], rows)):
        for j in range(max(window[2], 0), min(window[3], columns)):
            cell = (i + 1) * width + j + 1
            if steps[cell] == _OPEN:
                steps[cell], missing = _WANTED, missing + 1
    # Breadth-first search across the sides of cells, from all of `cells` at once.
    queue = np.empty(rows * columns, np.int32)
    head, size = 0, 0
    for k in range(len(cells)):
        cell = (cells[k, 0] + 1) * width + cells[k, 1] + 1
        missing -= steps[cell] == _WANTED
        if steps[cell] != 0:
            steps[cell], queue[size], size = 0, cell, size + 1
    while head < size and missing > 0:
        cell = queue[head]
        head += 1
        for offset in (-1, 1, -width, width):
            neighbour = cell + offset
            if steps[neighbour] <= _OPEN:
                missing -= steps[neighbour] == _WANTED
                steps[neighbour], queue[size], size = steps[cell] + 1, neighbour, size + 1
    return steps.reshape(rows + 2, width)[1:-1, 1:-1].copy()


@njit(cache=True, error_model="numpy")
def score(
    twists: Floats,
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
    best_cost: float,
    best_only: bool,
) -> tuple[Floats, Floats]:
    """Scores (N,) of the trajectories to the wanted twists (N, 2) [m/s, rad/s], less is better, and ends (N, 3).

    From `pose` and `twist` the velocities approach the wanted ones at `alphas` [m/s², rad/s²]. simulation: (time [s],
    step [m], step [rad per second of turning]). scales: of the distances [cells] to path and goal at the last pose,
    and of the highest cost under the outline or the centre at any pose. The pose after the last step is not scored.
    A score is `HITS` if the outline touches an obstacle or leaves the map, `LOST` if the centre comes to a cell
    without a way to path or goal, whichever is first. If it is worse than `best_cost` it may be inf instead; with
    `best_only` also if another one is better. Source: base_local_planner's trajectory_planner.cpp.
    """
    poses, counts = _simulate(twists, pose, twist, alphas, simulation)
    bounds = _bounds(poses, counts, grid, to_path, to_goal, scales)
    cells = np.empty(outline_capacity(outline, grid[2]), np.int64)
    scores, ends = np.full(len(twists), np.inf), np.empty((len(twists), 3))
    # In the order of the bounds, so that a good trajectory soon rules out the others.
    for n in np.argsort(bounds):
        ends[n] = poses[n, counts[n] - 1]
        if bounds[n] > best_cost:
            continue
        scores[n] = _total(
            bounds[n], scales[2], poses[n, : counts[n]], outline, costs, grid, best_cost, cells
        )
        if best_only and scores[n] >= 0.0:
            best_cost = min(best_cost, scores[n])
    return scores, ends


@njit(cache=True, error_model="numpy")
def _simulate(twists, pose, twist, alphas, simulation):
    """Poses (N, K, 3) of the trajectories, and the number of poses of each (N,)."""
    counts = np.empty(len(twists), np.int64)
    for n in range(len(twists)):
        # As many poses as the way or the turn needs, whichever is more.
        distance, turn = abs(twists[n, 0]) * simulation[0] / simulation[1], abs(twists[n, 1]) / simulation[2]
        counts[n] = max(int(max(distance, turn) + 0.5), 1)
    poses = np.empty((len(twists), counts.max() if len(counts) else 0, 3))
    for n in range(len(twists)):
        x, y, yaw = pose
        v, omega = twist
        dt = simulation[0] / counts[n]
        for k in range(counts[n]):
            poses[n, k, 0], poses[n, k, 1], poses[n, k, 2] = x, y, yaw
            # Velocities approach the wanted ones by at most α dt; then one Euler step.
            v = min(max(twists[n, 0], v - alphas[0] * dt), v + alphas[0] * dt)
            omega = min(max(twists[n, 1], omega - alphas[1] * dt), omega + alphas[1] * dt)
            x, y, yaw = x + v * math.cos(yaw) * dt, y + v * math.sin(yaw) * dt, yaw + omega * dt
    return poses, counts


@njit(cache=True, error_model="numpy")
def _bounds(poses, counts, grid, to_path, to_goal, scales):
    """Scores (N,) without the costs along the way; inf for trajectories that get lost, which are cut off there."""
    bounds = np.empty(len(poses))
    for n in range(len(poses)):
        path, goal = 0, 0
        # A trajectory is scored by the distances at its last pose, and lost at a pose without a way.
        for k in range(counts[n]):
            i, j = lattice(poses[n, k, 0] / grid[2]) - grid[0], lattice(poses[n, k, 1] / grid[2]) - grid[1]
            on_map = 0 <= i < to_path.shape[0] and 0 <= j < to_path.shape[1]
            path, goal = (to_path[i, j], to_goal[i, j]) if on_map else (_WALL, _WALL)
            if path < 0 or goal < 0:
                counts[n] = k + 1
                break
        bounds[n] = np.inf if path < 0 or goal < 0 else scales[0] * path + scales[1] * goal
    return bounds


@njit(cache=True, error_model="numpy")
def _total(bound, scale, poses, outline, costs, grid, best_cost, cells):
    """`bound` plus the scaled highest cost at the poses (K, 3), or `HITS` or `LOST`; inf once it is above `best_cost`.

    Every eighth pose is checked first, since most trajectories that touch an obstacle do so at several poses.
    """
    highest = 0
    # Every eighth pose, then the poses before those, and so on.
    for first in range(_STRIDE - 1, -1, -1):
        for k in range(first, len(poses), _STRIDE):
            cost = outline_cost(costs, outline, (poses[k, 0], poses[k, 1], poses[k, 2]), grid, cells)
            # The outline touches an obstacle or leaves the map.
            if cost < 0:
                return HITS
            i, j = lattice(poses[k, 0] / grid[2]) - grid[0], lattice(poses[k, 1] / grid[2]) - grid[1]
            highest = max(highest, cost, int(costs[i, j]))
            if bound + scale * highest > best_cost:
                return np.inf
    return LOST if bound == np.inf else bound + scale * highest
