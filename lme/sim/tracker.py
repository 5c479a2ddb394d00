"""A tracker of people: where the moving discs that the lidar can see are, and how fast they walk."""

from __future__ import annotations

import math

import numpy as np

from lme.geometry.frames import to_robot
from lme.sim.crowd import Crowd
from lme.types import Bools, Floats, LaserScan, Pose

_SLACK = 0.1  # [m] a beam that ends this much before a person is hidden from it; more than a lidar's noise


def tracked(crowd: Crowd, scan: LaserScan, lidar: Pose, base: Pose) -> Floats:
    """Positions and velocities over ground of the people in sight, in the robot frame: (P, 4) [m, m/s].

    People are the crowd's discs; doors and other polygons are not tracked. lidar: where the scan was taken;
    base: the robot; both in the world. A person is in sight if the beam through their middle does not end before
    them. Positions and velocities are the true ones.
    """
    discs = crowd.circles
    seen = _in_sight(discs, scan, lidar)
    positions = to_robot(discs[seen, :2], base)
    velocities = to_robot(crowd.disc_velocities[seen], Pose(0.0, 0.0, base.yaw))
    return np.hstack([positions, velocities])


def _in_sight(discs: Floats, scan: LaserScan, lidar: Pose) -> Bools:
    """Whether each of the discs (C, 3) is in the field of view, within range and not hidden: (C,)."""
    x, y = to_robot(discs[:, :2], lidar).T
    surface = np.hypot(x, y) - discs[:, 2]
    turn = round(math.tau / scan.angle_increment)
    beams = np.rint((np.arctan2(y, x) - scan.angle_min) / scan.angle_increment).astype(np.int64) % turn
    inside = (beams < len(scan.ranges)) & (surface < scan.range_max)
    ranges = scan.ranges[np.where(inside, beams, 0)]
    hidden = (ranges >= scan.range_min) & (ranges < surface - _SLACK)
    seen: Bools = inside & ~hidden
    return seen
