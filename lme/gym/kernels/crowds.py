"""Movers in the worlds of many robots: how they move, whom they touch, and how lidars see them."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.geometry.collision import sweep
from lme.gym.kernels.poses import compose
from lme.gym.kernels.steps import lidar_pose
from lme.perception.leaf_scan import scan_shapes
from lme.simulation.crowd import discs_in_sight
from lme.simulation.crowd_step import (
    CrowdState,
    Paths,
    Pedestrians,
    advance,
    present_circles,
    present_velocities,
)
from lme.types import Ints


class Crowds(NamedTuple):
    """Movers of N robots' worlds, K of which are stored.

    worlds (N,): which one each robot is in. states: arrays of N rows, as long as the largest crowd needs. paths: those
    of all worlds, one after another; path_rows (K, 8, 2): first and last + 1 of each world's rows in its 8 arrays.
    """

    worlds: Ints
    states: CrowdState
    paths: Paths
    path_rows: Ints


class Walkers(NamedTuple):
    """The people among the movers: those of all worlds, and rows (K, 10, 2) as in `Crowds`."""

    people: Pedestrians
    rows: Ints


@njit(cache=True, error_model="numpy")
def crowd_of(crowds, walkers, i):
    """Return paths, people (None if `walkers` is) and state of the movers around robot i: views of the arrays."""
    world = crowds.worlds[i]
    p, r = crowds.paths, crowds.path_rows[world]
    paths = Paths(
        p.rules[r[0, 0] : r[0, 1]],
        p.legs[r[1, 0] : r[1, 1]],
        p.waypoints[r[2, 0] : r[2, 1]],
        p.spans[r[3, 0] : r[3, 1]],
        p.discs[r[4, 0] : r[4, 1]],
        p.radii[r[5, 0] : r[5, 1]],
        p.sides[r[6, 0] : r[6, 1]],
        p.owners[r[7, 0] : r[7, 1]],
    )
    people, num_people = None, 0
    if walkers is not None:
        w, r = walkers.people, walkers.rows[world]
        people = Pedestrians(
            w.movers[r[0, 0] : r[0, 1]],
            w.is_orca[r[1, 0] : r[1, 1]],
            w.traits[r[2, 0] : r[2, 1]],
            w.legs[r[3, 0] : r[3, 1]],
            w.waypoints[r[4, 0] : r[4, 1]],
            w.repeats[r[5, 0] : r[5, 1]],
            w.others[r[6, 0] : r[6, 1]],
            w.radii[r[7, 0] : r[7, 1]],
            w.circles[r[8, 0] : r[8, 1]],
            w.edges[r[9, 0] : r[9, 1]],
        )
        num_people = len(people.movers)
    s, count, discs, sides = crowds.states, len(paths.rules), len(paths.discs), len(paths.sides)
    state = CrowdState(
        s.progress[i, :count],
        s.has_begun[i, :count],
        s.poses[i, :count],
        s.velocities[i, :count],
        s.is_present[i, :count],
        s.circles[i, :discs],
        s.edges[i, :sides],
        s.plans[i, :num_people],
        s.walks[i, :num_people],
        s.clock[i],
    )
    return paths, people, state


@njit(cache=True, error_model="numpy")
def move(crowd, pose, radius, dt):
    """Advance a crowd by `dt` [s]. pose: of the robot at the start of the step; radius: of the robot [m]."""
    paths, people, state = crowd
    advance(paths, people, state, (pose[0], pose[1], radius), dt)


@njit(cache=True, error_model="numpy")
def first_touch(crowd, poses, box):
    """First of the poses (K, 3) of a footprint that touches a mover, −1 if none does."""
    paths, _, state = crowd
    return sweep(poses, (box[0], box[1], box[2]), present_circles(paths, state), state.edges)[1]


@njit(cache=True, error_model="numpy", nogil=True)
def look_at_movers(chosen, poses, lidar, table, ranges, crowds):
    """Shorten the ranges (N, B) of the chosen robots (K,) to the movers. The other arguments are those of `look`."""
    for i in chosen:
        paths, _, state = crowd_of(crowds, None, i)
        x, y, heading = lidar_pose(poses[i, 0], poses[i, 1], poses[i, 2], lidar)
        frame = (x, y, math.cos(heading), math.sin(heading))
        met = np.full(table.shape[1], np.float32(lidar[5]))
        scan_shapes(frame, lidar[4], lidar[5], table, present_circles(paths, state), state.edges, met)
        for beam in range(len(met)):
            ranges[i, beam] = min(ranges[i, beam], met[beam])


@njit(cache=True, error_model="numpy", nogil=True)
def look_for_people(chosen, scans, bases, mount, lidar, ranges, people, crowds):
    """Write the nearest people in sight of the chosen robots (K,) into rows (N, R, 5), nearest first: as `people_rows`.

    scans, bases (N, 3): poses at which the scans were taken, and of the robots now. mount: x, y, yaw of the lidar.
    lidar: angle_min, angle_increment, range_min, range_max and slack, as in `discs_in_sight`. ranges (N, B) [m].
    """
    angle_min, increment, range_min, range_max, slack = lidar
    angles, limits = (angle_min, increment), (range_min, range_max, slack)
    for i in chosen:
        paths, _, state = crowd_of(crowds, None, i)
        base = (bases[i, 0], bases[i, 1], bases[i, 2])
        sensor = compose((scans[i, 0], scans[i, 1], scans[i, 2]), mount)
        circles, velocities = present_circles(paths, state), present_velocities(paths, state)
        seen = discs_in_sight(circles, velocities, ranges[i], angles, limits, sensor, base)
        # The nearest first, and of equally near ones the first.
        distances = np.array([math.hypot(row[0], row[1]) for row in seen])
        for row in range(min(len(seen), people.shape[1])):
            nearest = np.argmin(distances)
            people[i, row, :4], people[i, row, 4] = seen[nearest], 1.0
            distances[nearest] = math.inf
