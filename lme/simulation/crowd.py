"""Motion of pedestrians and doors: the poses of all movers of a world over time, and those whom the lidar sees.

Scripted and recorded movers follow their paths; people walk according to `lme.simulation.walkers`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.simulation.crowd_step import (
    TIME,
    advance,
    paths_of,
    people_of,
    place,
    present_circles,
    present_velocities,
    state_at_start,
)
from lme.simulation.walkers import HASTE
from lme.types import Bools, Floats, LaserScan, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import World

SLACK = 0.1  # [m] a beam that ends this much before a person is hidden from it; more than a lidar's noise


class Crowd:
    """All movers of a world, each at the start of its path until `advance` is called.

    top_speed: the greatest speed of any point of a mover [m/s].
    """

    def __init__(
        self, movers: Sequence[Mover], world: World | None = None, robot_radius: float = 0.0
    ) -> None:
        """world: people walk around its walls. robot_radius: of the disc that represents the robot [m]."""
        self._movers, self._robot_radius = tuple(movers), float(robot_radius)
        self._paths, self._people = paths_of(movers), people_of(movers, world or World())
        self._state = state_at_start(movers, self._paths, self._people)
        self._come_and_go = any(mover.times is not None for mover in movers)
        self.top_speed = top_speed(movers)

    def __len__(self) -> int:
        return len(self._movers)

    @property
    def poses(self) -> Floats:
        """Poses (M, 3) of the movers, in the world."""
        return self._state.poses

    @property
    def velocities(self) -> Floats:
        """Velocities (M, 2) of the movers' origins in the last step, in the world [m/s]."""
        return self._state.velocities

    @property
    def present(self) -> Bools:
        """Whether each of the movers (M,) is in the world; only recorded movers come and go."""
        return self._state.is_present

    @property
    def circles(self) -> Floats:
        """Discs (C, 3) that are present, as in `World` and in the order of the movers."""
        return present_circles(self._paths, self._state) if self._come_and_go else self._state.circles

    @property
    def edges(self) -> Floats:
        """Sides (E, 4) of the polygons, as in `World` and in the order of the movers."""
        return self._state.edges

    def among(self, circles: Floats, edges: Floats) -> tuple[Floats, Floats]:
        """Return static circles (C, 3) and edges (E, 4), followed by those of the movers at their current poses."""
        if not len(self):
            return circles, edges
        return np.vstack([circles, self.circles]), np.vstack([edges, self.edges])

    @property
    def people(self) -> tuple[Floats, Floats]:
        """Discs (C, 3) and their velocities (C, 2), in the order of `circles` [m, m/s]."""
        return self.circles, self.disc_velocities

    @property
    def disc_velocities(self) -> Floats:
        """Velocities (C, 2) of the discs, in the order of `circles` [m/s]."""
        return present_velocities(self._paths, self._state)

    def advance(self, robot: Pose, dt: float) -> None:
        """Advance by `dt` [s]. Movers react to the pose of the robot's base at the start of the step."""
        if len(self):
            advance(self._paths, self._people, self._state, (robot[0], robot[1], self._robot_radius), dt)

    def go_on(self, former: Crowd) -> None:
        """Continue from another crowd: take over its time, and the state of the movers that are in both."""
        state, old = self._state, former._state
        state.clock[TIME] = old.clock[TIME]
        indices = {mover: i for i, mover in enumerate(former._movers)}
        pairs = {i: indices[mover] for i, mover in enumerate(self._movers) if mover in indices}
        for j, k in pairs.items():
            state.progress[j], state.has_begun[j] = old.progress[k], old.has_begun[k]
            state.poses[j], state.velocities[j] = old.poses[k], old.velocities[k]
        # Pedestrians also keep where they were going, and what they know of the robot.
        if self._people is not None and former._people is not None:
            state.clock[:] = old.clock
            rows = {i: row for row, i in enumerate(former._people.movers.tolist())}
            for row, i in enumerate(self._people.movers.tolist()):
                if i in pairs:
                    state.plans[row], state.walks[row] = old.plans[rows[pairs[i]]], old.walks[rows[pairs[i]]]
        place(self._paths, state)


