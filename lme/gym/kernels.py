"""One control period of many robots, each in its own world, and their observations after it."""

import math
from typing import NamedTuple

from numba import njit

from lme.geometry.collision import first_event
from lme.geometry.motion import drive, even_limits, time_beyond, travelled
from lme.perception.raycast import add_noise, cast_beams
from lme.types import Floats, Ints

RUNNING, SUCCESS, COLLISION, TIMEOUT = 0, 1, 2, 3


class WorldArrays(NamedTuple):
    """Worlds and tasks of N robots. Each robot uses the first rows of its part of the arrays.

    circles (N, C, 3), edges (N, E, 4): obstacles [m]. counts (N, 2): how many of them are the robot's.
    starts, goals (N, 2) [m]. rules (N, 3): tolerance of the goal [m], time limit [s], distance from the start [m] at
    which the clock starts.
    """

    circles: Floats
    edges: Floats
    counts: Ints
    starts: Floats
    goals: Floats
    rules: Floats


class Bodies(NamedTuple):
    """Bodies of N robots: limits (N, 4), collision footprints (N, 3) [m] and their circumscribed radii (N,) [m]."""

    limits: Floats
    boxes: Floats
    reaches: Floats


class States(NamedTuple):
    """State of N robots, which the kernels change in place.

    poses (N, 3); twists (N, 2); times (N,) since reset [s]; clocks (N,): time at which the clock started [s], NaN
    before; lengths (N,) of the paths [m]; outcomes (N,).
    """

    poses: Floats
    twists: Floats
    times: Floats
    clocks: Floats
    lengths: Floats
    outcomes: Ints


@njit(cache=True, error_model="numpy")
def advance(states, bodies, places, commands, dt, max_step, even_ramp):
    """Drive every robot for one control period of `dt` [s], or until contact or arrival.

    commands (N, 2) [m/s, rad/s]; max_step [m] and even_ramp as in `sim=fast`.
    """
    for i in range(len(commands)):
        x, y, begin = states.poses[i, 0], states.poses[i, 1], states.times[i]
        travel, twist = _motion(i, states, bodies, commands, dt, max_step, even_ramp)
        # Cut the motion at the first contact or arrival.
        circles, edges = places.circles[i, : places.counts[i, 0]], places.edges[i, : places.counts[i, 1]]
        box = (bodies.boxes[i, 0], bodies.boxes[i, 1], bodies.boxes[i, 2])
        num_driven, _, contact, arrived = first_event(
            travel, places.goals[i], places.rules[i, 0], box, circles, edges
        )
        # Store the state at the last pose that was reached.
        states.poses[i] = travel[num_driven - 1]
        states.twists[i, 0], states.twists[i, 1] = twist
        states.times[i] = begin + dt * num_driven / len(travel)
        states.lengths[i] += travelled(x, y, travel[:num_driven])
        _run_clock(i, states, places, travel[:num_driven], begin)
        states.outcomes[i] = _outcome(i, states, places, contact, arrived)


@njit(cache=True, error_model="numpy")
def look(chosen, states, places, lidar, table, noise, noise_std, ranges, targets):
    """Write the observations of the chosen robots (K,): ranges (K, B) and targets (K, 2) in their frames [m].

    lidar: x, y, yaw of the mount, angle_min, angle_increment, range_max; table (2, B): `beam_table`; noise (K, B)
    standard normal, not read if noise_std [m] is 0.
    """
    mount_x, mount_y, mount_yaw, angle_min, increment, range_max = lidar
    for k in range(len(chosen)):
        i = chosen[k]
        x, y, yaw = states.poses[i, 0], states.poses[i, 1], states.poses[i, 2]
        cos, sin = math.cos(yaw), math.sin(yaw)
        circles, edges = places.circles[i, : places.counts[i, 0]], places.edges[i, : places.counts[i, 1]]
        # Cast the beams from the pose of the mount in the world.
        lidar_x, lidar_y = x + cos * mount_x - sin * mount_y, y + sin * mount_x + cos * mount_y
        heading = wrapped(yaw + mount_yaw) + angle_min
        ranges[k] = cast_beams(lidar_x, lidar_y, heading, increment, range_max, table, circles, edges)
        if noise_std > 0.0:
            add_noise(ranges[k], noise[k], noise_std, range_max)
        # Rotate the goal into the robot frame.
        dx, dy = places.goals[i, 0] - x, places.goals[i, 1] - y
        targets[k, 0], targets[k, 1] = cos * dx + sin * dy, cos * dy - sin * dx


@njit(cache=True, error_model="numpy")
def wrapped(angle):
    """Wrap an angle to (−π, π] [rad], with exactly the result of `lme.geometry.frames.wrap_angle`."""
    size = abs(angle)
    part = size % math.tau
    complement = math.tau - part
    if part > complement or (part == complement and 0.5 * (size - part) % math.tau != 0.0):
        part = -complement
    part = math.copysign(1.0, angle) * part
    return math.pi if part <= -math.pi else part


@njit(cache=True, error_model="numpy")
def _motion(i, states, bodies, commands, dt, max_step, even_ramp):
    """Return the motion of robot i, by `drive`."""
    pose = (states.poses[i, 0], states.poses[i, 1], states.poses[i, 2])
    twist, command = (states.twists[i, 0], states.twists[i, 1]), (commands[i, 0], commands[i, 1])
    limits = (bodies.limits[i, 0], bodies.limits[i, 1], bodies.limits[i, 2], bodies.limits[i, 3])
    if even_ramp:
        limits = even_limits(twist, command, limits, dt)
    return drive(pose, twist, command, limits, dt, max_step, bodies.reaches[i])


@njit(cache=True, error_model="numpy")
def _run_clock(i, states, places, travel, begin):
    """Start the clock of robot i if it is far enough from the start."""
    if math.isnan(states.clocks[i]):
        states.clocks[i] = time_beyond(travel, places.starts[i], places.rules[i, 2], begin, states.times[i])


@njit(cache=True, error_model="numpy")
def _outcome(i, states, places, contact, arrived):
    if contact:
        return COLLISION
    elapsed = states.times[i] if math.isnan(states.clocks[i]) else states.times[i] - states.clocks[i]
    if elapsed >= places.rules[i, 1] - 1e-9:  # arrival is too late
        return TIMEOUT
    return SUCCESS if arrived else RUNNING
