"""Compiled functions of MPPI: sampled trajectories, their average, and the costs that critics assign to them.

A sequence (T, 2) holds the velocity [m/s] and the turn rate [rad/s] of every model step. Element 0 is the present one.
Limits are (v_min, v_max, omega_max, brake, speed_up, alpha_omega): the least and greatest velocity [m/s], the greatest
turn rate [rad/s], the rates at which the speed may fall and rise [m/s²], brake ≤ 0, and that of the turn rate [rad/s²].

Critics of nav2_mppi_controller add to the costs (N,) of N sampled trajectories, in place. Poses (N, T, 3) [m, m, rad]
and paths (P, 2) [m] are in the frame of the map, and a path begins at the robot. Speeds (N, T) [m/s] are those with
which the poses were driven. Lattice, `Grid` and `Costs` are those of `lme.grids.obstacle_grid`, outlines those of
`lme.grids.obstacle_grid`.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.geometry.motion import wrapped
from lme.grids.obstacle_grid import INSCRIBED, Costs, Grid, lattice, outline_capacity, outline_cost
from lme.types import Bools, Floats

Singles = NDArray[np.float32]
VelocityLimits = tuple[float, float, float, float, float, float]

# Savitzky & Golay 1964, DOI 10.1021/ac60214a047: second order, nine points.
_FILTER = np.array([-21.0, 14.0, 39.0, 54.0, 59.0, 54.0, 39.0, 14.0, -21.0]) / 231.0
_LEAD = 4  # points before the one that the filter smooths
_SHORTEST = 21  # [points] shorter sequences are not smoothed
_FEW = 2  # blocked points of a path that never silence a critic


@njit(cache=True, error_model="numpy")
def rollout(
    sequence: Floats,
    noise: Singles,
    stds: tuple[float, float],
    twist: tuple[float, float],
    pose: tuple[float, float, float],
    limits: VelocityLimits,
    dt: float,
) -> tuple[Singles, Singles, Singles]:
    """Sample controls (N, T, 2) around the sequence; return them, their speeds (N, T) and poses (N, T, 3).

    noise (N, T, 2): standard normal, scaled by `stds`. Controls change by no more than the acceleration allows; the
    last one, which moves nothing, is not limited. Poses are those after each of T steps of `dt` [s], which drive the
    speeds.
    """
    samples, steps = noise.shape[:2]
    controls = np.empty((samples, steps, 2), np.float32)
    speeds = np.empty((samples, steps), np.float32)
    poses = np.empty((samples, steps, 3), np.float32)
    for n in range(samples):
        x, y, yaw = pose
        v, omega = twist
        for k in range(steps):
            # Unicycle step by the explicit Euler method: ẋ = v cos ψ, ẏ = v sin ψ, ψ̇ = ω.
            x, y = x + v * math.cos(yaw) * dt, y + v * math.sin(yaw) * dt
            yaw += omega * dt
            speeds[n, k] = v
            poses[n, k, 0], poses[n, k, 1], poses[n, k, 2] = x, y, yaw
            # Sampled control, limited to what the acceleration allows; it becomes the next velocity.
            next_v = sequence[k, 0] + stds[0] * noise[n, k, 0]
            next_omega = sequence[k, 1] + stds[1] * noise[n, k, 1]
            if k < steps - 1:
                next_v, next_omega = _within_reach(next_v, next_omega, v, omega, limits, dt)
            controls[n, k, 0], controls[n, k, 1] = next_v, next_omega
            v, omega = next_v, next_omega
    return controls, speeds, poses


@njit(cache=True, error_model="numpy")
def charge_controls(
    costs: Floats, sequence: Floats, controls: Singles, stds: tuple[float, float], gamma: float
) -> None:
    """Add to the costs (N,) the cost of leaving the sequence: γ Σ u · (u_n − u) / σ²."""
    for n in range(len(costs)):
        for axis in range(2):
            total = 0.0
            for k in range(len(sequence)):
                total += sequence[k, axis] * (controls[n, k, axis] - sequence[k, axis])
            costs[n] += gamma / (stds[axis] * stds[axis]) * total


@njit(cache=True, error_model="numpy")
def average(controls: Singles, costs: Floats, temperature: float) -> Floats:
    """Mean (T, 2) of the controls (N, T, 2), weighted by exp(−cost / temperature)."""
    min_cost, total = costs.min(), 0.0
    sequence = np.zeros(controls.shape[1:])
    for n in range(len(costs)):
        weight = math.exp((min_cost - costs[n]) / temperature)
        total += weight
        if weight > 0.0:
            for k in range(controls.shape[1]):
                sequence[k, 0] += weight * controls[n, k, 0]
                sequence[k, 1] += weight * controls[n, k, 1]
    return sequence / total


@njit(cache=True, error_model="numpy")
def constrain(sequence: Floats, limits: VelocityLimits, dt: float) -> None:
    """Bring a sequence within the limits, in place: velocities, then changes from its first element on."""
    for k in range(len(sequence)):
        sequence[k, 0] = min(max(sequence[k, 0], limits[0]), limits[1])
        sequence[k, 1] = min(max(sequence[k, 1], -limits[2]), limits[2])
        if k > 0:
            previous = sequence[k - 1]
            sequence[k, 0], sequence[k, 1] = _within_reach(
                sequence[k, 0], sequence[k, 1], previous[0], previous[1], limits, dt
            )


@njit(cache=True, error_model="numpy")
def smooth(sequence: Floats, sent: Floats) -> Floats:
    """Apply a Savitzky–Golay filter to the sequence (T, 2), but its last. sent (4, 2): the controls before it."""
    end = len(sequence) - 1
    if end < _SHORTEST - 1:
        return sequence.copy()
    smoothed = sequence.copy()
    for axis in range(2):
        for k in range(end):
            # Weighted sum over the neighbours: those before the start have been sent, and the last one is
            # repeated past the end.
            total = 0.0
            for m in range(len(_FILTER)):
                i = k + m - _LEAD
                total += _FILTER[m] * (sent[i, axis] if i < 0 else sequence[min(i, end), axis])
            smoothed[k, axis] = total
    return smoothed


@njit(cache=True, error_model="numpy", inline="always")
def _within_reach(v, omega, current_v, current_omega, limits, dt):
    """Nearest velocity and turn rate that the accelerations allow one step after the present ones."""
    fall, rise, turn = limits[3] * dt, limits[4] * dt, limits[5] * dt
    if current_v <= 0.0:
        fall, rise = -rise, -fall
    return (
        min(max(v, current_v + fall), current_v + rise),
        min(max(omega, current_omega - turn), current_omega + turn),
    )


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
    if abs(wrapped(math.atan2(y - pose[1], x - pose[0]) - pose[2])) < max_angle:
        return
    for n in range(len(costs)):
        # Angle between the last heading and the direction from the last pose to the point.
        bearing = math.atan2(y - poses[n, -1, 1], x - poses[n, -1, 0])
        costs[n] += weight * abs(wrapped(bearing - poses[n, -1, 2]))


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
