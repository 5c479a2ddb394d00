"""Critics of nav2_mppi_controller: each adds to the costs (N,) of N sampled trajectories, in place.

Poses (N, T, 3) [m, m, rad] and paths (P, 2) [m] are in the frame of the map, and a path begins at the robot. Speeds
(N, T) [m/s] are those with which the poses were driven. Lattice, `Grid` and `Costs` are those of
`lme.grids.obstacle_grid`, outlines those of `lme.grids.obstacle_grid`.
"""

import math

import numpy as np
from numba import njit

from lme.grids.obstacle_grid import INSCRIBED, Costs, Grid, lattice, outline_capacity, outline_cost
from lme.planners.mppi.kernels.rollout import Singles
from lme.types import Bools, Floats

_FEW = 2  # blocked points of a path that never silence a critic


@njit(cache=True, error_model="numpy")
def constraint(costs: Floats, speeds: Singles, bounds: tuple[float, float], dt: float, weight: float) -> None:
    """ConstraintCritic: distance driven beyond the bounds (v_min, v_max) of the velocity."""
    for n in range(len(costs)):
        excess = 0.0
        for v in speeds[n]:
            excess += max(v - bounds[1], 0.0) + max(bounds[0] - v, 0.0)
        costs[n] += weight * excess * dt


@njit(cache=True, error_model="numpy")
def prefer_forward(costs: Floats, speeds: Singles, dt: float, weight: float) -> None:
    """PreferForwardCritic: distance driven backwards."""
    for n in range(len(costs)):
        backward = 0.0
        for v in speeds[n]:
            backward += max(-v, 0.0)
        costs[n] += weight * backward * dt


@njit(cache=True, error_model="numpy")
def obstacles(
    costs: Floats,
    poses: Singles,
    step: int,
    cells: Costs,
    grid: Grid,
    outline: Floats,
    possible: float,
    prices: tuple[float, float, float],
    near_goal: bool,
) -> bool:
    """CostCritic: cost of the cell under the centre at every `step`-th pose. Returns whether all collide.

    The outline is checked where the cost is at least `possible`. prices: of a collision, of a pose within the
    inscribed radius of an obstacle, and the weight of all. Leaving the map is a collision. near_goal: other
    poses cost nothing.
    """
    looked_at = poses.shape[1] // step
    room = np.empty(outline_capacity(outline, grid[2]), np.int64)
    # Costs reach 254; the mean is over the poses that are looked at.
    weight = prices[2] / 254.0 / looked_at
    all_collide = True
    for n in range(len(costs)):
        total, collides = 0.0, False
        for k in range(0, looked_at * step, step):
            x, y, yaw = float(poses[n, k, 0]), float(poses[n, k, 1]), float(poses[n, k, 2])
            cost = _cost_at(x, y, cells, grid)
            if cost == 0:
                continue
            # Off the map, or the outline touches an obstacle; it is only tested where the cost makes that possible.
            if cost < 0 or (cost >= possible and outline_cost(cells, outline, (x, y, yaw), grid, room) < 0):
                total, collides = prices[0], True
                break
            if cost >= INSCRIBED:
                total += prices[1]
            elif not near_goal:
                total += cost
        all_collide = all_collide and collides
        costs[n] += weight * total
    return all_collide


@njit(cache=True, error_model="numpy")
def goal(costs: Floats, poses: Singles, target: tuple[float, float], weight: float) -> None:
    """GoalCritic: mean distance of the poses to the target."""
    for n in range(len(costs)):
        total = 0.0
        for k in range(poses.shape[1]):
            total += math.hypot(poses[n, k, 0] - target[0], poses[n, k, 1] - target[1])
        costs[n] += weight * total / poses.shape[1]


@njit(cache=True, error_model="numpy")
def furthest_reached(poses: Singles, path: Floats) -> int:
    """Index of the farthest point of the path that is the nearest one to the end of some trajectory.

    As in Nav2, each trajectory considers only points from the farthest one so far.
    """
    furthest = 0
    for n in range(len(poses)):
        # The point nearest to the end of this trajectory.
        nearest, min_square = furthest, np.inf
        for j in range(furthest, len(path)):
            square = (path[j, 0] - poses[n, -1, 0]) ** 2 + (path[j, 1] - poses[n, -1, 1]) ** 2
            if square < min_square:
                nearest, min_square = j, square
        furthest = nearest
    return furthest


