"""A simulated Livox Mid-360: point clouds of a solid-state 3D lidar in a world with heights.

A cloud is taken at one instant; the robot's motion distorts a real one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError, require
from lme.grids.edge_grid import NO_EDGES, EdgeGrid
from lme.perception.point_cloud import Projection, rigid_transform, to_scan, without_unmeasured
from lme.robots import Lidar
from lme.simulation.mid360.cloud_scan import cloud_scan
from lme.simulation.mid360.pattern import beam_noise, beam_pattern, beam_table
from lme.simulation.mid360.raycast3d import cast_rays
from lme.types import Floats, Pose
from lme.worlds.world import World

Cloud = NDArray[np.float32]
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, slots=True)
class ExtrudedWorld:
    """A world with upright obstacles of given heights, a ground and a ceiling.

    circles (C, 2), segments (S, 2), polygons (P, 2): [bottom, top] of each obstacle of the world, or one such
    pair for all of a kind [m]; top may be inf. ground, ceiling: their heights [m], −inf and inf for none.
    Movers are not included; add them to the circles and polygons of the world if the lidar should see them.
    Raises InputError for heights of another shape, NaN, or a bottom above its top.
    """

    world: World
    circles: ArrayLike = (0.0, math.inf)
    segments: ArrayLike = (0.0, math.inf)
    polygons: ArrayLike = (0.0, math.inf)
    ground: float = 0.0
    ceiling: float = math.inf

    def __post_init__(self) -> None:
        for kind in ("circles", "segments", "polygons"):
            heights = _heights(kind, getattr(self, kind), len(getattr(self.world, kind)))
            object.__setattr__(self, kind, heights)
        if not self.ground < self.ceiling:
            raise InputError(f"ceiling is {self.ceiling:g} m: must be above the ground, {self.ground:g} m")

    def obstacles(self) -> tuple[Floats, Floats, Floats]:
        """Circles (C, 5), edges (E, 6) and solids (P, 4) for `lme.simulation.mid360.raycast3d.cast_rays`."""
        world, sides = self.world, [len(polygon) for polygon in self.world.polygons]
        polygons = np.asarray(self.polygons)
        stops = len(world.segments) + np.cumsum(sides, dtype=np.int64)
        edge_heights = np.vstack([np.asarray(self.segments), np.repeat(polygons, sides, axis=0)])
        circles = np.hstack([world.circles, np.asarray(self.circles)])
        return (
            circles,
            np.hstack([world.edges, edge_heights]),
            np.column_stack([stops - sides, stops, polygons]),
        )


@dataclass(slots=True)
class Mid360Config:
    """Properties of the sensor and its mount. Source: Livox Mid-360 User Manual, v1.0 (2023)."""

    mount: list[float]  # x, y, z [m], roll, pitch, yaw [rad] in the base frame, whose origin is on the ground
    point_rate: float = 200_000.0  # [points/s]
    elevation_min: float = math.radians(-7.0)  # [rad]
    elevation_max: float = math.radians(52.0)  # [rad]
    range_min: float = 0.1  # [m] blind zone
    range_max: float = 40.0  # [m] at 10 % reflectivity; 70 m at 80 %
    noise_std: float = 0.02  # [m] along the beam, 1 σ at 10 m

    def __post_init__(self) -> None:
        rigid_transform(self.mount)
        require("mid360.point_rate", self.point_rate, above=0.0)
        require("mid360.elevation_min", self.elevation_min, at_least=-math.pi / 2)
        require("mid360.elevation_max", self.elevation_max, above=self.elevation_min, at_most=math.pi / 2)
        require("mid360.range_min", self.range_min, at_least=0.0)
        require("mid360.range_max", self.range_max, above=self.range_min)
        require("mid360.noise_std", self.noise_std, at_least=0.0)


class Mid360:
    """A lidar whose scan pattern never repeats and covers the field of view ever more densely.

    ASSUMED: Livox does not publish the pattern; this one fills azimuth and elevation evenly. The noise at
    every range is the manual's value for 10 m. It belongs to the beam, so `cloud` and `scan` have the same noise.
    """

    Config = Mid360Config

    def __init__(self, config: Mid360Config) -> None:
        self._config = config
        self._mount = rigid_transform(config.mount)

    def reset(self, rng: np.random.Generator) -> None:
        """Start the pattern at a random beam, with new noise."""
        self._phase = tuple(rng.random(2).tolist())
        self._seed = int(rng.integers(2**63))
        self._fired = 0

    def cloud(self, extruded: ExtrudedWorld, pose: Pose, duration: float) -> Cloud:
        """Returns of the next `duration` [s] of the pattern: (N, 3) [m] in the sensor's frame.

        pose: of the base in the world. A beam that hits nothing, or hits within the blind zone, gives no point.
        """
        planes = (float(extruded.ground), float(extruded.ceiling))
        points = self.returns(self._above(pose), duration, *extruded.obstacles(), planes)
        return points.astype(np.float32)

    def returns(
        self,
        sensor: Floats,
        duration: float,
        circles: Floats,
        edges: Floats,
        solids: Floats,
        planes: tuple[float, float],
        up: Floats = _UP,
        highest: float = 1.0,
    ) -> Floats:
        """Returns of the next `duration` [s] of the pattern for any pose of the sensor: (N, 3) [m] in its frame.

        sensor: (4, 4) from its frame to the world. circles, edges, solids, planes: see
        `lme.simulation.mid360.raycast3d.cast_rays`. Beams whose direction has a part along the unit vector `up`, in the
        sensor's frame, that is greater than `highest` are left out.
        """
        config = self._config
        first, number = self._fire(duration)
        beams = beam_pattern(first, number, self._phase, (config.elevation_min, config.elevation_max))
        noise = config.noise_std * beam_noise(first, number, self._seed)
        if highest < 1.0:
            is_cast = up[0] * beams[:, 0] + up[1] * beams[:, 1] + up[2] * beams[:, 2] <= highest
            beams, noise = beams[is_cast], noise[is_cast]
        # Exact distances of the beams, rotated into the world; then noise, and the limits of the range.
        directions = np.ascontiguousarray(beams @ sensor[:3, :3].T)
        origin = np.ascontiguousarray(sensor[:3, 3])
        distances = cast_rays(origin, directions, circles, edges, solids, planes, config.range_max) + noise
        is_return = (distances >= config.range_min) & (distances < math.inf)
        points: Floats = beams[is_return] * distances[is_return, None]
        return points

    def upright_returns(
        self,
        sensor: Floats,
        duration: float,
        circles: Floats,
        edges: Floats,
        up: Floats = _UP,
        highest: float = 1.0,
    ) -> Floats:
        """`returns` among circles (C, 3) and edges (E, 4) that reach from the floor to above every beam."""
        solids, planes = np.empty((0, 4)), (0.0, math.inf)
        return self.returns(sensor, duration, _upright(circles), _upright(edges), solids, planes, up, highest)

    def scan(
        self, lidar: Lidar, pose: Pose, circles: Floats, edges: Floats, grid: EdgeGrid = NO_EDGES
    ) -> NDArray[np.float32]:
        """Project the next cloud to the scan of `lidar`, which has a `cloud`: (num_beams,) [m].

        pose: of the base. The result equals that of `cloud` and `lme.perception.point_cloud.to_scan` if the obstacles,
        circles (C, 3), edges (E, 4) and those of a grid, reach from the ground to above the highest points that count.
        Inf means no return, and NaN that nothing is known: only where the sensor is not above the base.
        """
        config, cloud = self._config, lidar.cloud
        assert cloud is not None
        if any(lidar.sensor):
            return self._projected(lidar, cloud.duration, pose, circles, np.concatenate((edges, grid.edges)))
        # A sensor above the base needs no cloud.
        first, number = self._fire(cloud.duration)
        table = beam_table(number)
        elevations = (config.elevation_min, config.elevation_max)
        ranges: NDArray[np.float32] = cloud_scan(
            (*pose,),
            (first, number, *self._phase),
            (table.starts, table.order),
            (self._seed, config.noise_std),
            (cloud.height, *elevations, config.range_min, config.range_max),
            (cloud.min_height, cloud.max_height),
            (lidar.range_min, lidar.range_max),
            lidar.num_beams,
            circles,
            edges,
            (grid.frame, grid.starts, grid.edges),
        )
        return ranges

    def _projected(
        self, lidar: Lidar, duration: float, pose: Pose, circles: Floats, edges: Floats
    ) -> NDArray[np.float32]:
        """Project the next cloud of upright obstacles to what the base sees of it: (num_beams,) [m].

        NaN means that nothing is known, for instance in the shadow of an obstacle beside the sensor.
        """
        projection, to_base = projection_of(lidar), half_bin_turn(lidar) @ self._mount
        points = self.upright_returns(self._above(pose), duration, circles, edges)
        points = points @ to_base[:3, :3].T + to_base[:3, 3]
        return without_unmeasured(to_scan(points, projection), points, to_base[:3, 3], projection).ranges

    def _above(self, pose: Pose) -> Floats:
        """Transform (4, 4) from the sensor's frame to the world, for a base at this pose."""
        return rigid_transform([pose[0], pose[1], 0.0, 0.0, 0.0, pose[2]]) @ self._mount

    def _fire(self, duration: float) -> tuple[int, int]:
        """Advance the pattern by `duration` [s]; return the first of its beams in that time, and their number."""
        first, number = self._fired, round(self._config.point_rate * duration)
        self._fired += number
        return first, number


