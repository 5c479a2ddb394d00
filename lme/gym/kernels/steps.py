"""One control period of many robots, each in its own world, and their observations after it."""

import math
from typing import NamedTuple

from numba import njit

from lme.geometry.collision import first_arrival, sweep
from lme.geometry.motion import drive, even_limits, time_beyond, travelled
from lme.grids.lattice import cast_lattice
from lme.grids.leaves import gaps_to, middle_of, shapes_within
from lme.gym.kernels.poses import wrapped
from lme.perception.raycast import scan_leaves
from lme.types import Floats, Ints

RUNNING, SUCCESS, COLLISION, TIMEOUT = 0, 1, 2, 3


class Obstacles(NamedTuple):
    """Obstacles of all worlds that robots drive in: `Leaves` of the discs and of the edges, one world after another."""

    disc_bounds: Floats
    discs: Floats
    wall_bounds: Floats
    walls: Floats


class Places(NamedTuple):
    """Tasks of N robots.

    spans (N, 5): first leaf and last + 1 of the robot's discs, the same of its edges, and 1 if the lidar meets the
    edges by their lattice instead. starts, goals (N, 2) [m]. rules (N, 3): tolerance of the goal [m], time limit [s],
    distance from the start [m] at which the clock starts.
    """

    spans: Ints
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
    before; lengths (N,) of the paths [m]; steps (N,) since reset; outcomes (N,).
    """

    poses: Floats
    twists: Floats
    times: Floats
    clocks: Floats
    lengths: Floats
    steps: Ints
    outcomes: Ints


@njit(cache=True, error_model="numpy", nogil=True)
def advance(chosen, states, bodies, places, obstacles, commands, dt, max_step, even_ramp):
    """Drive the chosen robots (K,) for one control period of `dt` [s], or until contact or arrival.

    commands (N, 2) [m/s, rad/s]; max_step [m] and even_ramp as in `sim=fast`.
    """
    for i in chosen:
        travel, twist = _motion(i, states, bodies, commands, dt, max_step, even_ramp)
        driven, contact, arrived = driven_until(i, travel, bodies, places, obstacles)
        states.twists[i, 0], states.twists[i, 1] = twist
        end = states.times[i] + dt * driven / len(travel)
        settle(i, states, places, travel[:driven], end, contact, arrived)


@njit(cache=True, error_model="numpy", nogil=True)
def look(chosen, poses, places, obstacles, lidar, table, ranges, targets):
    """Write the observations of the chosen robots (K,): their ranges (N, B), and targets (N, 2) in their frames [m].

    poses (N, 3). lidar: x, y, yaw of the mount, angle_min, angle_increment, range_max; table (2, B): `beam_table`.
    """
    increment, range_max = lidar[4], lidar[5]
    for i in chosen:
        x, y, yaw = poses[i, 0], poses[i, 1], poses[i, 2]
        span = places.spans[i]
        leaves = (
            obstacles.disc_bounds,
            obstacles.discs,
            span[0],
            span[1],
            obstacles.wall_bounds,
            obstacles.walls,
            span[2],
            span[2] if span[4] else span[3],
        )
        lidar_x, lidar_y, heading = lidar_pose(x, y, yaw, lidar)
        scan_leaves(lidar_x, lidar_y, heading, increment, range_max, table, leaves, ranges[i])
        # Rotate the goal into the robot frame.
        cos, sin = math.cos(yaw), math.sin(yaw)
        dx, dy = places.goals[i, 0] - x, places.goals[i, 1] - y
        targets[i, 0], targets[i, 1] = cos * dx + sin * dy, cos * dy - sin * dx


@njit(cache=True, error_model="numpy", nogil=True)
def look_by_lattice(chosen, poses, lidar, table, ranges, grid, lattice):
    """Shorten ranges (N, B) to the edges of a grid and its lattice, for the chosen robots (K,) in one world."""
    for i in chosen:
        x, y, heading = lidar_pose(poses[i, 0], poses[i, 1], poses[i, 2], lidar)
        met = cast_lattice(
            x,
            y,
            heading,
            lidar[5],
            table,
            grid.frame,
            grid.starts,
            grid.edges,
            lattice.frame,
            lattice.uprights,
            lattice.levels,
            lattice.rectangles,
            lattice.edges,
        )
        for beam in range(len(met)):
            ranges[i, beam] = min(ranges[i, beam], met[beam])


@njit(cache=True, error_model="numpy")
def driven_until(i, travel, bodies, places, obstacles):
    """Number of poses up to contact or arrival of robot i, and whether there is contact, or arrival without contact."""
    # Cut the motion at the arrival, then at the first contact before it.
    driven, arrived = first_arrival(travel, places.goals[i], places.rules[i, 0])
    box = (bodies.boxes[i, 0], bodies.boxes[i, 1], bodies.boxes[i, 2])
    contact = _first_contact(travel[:driven], box, places.spans[i], obstacles)
    if contact >= 0:
        return contact + 1, True, False
    return driven, False, arrived


@njit(cache=True, error_model="numpy")
def settle(i, states, places, travel, end, contact, arrived):
    """Store the state of robot i after it has driven along poses (K, 3) until `end` [s]."""
    x, y, begin = states.poses[i, 0], states.poses[i, 1], states.times[i]
    states.poses[i] = travel[len(travel) - 1]
    states.times[i] = end
    states.lengths[i] += travelled(x, y, travel)
    states.steps[i] += 1
    _run_clock(i, states, places, travel, begin)
    states.outcomes[i] = _outcome(i, states, places, contact, arrived)


@njit(cache=True, error_model="numpy")
def lidar_pose(x, y, yaw, lidar):
    """Position of the lidar in the world, and the heading of its first beam."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    mount_x, mount_y, mount_yaw, angle_min = lidar[0], lidar[1], lidar[2], lidar[3]
    lidar_x, lidar_y = x + cos * mount_x - sin * mount_y, y + sin * mount_x + cos * mount_y
    return lidar_x, lidar_y, wrapped(yaw + mount_yaw) + angle_min


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
def _first_contact(travel, box, span, obstacles):
    """First pose in contact, −1 without contact: that of `lme.geometry.collision.sweep` for the robot's obstacles."""
    half_length, half_width, rounding = box
    x, y, reach = middle_of(travel)
    reach = (reach + math.hypot(half_length, half_width) + rounding) * (1.0 + 1e-6)
    circles = _within(x, y, reach, obstacles.disc_bounds, obstacles.discs, span[0], span[1])
    edges = _within(x, y, reach, obstacles.wall_bounds, obstacles.walls, span[2], span[3])
    if len(circles) == 0 and len(edges) == 0:
        return -1
    return sweep(travel, box, circles, edges)[1]


@njit(cache=True, error_model="numpy")
def _within(x, y, reach, bounds, shapes, first, stop):
    """Shapes of the leaves first…stop − 1 that come within `reach` of (x, y)."""
    return shapes_within(x, y, reach, shapes, first, gaps_to(x, y, bounds, first, stop))


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
