"""Scans of a Mid-360 on a body that moves and tilts while the cloud is taken."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lme.geometry.collision import sweep
from lme.perception.point_cloud import CLEARED, rigid_transform, to_scan, without_unmeasured
from lme.robots import Lidar
from lme.simulation.mid360 import mid360_of
from lme.simulation.mid360.pattern import MOST_NOISE
from lme.simulation.mid360.sensor import half_bin_turn, projection_of
from lme.simulation.simulator import LidarCloud
from lme.simulation.substeps import nearby
from lme.types import Floats, Pose
from lme.worlds.world import World

_LEVEL = np.array([0.0, 0.0, 1.0])
_TILTED_SHARE = (
    0.9  # [-] of a distance on the floor, at least, in the plane of a body that tilts by up to 25°
)


class TiltingLidar:
    """A Mid-360 fixed to the trunk. `fire` takes a piece of the cloud, `ranges` makes a scan of the newest pieces.

    Registered, every point is where it was hit, as in the cloud of lidar-inertial odometry. Otherwise the points stay
    in the sensor's frame, as its driver publishes them, and are taken for those of a level body that stands still.
    """

    def __init__(
        self, lidar: Lidar, registered: bool, whole: bool, trunk_height: float, rng: np.random.Generator
    ) -> None:
        """whole: whether to keep points that cannot count for a scan. trunk_height: of the standing robot [m]."""
        assert lidar.cloud is not None
        self._lidar, self._cloud, self._registered, self._whole = lidar, lidar.cloud, registered, whole
        # Mount in the trunk's frame, and in the base frame below it on the floor.
        x, y, _ = lidar.sensor
        self._mount = rigid_transform([x, y, self._cloud.height - trunk_height, 0.0, 0.0, 0.0])
        self._level_mount = rigid_transform([x, y, self._cloud.height, 0.0, 0.0, 0.0])
        self._mid360 = mid360_of(lidar)
        self._mid360.reset(rng)
        self._pieces: deque[tuple[float, Floats, Floats]] = deque()  # time [s], points, sensor to world
        self._projection = projection_of(lidar)

    def fire(
        self, time: float, duration: float, trunk: Floats, world: World, circles: Floats, edges: Floats
    ) -> None:
        """Take the cloud of the last `duration` [s], all from where the sensor is at `time` [s].

        trunk: (4, 4) from its frame to the world; circles (C, 3) and edges (E, 4): the current obstacles, those of the
        world first.
        """
        sensor = trunk @ self._mount
        up = sensor[2, :3] if self._registered else _LEVEL
        height = float(sensor[2, 3]) if self._registered else self._cloud.height
        highest = 1.0 if self._whole else self._highest(height, sensor, world, circles, edges)
        points = self._mid360.upright_returns(sensor, duration, circles, edges, up, highest)
        self._pieces.append((time, points, sensor))
        while self._pieces[0][0] <= time - self._cloud.duration + 1e-9:
            self._pieces.popleft()

    def cloud(self) -> LidarCloud:
        """Return the newest pieces as one cloud in the sensor's frame, at the end of the cloud if it is registered."""
        end, _, sensor = self._pieces[-1]
        if not self._registered:
            times = [np.full(len(points), time - end) for time, points, _ in self._pieces]
            return LidarCloud(np.vstack([points for _, points, _ in self._pieces]), np.concatenate(times))
        to_sensor = np.linalg.inv(sensor)
        transforms = [to_sensor @ piece for _, _, piece in self._pieces]
        return LidarCloud(self._moved(transforms), None)

    def ranges(self, base: Pose) -> NDArray[np.float32]:
        """Project the pieces to a scan (num_beams,) [m], seen from a level base at this pose.

        Inf means that nothing is there, NaN that nothing is known (`lme.perception.point_cloud.without_unmeasured`).
        """
        if self._registered:
            to_base = np.linalg.inv(rigid_transform([base.x, base.y, 0.0, 0.0, 0.0, base.yaw]))
            transforms = [to_base @ sensor for _, _, sensor in self._pieces]
        else:
            transforms = [self._level_mount] * len(self._pieces)
        half_bin = half_bin_turn(self._lidar)
        transforms = [half_bin @ transform for transform in transforms]
        points = self._moved(transforms)
        scan = to_scan(points, self._projection)
        return without_unmeasured(scan, points, transforms[-1][:3, 3], self._projection).ranges

    def _moved(self, transforms: Sequence[Floats]) -> Floats:
        """Points of all pieces (N, 3), each piece moved by its transform (4, 4)."""
        pieces = zip(self._pieces, transforms, strict=True)
        return np.vstack([points @ to[:3, :3].T + to[:3, 3] for (_, points, _), to in pieces])

    def _highest(self, height: float, sensor: Floats, world: World, circles: Floats, edges: Floats) -> float:
        """Sine of the elevation above which a beam leaves the heights that count before it can hit anything."""
        poses, point = np.array([[sensor[0, 3], sensor[1, 3], 0.0]]), (0.0, 0.0, 0.0)
        gap, _ = sweep(poses, point, *nearby(world, poses, point, circles, edges))
        noise = MOST_NOISE * self._lidar.noise_std
        # Rays that are between the heights for less than CLEARED tell nothing either.
        reach = _TILTED_SHARE * min(gap, CLEARED) - noise
        if reach <= 0.0:
            return 1.0
        return math.sin(math.atan2(max(self._cloud.max_height - height, 0.0) + noise, reach))