def mid360_of(lidar: Lidar) -> Mid360:
    """Return the sensor whose cloud makes the scans of a lidar with a `cloud`."""
    assert lidar.cloud is not None
    mount = [*lidar.sensor[:2], lidar.cloud.height, 0.0, 0.0, 0.0]
    return Mid360(Mid360Config(mount=mount, noise_std=lidar.noise_std))


def projection_of(lidar: Lidar) -> Projection:
    """Return the selection and binning by which a cloud becomes the scan of a lidar with a `cloud`."""
    cloud = lidar.cloud
    assert cloud is not None
    return Projection(
        min_height=cloud.min_height,
        max_height=cloud.max_height,
        angle_increment=lidar.angle_increment,
        range_min=lidar.range_min,
        range_max=lidar.range_max,
    )


def half_bin_turn(lidar: Lidar) -> Floats:
    """Return the turn (4, 4) after which the beams of a scan are the middles of the bins of its projection."""
    return rigid_transform([0.0, 0.0, 0.0, 0.0, 0.0, lidar.angle_increment / 2])


def _upright(shapes: Floats) -> Floats:
    """Return circles or edges with their heights, from the floor up to above every beam, in two more columns."""
    return np.column_stack((shapes, np.zeros(len(shapes)), np.full(len(shapes), math.inf)))


def _heights(kind: str, values: ArrayLike, count: int) -> Floats:
    """Bottoms and tops: (count, 2) [m]."""
    heights = np.asarray(values, dtype=np.float64)
    if heights.shape == (2,):
        heights = np.tile(heights, (count, 1))
    if heights.shape != (count, 2) or not (heights[:, 0] <= heights[:, 1]).all():
        raise InputError(
            f"heights of {kind} are {heights.tolist()}: must be one pair [bottom, top] [m] or {count} of them, "
            "no bottom above its top"
        )
    return heights
