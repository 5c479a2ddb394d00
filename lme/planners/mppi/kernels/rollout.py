"""Sampled controls, the trajectories to which they lead, and their average.

A sequence (T, 2) holds the velocity [m/s] and the turn rate [rad/s] of every model step. Element 0 is the present one.
Limits are (v_min, v_max, omega_max, brake, speed_up, alpha_omega): the least and greatest velocity [m/s], the greatest
turn rate [rad/s], the rates at which the speed may fall and rise [m/s²], brake ≤ 0, and that of the turn rate [rad/s²].
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Floats

Singles = NDArray[np.float32]
VelocityLimits = tuple[float, float, float, float, float, float]

# Savitzky & Golay 1964, DOI 10.1021/ac60214a047: second order, nine points.
_FILTER = np.array([-21.0, 14.0, 39.0, 54.0, 59.0, 54.0, 39.0, 14.0, -21.0]) / 231.0
_LEAD = 4  # points before the one that the filter smooths
_SHORTEST = 21  # [points] shorter sequences are not smoothed


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
