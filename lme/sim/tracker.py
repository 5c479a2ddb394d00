"""A tracker of people: where the moving discs that the lidar can see are, and how fast they walk."""

from __future__ import annotations

from lme.kernels.sight import discs_in_sight
from lme.sim.crowd import Crowd
from lme.types import Floats, LaserScan, Pose

_SLACK = 0.1  # [m] a beam that ends this much before a person is hidden from it; more than a lidar's noise


def tracked(crowd: Crowd, scan: LaserScan, lidar: Pose, base: Pose) -> Floats:
    """Positions and velocities over ground of the people in sight, in the robot frame: (P, 4) [m, m/s].

    People are the crowd's discs; doors and other polygons are not tracked. lidar: where the scan was taken;
    base: the robot; both in the world. A person is in sight if the beam through their middle does not end before
    them. Positions and velocities are the true ones.
    """
    angles = (float(scan.angle_min), float(scan.angle_increment))
    limits = (float(scan.range_min), float(scan.range_max), _SLACK)
    poses = (lidar.x, lidar.y, lidar.yaw), (base.x, base.y, base.yaw)  # Numba takes a Pose for another type
    seen: Floats = discs_in_sight(crowd.circles, crowd.disc_velocities, scan.ranges, angles, limits, *poses)
    return seen
