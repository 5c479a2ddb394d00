"""A costmap that moves with the robot, like move_base's local costmap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.geometry.frames import compose
from lme.grids.obstacle_grid import Grid, Hits, inflate, lattice, observe
from lme.grids.outline import free_covered, outline_capacity, outline_cost
from lme.mapping.inflation import inflation_stamp
from lme.mapping.map_clock import MapClock, MapInput
from lme.robots import Robot
from lme.types import Observation, Pose


@dataclass(slots=True)
class LocalCostmapConfig:
    """Size of the grid, marking and clearing by scans, and inflation of obstacles."""

    cell_size: float
    size: float
    obstacle_range: float
    raytrace_range: float
    footprint_padding: float
    inflation_radius: float
    cost_scaling_factor: float
    update_rate: float | None

    def __post_init__(self) -> None:
        for key in ("cell_size", "obstacle_range", "raytrace_range"):
            require(key, getattr(self, key), above=0.0)
        for key in ("footprint_padding", "inflation_radius", "cost_scaling_factor"):
            require(key, getattr(self, key), at_least=0.0)
        if self.update_rate is not None:
            require("update_rate", self.update_rate, above=0.0)
        require("size", self.size, above=0.0, at_most=1000.0 * self.cell_size)
        require("inflation_radius", self.inflation_radius, at_most=self.size)


class LocalCostmap:
    """Obstacles near the robot in the odometry frame (Lu, Hershberger & Smart 2014, DOI 10.1109/IROS.2014.6942636).

    Obstacle layer and inflation layer as in ROS costmap_2d with observation_persistence 0, inf_is_valid false and
    footprint_clearing_enabled true: a cell is free as soon as a beam passes it or the padded footprint covers it,
    and a beam without a return says nothing. costs: (I, J) uint8; only occupied cells are `TOUCHING`.
    """

    def __init__(self, config: LocalCostmapConfig, robot: Robot) -> None:
        self._config = config
        self._lidar = robot.lidar.mount
        self._half = round(config.size / config.cell_size / 2.0)  # [cells]
        self.outline = robot.footprint.outline(config.footprint_padding)
        inscribed = robot.footprint.inscribed_radius + config.footprint_padding
        self._stamp = inflation_stamp(
            config.cell_size, 0.0, inscribed, config.inflation_radius, config.cost_scaling_factor
        )
        self._cells = np.empty(outline_capacity(self.outline, config.cell_size), dtype=np.int64)
        self._clock = MapClock(config.update_rate, robot.dt)
        self._clear()

    def reset(self, rng: np.random.Generator) -> None:
        """Forget all obstacles, and draw the phase of the map's clock."""
        self._clock.reset(rng)
        self._clear()

    def _clear(self) -> None:
        side = 2 * self._half + 1
        self.grid: Grid = (-self._half, -self._half, self._config.cell_size)
        self.costs = np.zeros((side, side), dtype=np.uint8)
        self._hits = np.zeros((side, side), dtype=np.int32)
        self._scans = 0

    def update(self, observation: Observation) -> None:
        """Move the map to the robot and take in the scan, if the map is due."""
        map_input = self._clock.due(observation)
        if map_input is not None:
            self._rebuild(map_input)

    def _rebuild(self, map_input: MapInput) -> None:
        scan, pose, config = map_input.scan, map_input.pose, self._config
        self._follow(pose)
        self._scans += 1
        observe(
            self._hits,
            self.costs,
            self.grid,
            self._stamp,
            self._scans,
            0,
            compose(map_input.scan_pose, self._lidar),
            scan.ranges,
            (scan.angle_min, scan.angle_increment),
            (scan.range_min, scan.range_max, config.obstacle_range, config.raytrace_range),
            False,
        )
        free_covered(self._hits, self.outline, pose, self.grid)
        inflate(self._hits, self._stamp, self.costs)

    def outline_cost(self, pose: Pose) -> int:
        """Highest cost under the outline at a pose; -1 if it touches an obstacle."""
        return outline_cost(self.costs, self.outline, pose, self.grid, self._cells)

    def _follow(self, pose: Pose) -> None:
        """Move the map by whole cells, so that the robot is in its middle."""
        cell = self._config.cell_size
        low_i, low_j = lattice(pose.x / cell) - self._half, lattice(pose.y / cell) - self._half
        self._hits = _shifted(self._hits, low_i - self.grid[0], low_j - self.grid[1])
        self.grid = (low_i, low_j, cell)


def _shifted(hits: Hits, di: int, dj: int) -> Hits:
    """Return the map after its corner has moved by (di, dj) cells; new cells are free."""
    if di == 0 and dj == 0:
        return hits
    shifted = np.zeros_like(hits)
    (to_i, from_i), (to_j, from_j) = _overlap(di, hits.shape[0]), _overlap(dj, hits.shape[1])
    shifted[to_i, to_j] = hits[from_i, from_j]
    return shifted


def _overlap(shift: int, length: int) -> tuple[slice, slice]:
    """Part of an axis that stays on the map after a shift: its new and its old indices."""
    overlap = max(length - abs(shift), 0)
    new, old = max(-shift, 0), max(shift, 0)
    return slice(new, new + overlap), slice(old, old + overlap)