@njit(cache=True, error_model="numpy")
def free_points(path: Floats, cells: Costs, grid: Grid) -> Bools:
    """Return whether each point of the path but its last is in a cell that the robot's middle may pass: (P − 1,)."""
    free = np.empty(len(path) - 1, np.bool_)
    for j in range(len(free)):
        free[j] = 0 <= _cost_at(path[j, 0], path[j, 1], cells, grid) < INSCRIBED
    return free


@njit(cache=True, error_model="numpy")
def path_align(
    costs: Floats,
    poses: Singles,
    path: Floats,
    free: Bools,
    furthest: int,
    step: int,
    offset: int,
    most_blocked: float,
    weight: float,
) -> None:
    """PathAlignCritic: mean distance of every `step`-th pose to the point of the path at the same path length.

    Only free points before the furthest reached count. Adds nothing if that is fewer than `offset` points away, or if
    more than a share `most_blocked` of the path up to it is blocked.
    """
    if furthest == 0 or furthest < offset:
        return
    # Add nothing if too much of the path up to there is blocked.
    blocked = 0
    for j in range(furthest):
        blocked += not free[j]
        if blocked > _FEW and blocked > most_blocked * furthest:
            return
    # Length of the path up to each of its points.
    lengths = np.zeros(furthest)
    for j in range(1, furthest):
        lengths[j] = lengths[j - 1] + math.hypot(path[j, 0] - path[j - 1, 0], path[j, 1] - path[j - 1, 1])
    for n in range(len(costs)):
        length, total, count, index = 0.0, 0.0, 0, 0
        for k in range(step, poses.shape[1], step):
            x, y = poses[n, k, 0], poses[n, k, 1]
            # The length driven so far, and the point of the path at that length.
            length += math.hypot(x - poses[n, k - step, 0], y - poses[n, k - step, 1])
            index = _at_length(lengths, length, index)
            if free[index]:
                total += math.hypot(path[index, 0] - x, path[index, 1] - y)
                count += 1
        if count > 0:
            costs[n] += weight * total / count


@njit(cache=True, error_model="numpy")
def path_follow(
    costs: Floats, poses: Singles, path: Floats, free: Bools, furthest: int, offset: int, weight: float
) -> None:
    """PathFollowCritic: distance from the end to the first free point from `offset` beyond the furthest reached."""
    last_point = len(path) - 1
    index = min(furthest + offset, last_point)
    while index < last_point - 1 and not free[index]:
        index += 1
    for n in range(len(costs)):
        costs[n] += weight * math.hypot(poses[n, -1, 0] - path[index, 0], poses[n, -1, 1] - path[index, 1])


@njit(cache=True, error_model="numpy")
def path_angle(
    costs: Floats,
    poses: Singles,
    path: Floats,
    pose: tuple[float, float, float],
    at: int,
    max_angle: float,
    weight: float,
) -> None:
    """PathAngleCritic: angle at the end of a trajectory between its heading and point `at` of the path.

    Adds nothing if the robot, at `pose`, faces that point within `max_angle` [rad].
    """
    x, y = path[at, 0], path[at, 1]
    # The robot faces the point already.
    if abs(_wrapped(math.atan2(y - pose[1], x - pose[0]) - pose[2])) < max_angle:
        return
    for n in range(len(costs)):
        # Angle between the last heading and the direction from the last pose to the point.
        bearing = math.atan2(y - poses[n, -1, 1], x - poses[n, -1, 0])
        costs[n] += weight * abs(_wrapped(bearing - poses[n, -1, 2]))


@njit(cache=True, error_model="numpy", inline="always")
def _cost_at(x, y, cells, grid):
    """Cost of the cell at a point; −1 off the map."""
    i, j = lattice(x / grid[2]) - grid[0], lattice(y / grid[2]) - grid[1]
    return int(cells[i, j]) if 0 <= i < cells.shape[0] and 0 <= j < cells.shape[1] else -1


@njit(cache=True, error_model="numpy", inline="always")
def _at_length(lengths, length, start):
    """Index of the entry of `lengths` (P,) that is nearest to a path length, from `start` on."""
    for j in range(start + 1, len(lengths)):
        if lengths[j] > length:
            return j - 1 if length - lengths[j - 1] < lengths[j] - length else j
    return len(lengths) - 1


@njit(cache=True, error_model="numpy", inline="always")
def _wrapped(angle):
    """Wrap an angle to [−π, π)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
