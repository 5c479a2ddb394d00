"""Motion of many robots whose wheels roll without sliding, in substeps, and what encoders report of it."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.motion import even_limits
from lme.gym.kernels.crowds import crowd_of, first_touch, move
from lme.gym.kernels.delays import has_gait, receive, remember, send, walk
from lme.gym.kernels.poses import relative, rolled
from lme.gym.kernels.steps import driven_until, settle
from lme.types import Floats


class Encoders(NamedTuple):
    """What exact encoders of N robots report: twists (N, 2) and poses (N, 3) in the frames of the starts.

    commands (N, 2): the last ones, as far as the robots' limits allow. scans (N, 3): the poses at which the newest
    scans were taken.
    """

    twists: Floats
    odometry: Floats
    commands: Floats
    scans: Floats


@njit(cache=True, error_model="numpy", nogil=True)
def reckon(chosen, poses, starts, odometry):
    """Write the odometry (N, 3) of the chosen robots (K,): their poses in the frames of their starts (N, 3)."""
    for i in chosen:
        pose, start = (poses[i, 0], poses[i, 1], poses[i, 2]), (starts[i, 0], starts[i, 1], starts[i, 2])
        odometry[i, 0], odometry[i, 1], odometry[i, 2] = relative(pose, start)


@njit(cache=True, error_model="numpy")
def _ramp(start, goal, rate, dt):
    """Value after `dt` [s] of a quantity that ramps from start to goal, and its integral."""
    change = goal - start
    ramp_time = min(abs(change) / rate, dt)
    end = goal if ramp_time < dt else start + math.copysign(rate * dt, change)
    return end, (start + end) / 2 * ramp_time + end * (dt - ramp_time)


@njit(cache=True, error_model="numpy", nogil=True)
def roll(
    chosen,
    states,
    bodies,
    places,
    obstacles,
    commands,
    counts,
    tracks,
    factors,
    queues,
    gaits,
    encoders,
    rules,
    crowds,
    walkers,
):
    """Drive the chosen robots (K,) in substeps, as `Substepper.period` does; `states.twists` are on the ramps.

    counts (N,) of the substeps; tracks (N,) [m]; factors (N, 2): ground per metre of tread, left and right. rules:
    control period, latency and lag [s], and whether the ramp is even. crowds, walkers: movers around the robots; None
    if nothing moves, or nobody walks.
    """
    period, latency, lag, even_ramp = rules
    for i in chosen:
        begin, count = states.times[i], counts[i]
        dt = period / count
        decay = math.exp(-dt / lag) if lag > 0.0 else 0.0
        send(queues, i, begin + latency, commands[i, 0], commands[i, 1])
        remember(encoders.commands[i], commands[i], bodies.limits[i], period)
        travel, measured = np.empty((count, 3)), np.empty((count, 5))
        bounds = (bodies.limits[i, 0], bodies.limits[i, 1], bodies.limits[i, 2], bodies.limits[i, 3])
        v, omega = states.twists[i, 0], states.twists[i, 1]
        pose = (states.poses[i, 0], states.poses[i, 1], states.poses[i, 2])
        odometry = (encoders.odometry[i, 0], encoders.odometry[i, 1], encoders.odometry[i, 2])
        allowed = bounds
        driven, contact, arrived = count, False, False
        if crowds is not None:
            crowd = crowd_of(crowds, walkers, i)
        for k in range(count):
            if crowds is not None:
                move(crowd, pose, bodies.reaches[i], dt)
            # The command that is active in the middle of the substep, and its limits from when it took effect.
            has_changed = receive(queues, i, begin + (k + 0.5) * dt)
            command = (queues.arrived[i, 0], queues.arrived[i, 1])
            if even_ramp and (k == 0 or has_changed):
                allowed = even_limits((v, omega), command, bounds, period)
            # Wheels, or legs that follow their ramps.
            v_goal = min(max(command[0], -allowed[0]), allowed[0])
            omega_goal = min(max(command[1], -allowed[1]), allowed[1])
            if lag > 0.0:
                v_goal += decay * (v - v_goal)
                omega_goal += decay * (omega - omega_goal)
            v, distance = _ramp(v, v_goal, allowed[2], dt)
            omega, angle = _ramp(omega, omega_goal, allowed[3], dt)
            twist_v, twist_omega = v, omega
            if has_gait(gaits):
                distance, angle = walk(gaits, i, distance / dt, angle / dt, dt)
                twist_v, twist_omega = gaits.twists[i, 0], gaits.twists[i, 1]
            odometry = rolled(odometry, distance, angle)
            # The ground that each wheel covers, and the pose that follows.
            left = (distance - angle * tracks[i] / 2) * factors[i, 0]
            right = (distance + angle * tracks[i] / 2) * factors[i, 1]
            pose = rolled(pose, (left + right) / 2, (right - left) / tracks[i])
            travel[k, 0], travel[k, 1], travel[k, 2] = pose
            measured[k, 0], measured[k, 1] = twist_v, twist_omega
            measured[k, 2], measured[k, 3], measured[k, 4] = odometry
            # Movers are where they are in this substep alone.
            if crowds is not None:
                here = travel[k : k + 1]
                _, contact, arrived = driven_until(i, here, bodies, places, obstacles)
                if first_touch(crowd, here, bodies.boxes[i]) >= 0:
                    contact, arrived = True, False
                if contact or arrived:
                    driven = k + 1
                    break
        # Cut the motion at contact or arrival. What encoders and ramps show then is of that substep.
        if crowds is None:
            driven, contact, arrived = driven_until(i, travel, bodies, places, obstacles)
        states.twists[i, 0], states.twists[i, 1] = v, omega
        encoders.twists[i], encoders.odometry[i] = measured[driven - 1, :2], measured[driven - 1, 2:]
        settle(i, states, places, travel[:driven], begin + dt * driven, contact, arrived)
        encoders.scans[i] = states.poses[i]