def top_speed(movers: Sequence[Mover]) -> float:
    """Return the greatest speed of any point of the movers [m/s], 0 without movers."""
    return max(map(_top_speed, movers), default=0.0)


def _top_speed(mover: Mover) -> float:
    """Greatest speed of any point of the mover [m/s]."""
    if mover.walks:
        return HASTE * mover.speed
    if mover.times is not None:
        return float((np.hypot(*np.diff(mover.path[:, :2], axis=0).T) / np.diff(mover.times)).max())
    turns = np.ptp(mover.path[:, 2]) > 0.0
    return mover.speed + (mover.turn_rate * mover.reach if turns else 0.0)


def tracked(crowd: Crowd, scan: LaserScan, lidar: Pose, base: Pose) -> Floats:
    """Positions and velocities over ground of the people in sight, in the robot frame: (P, 4) [m, m/s].

    Pedestrians are the crowd's discs; doors and other polygons are not tracked. lidar: where the scan was taken;
    base: the robot; both in the world. A person is in sight if the beam through their middle does not end before
    them. Positions and velocities are the true ones.
    """
    angles = (float(scan.angle_min), float(scan.angle_increment))
    limits = (float(scan.range_min), float(scan.range_max), SLACK)
    poses = (lidar.x, lidar.y, lidar.yaw), (base.x, base.y, base.yaw)  # Numba takes a Pose for another type
    people: Floats = discs_in_sight(crowd.circles, crowd.disc_velocities, scan.ranges, angles, limits, *poses)
    return people


@njit(cache=True, error_model="numpy")
def discs_in_sight(
    discs: Floats,
    velocities: Floats,
    ranges: NDArray[np.float32],
    angles: tuple[float, float],
    limits: tuple[float, float, float],
    lidar: tuple[float, float, float],
    base: tuple[float, float, float],
) -> Floats:
    """Positions and velocities in the frame of `base` of the discs that the scan shows: (P, 4) [m, m/s].

    discs (C, 3) [x, y, r] and their velocities (C, 2), in the world; ranges (B,); angles: angle_min and a positive
    angle_increment [rad]; limits: range_min, range_max, slack [m]; lidar, base: poses in the world. A disc is in
    sight if it is within range_max and the beam nearest to its middle does not end more than the slack before it;
    a beam without a return hides nothing.
    """
    rows, count = np.empty((len(discs), 4)), 0
    cos, sin = math.cos(base[2]), math.sin(base[2])
    for i in range(len(discs)):
        dx, dy = discs[i, 0] - lidar[0], discs[i, 1] - lidar[1]
        # Distance to the near side of the disc, and the range of the beam towards its middle.
        surface = math.sqrt(dx * dx + dy * dy) - discs[i, 2]
        reach = _range_towards(math.atan2(dy, dx) - lidar[2], ranges, angles)
        hidden = limits[0] <= reach < surface - limits[2]
        if reach == -math.inf or hidden or surface >= limits[1]:
            continue
        # Rotate position and velocity into the frame of the base.
        x, y, vx, vy = discs[i, 0] - base[0], discs[i, 1] - base[1], velocities[i, 0], velocities[i, 1]
        rows[count, 0], rows[count, 1] = cos * x + sin * y, cos * y - sin * x
        rows[count, 2], rows[count, 3] = cos * vx + sin * vy, cos * vy - sin * vx
        count += 1
    visible: Floats = rows[:count].copy()
    return visible


@njit(cache=True, error_model="numpy")
def _range_towards(bearing: float, ranges: NDArray[np.float32], angles: tuple[float, float]) -> float:
    """Range of the beam nearest to a bearing in the lidar's frame [m]; −∞ outside the field of view."""
    beam = int(((bearing - angles[0] + 0.5 * angles[1]) % (2.0 * math.pi)) / angles[1])
    return float(ranges[beam]) if beam < len(ranges) else -math.inf
