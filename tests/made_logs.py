"""CARMEN logs made for tests: a simulated robot in a known room."""

import gzip
import math
from itertools import pairwise

import numpy as np

from lme.geometry.frames import compose
from lme.perception.raycast import cast_shapes
from lme.types import Pose

# A room of 10 × 6 m with a wall and a pillar. Through a slit of 30 cm one sees a closet behind its right wall, and
# through a door of 1 m a corridor below it, 12 m long.
EDGES = np.array(
    [
        [0.0, 0.0, 1.0, 0.0], [2.0, 0.0, 10.0, 0.0], [0.0, 0.0, 0.0, 6.0], [0.0, 6.0, 10.0, 6.0],
        [5.0, 0.0, 5.0, 3.5],
        [10.0, 0.0, 10.0, 2.0], [10.0, 2.3, 10.0, 6.0],
        [10.0, 1.0, 12.0, 1.0], [12.0, 1.0, 12.0, 4.0], [10.0, 4.0, 12.0, 4.0],
        [1.0, 0.0, 1.0, -12.0], [2.0, 0.0, 2.0, -12.0], [1.0, -12.0, 2.0, -12.0],
    ]
)  # fmt: skip
PILLAR = (2.5, 3.0, 0.3)
CIRCLES = np.array([PILLAR])
WAYPOINTS = ((1.5, 1.0), (1.2, 4.8), (5.0, 4.8), (8.5, 4.5), (8.0, 1.0))
CLOSET, CORRIDOR = (10.5, 2.15), (1.5, -10.5)  # places that no robot of 25 cm reaches, and that are far away
MOUNT = Pose(0.1, 0.0, 0.0)  # of the laser, in lines ROBOTLASER1


def way():
    """The poses of a drive through the room: it turns around at every waypoint, and drives straight between them."""
    poses = []
    for a, b in pairwise(WAYPOINTS):
        poses += [Pose(*a, math.remainder(k * math.pi / 8, math.tau)) for k in range(16)]
        steps = math.ceil(math.dist(a, b) / 0.3)
        yaw = math.atan2(b[1] - a[1], b[0] - a[0])
        shares = [k / steps for k in range(steps + 1)]
        poses += [Pose(a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1]), yaw) for s in shares]
    return poses + [Pose(*WAYPOINTS[-1], math.remainder(k * math.pi / 8, math.tau)) for k in range(16)]


def scan(laser, beams, rng=None, range_max=81.91):
    """Ranges over half a turn from a pose of the laser, with noise of 1 cm if there is a generator."""
    ranges = cast_shapes(laser, (-math.pi / 2, math.pi / (beams - 1), beams), range_max, CIRCLES, EDGES)
    return (
        ranges if rng is None else np.where(ranges < range_max, ranges + rng.normal(0.0, 0.01, beams), ranges)
    )


def flaser_lines(poses=None, beams=181, rng=None):
    """A log of lines FLASER, each after a line ODOM that has drifted, as in a corrected log."""
    lines = ["# message formats defined: PARAM ODOM FLASER", "PARAM robot_length 0.47 host 0"]
    for k, pose in enumerate(way() if poses is None else poses):
        x, y, yaw = pose
        ranges = " ".join(f"{value:.3f}" for value in scan(pose, beams, rng))
        lines.append(f"ODOM {x + 0.01 * k:.4f} {y:.4f} {yaw:.4f} 0 0 0 {k + 0.9} host {k + 0.9}")
        lines.append(
            f"FLASER {beams} {ranges} {x:.5f} {y:.5f} {yaw:.6f} {x:.5f} {y:.5f} {yaw:.6f} {k + 1} host {k + 1}"
        )
    return lines


def robotlaser_lines(beams=181):
    """A log of lines ROBOTLASER1, whose laser sits ahead of the middle of the robot."""
    lines = []
    for k, pose in enumerate(way()):
        laser = compose(pose, MOUNT)
        ranges = " ".join(f"{value:.3f}" for value in scan(laser, beams, range_max=30.0))
        geometry = f"0 {-math.pi / 2} {math.pi} {math.pi / (beams - 1)} 30.0 0.01 0 {beams}"
        poses = " ".join(f"{value:.6f}" for value in (*laser, *pose))
        lines.append(
            f"ROBOTLASER1 {geometry} {ranges} 2 7.0 8.0 {poses} 0.3 0 0.1 0.1 0 {k + 1}.5 host {k + 1}.5"
        )
    return lines


def write(path, lines):
    """Write a log, compressed if its name ends in .gz; returns the path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data = ("\n".join(lines) + "\n").encode()
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


def truth_clearance(points):
    """(P,) distance from points (P, 2) to the nearest wall or the pillar [m]; negative in the pillar."""
    least = np.hypot(*(points - PILLAR[:2]).T) - PILLAR[2]
    for x0, y0, x1, y1 in EDGES:
        along = np.array([x1 - x0, y1 - y0])
        share = np.clip(((points - (x0, y0)) @ along) / (along @ along), 0.0, 1.0)
        least = np.minimum(least, np.hypot(*(points - ((x0, y0) + share[:, None] * along)).T))
    return least
