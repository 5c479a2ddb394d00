"""Costmaps in the odometry frame, like those of ROS costmap_2d: a global one, and one that moves with the robot.

They have the obstacle layer and the inflation layer with their parameters and defaults: Lu, Hershberger & Smart 2014,
"Layered costmaps for context-sensitive navigation", DOI 10.1109/IROS.2014.6942636, and wiki.ros.org/costmap_2d.
Unknown space is free.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lme.errors import argument_error, require
from lme.geometry.frames import compose, to_robot
from lme.grids.obstacle_grid import (
    HIGHEST,
    INSCRIBED,
    TOUCHING,
    Grid,
    Hits,
    draw_discs,
    draw_edges,
    draw_polygon,
    forbidden,
    free_covered,
    inflate,
    lattice,
    observe,
    outline_capacity,
    outline_cost,
)
from lme.mapping.map_clock import MapClock, MapInput
from lme.robots import Robot
from lme.types import Bools, Floats, Ints, Observation, Pose
from lme.worlds.world import World

Cell = tuple[int, int]

_MOST_CELLS = 20_000_000
_WIDEST_STAMP = 200  # [cells] greatest radius of inflation


@dataclass(slots=True)
class LayersConfig:
    """Cells, marking and clearing by scans, inflation of obstacles, and rate: what all costmaps have."""

    cell_size: float
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


@dataclass(slots=True)
class CostmapConfig(LayersConfig):
    """Extent of the grid, and how its obstacles are cleared."""

    margin: float
    observation_persistence: float
    inf_is_valid: bool
    footprint_clearing: bool

    def __post_init__(self) -> None:
        LayersConfig.__post_init__(self)  # super() fails in a dataclass with slots
        require("margin", self.margin, at_least=0.0)
        require("observation_persistence", self.observation_persistence, at_least=0.0)


class Costmap:
    """Seen or known obstacles around a start at the origin.

    costs: (I, J) uint8; `TOUCHING` and `INSCRIBED` forbid a cell, costs up to `HIGHEST` do not.
    """

    def __init__(self, config: CostmapConfig, robot: Robot, positions: Floats) -> None:
        """positions: (N, 2) the goal, and whatever else must be on the grid [m]."""
        self._config = config
        self._lidar = robot.lidar.mount
        rate = min(config.update_rate or robot.control_rate, robot.control_rate)
        self._keep = round(config.observation_persistence * rate)  # [scans]
        self._grid, size = _layout(config, positions)
        self._stamp = stamp(config, robot.footprint.inscribed_radius)
        self._is_current = True  # whether the costs are those of the current obstacles
        self._outline = robot.footprint.outline(config.footprint_padding)
        reach = np.hypot(*(self._outline - np.array(self._lidar[:2])).T).max()
        self._radius = config.obstacle_range + float(reach) + config.cell_size  # [m] that a scan changes
        self._hits = np.zeros(size, dtype=np.int32)
        self.costs = np.zeros(size, dtype=np.uint8)
        self._low = self._high = np.array(self.cell(np.zeros(2)))  # of the box around all obstacles so far
        self._reach = 0  # [cells] of the widest stamp so far
        self._scans = 0

    @property
    def stamp(self) -> Ints:
        """Costs around an occupied cell, see `stamp`; a new one holds from the next scan or `refresh` on."""
        return self._stamp

    @stamp.setter
    def stamp(self, rows: Ints) -> None:
        self._is_current = self._is_current and rows is self._stamp
        self._stamp = rows

    def observe(self, taken: MapInput) -> None:
        """Mark the cells that the scan hits and clear those it passes; see `lme.grids.obstacle_grid.observe`."""
        scan, config = taken.scan, self._config
        lidar = compose(taken.scan_pose, self._lidar)
        self._extend([self.cell(np.array(lidar[:2]) + side) for side in (-self._radius, self._radius)])
        self._scans += 1
        # Costs of new hits are raised at once. Only where a hit is cleared do they have to be recomputed.
        has_cleared = observe(
            self._hits,
            self.costs,
            self._grid,
            self._stamp,
            self._scans,
            self._keep,
            lidar,
            scan.ranges,
            (scan.angle_min, scan.angle_increment),
            (scan.range_min, scan.range_max, config.obstacle_range, config.raytrace_range),
            config.inf_is_valid,
        )
        if config.footprint_clearing:
            window = self.window([])
            low = (self._grid[0] + window[0].start, self._grid[1] + window[1].start, self._grid[2])
            has_cleared |= free_covered(self._hits[window], self._outline, taken.pose, low)
        self._is_current = self._is_current and not has_cleared

    def draw(self, world: World, start: Pose) -> None:
        """Mark the cells of the world's obstacles; `start`: pose of the odometry frame in the world."""
        circles = np.column_stack([to_robot(world.circles[:, :2], start), world.circles[:, 2]])
        ends = to_robot(world.edges.reshape(-1, 2, 2), start)
        draw_discs(self._hits, self._grid, circles)
        draw_edges(self._hits, self._grid, ends.reshape(-1, 4))
        for polygon in world.polygons:
            draw_polygon(self._hits, self._grid, to_robot(polygon, start))
        self._extend(np.argwhere(self._hits))
        self._is_current = False

    def refresh(self) -> None:
        """Recompute the costs from the current obstacles, if they are not those already."""
        if not self._is_current:
            window = self.window([])
            inflate(self._hits[window], self._stamp, self.costs[window])
            self._is_current = True

    def window(self, cells: Sequence[Cell]) -> tuple[slice, slice]:
        """Part of the grid with these cells, all obstacles and their costs, and one free cell around these.

        No cheapest path between the cells leaves it: pulled back to its edge, a path is no longer and costs no more.
        """
        self._reach = max(self._reach, int(self._stamp[:, :2].max()))
        corners = *cells, (self._low - self._reach - 1).tolist(), (self._high + self._reach + 1).tolist()
        rows, columns = (
            slice(max(min(ends), 0), min(max(ends) + 1, size))
            for ends, size in zip(zip(*corners, strict=True), self.costs.shape, strict=True)
        )
        return rows, columns

    def cell(self, point: Floats) -> Cell:
        """Array index of the cell that contains a point (2,) [m], or of the nearest cell of the grid."""
        low_i, low_j, cell_size = self._grid
        i, j = lattice(point[0] / cell_size) - low_i, lattice(point[1] / cell_size) - low_j
        return min(max(i, 0), self.costs.shape[0] - 1), min(max(j, 0), self.costs.shape[1] - 1)

    def points(self, cells: Ints) -> Floats:
        """Centres (..., 2) [m] of the cells (..., 2)."""
        return np.asarray((cells + np.array(self._grid[:2])) * self._grid[2], dtype=np.float64)

    def forbidden(self, points: Floats) -> Bools:
        """Return whether each of the points (K, 2) [m] lies in a forbidden cell: (K,). False outside the grid."""
        return np.asarray(forbidden(self.costs, self._grid, points), dtype=np.bool_)

    def _extend(self, cells: Sequence[Cell] | Ints) -> None:
        """Extend the box around all obstacles to hold the cells (N, 2)."""
        ends = np.vstack([self._low, self._high, cells])
        self._low, self._high = ends.min(axis=0), ends.max(axis=0)


def stamp(config: CostmapConfig, r_min: float) -> Ints:
    """Costs around one occupied cell, (K, 3) rows (di, dj, cost), for a footprint of inner radius r_min [m].

    Cells are forbidden up to the padded inner radius. Raises InputError if the stamp is too wide.
    """
    inscribed = r_min + config.footprint_padding
    reach = max(inscribed, config.inflation_radius)
    if reach > _WIDEST_STAMP * config.cell_size:
        key = "footprint_padding" if inscribed > config.inflation_radius else "inflation_radius"
        raise argument_error(
            f"costmap.{key} is {getattr(config, key):g}: obstacles would raise costs up to {reach:g} m: "
            f"must be at most {_WIDEST_STAMP} cells, {_WIDEST_STAMP * config.cell_size:g} m"
        )
    return inflation_stamp(
        config.cell_size, r_min, inscribed, config.inflation_radius, config.cost_scaling_factor
    )


def inflation_stamp(
    cell_size: float, touching: float, inscribed: float, inflation_radius: float, cost_scaling_factor: float
) -> Ints:
    """Costs around one occupied cell: (K, 3) rows (di, dj, cost).

    Costs are `TOUCHING` up to a distance of `touching` [m] and `INSCRIBED` up to `inscribed` [m]. From there to the
    inflation radius [m] they are HIGHEST · exp(−cost_scaling_factor · (distance − inscribed)).
    """
    reach = max(inscribed, inflation_radius)
    cells = math.floor(reach / cell_size + 1e-9)
    di, dj = np.mgrid[-cells : cells + 1, -cells : cells + 1]
    distance = np.hypot(di, dj) * cell_size - 1e-9
    fading = np.floor(HIGHEST * np.exp(-cost_scaling_factor * np.maximum(distance - inscribed, 0.0)))
    cost = np.where(distance <= touching, TOUCHING, np.where(distance <= inscribed, INSCRIBED, fading))
    rows = np.column_stack([di.ravel(), dj.ravel(), cost.astype(np.int64).ravel()])
    return np.ascontiguousarray(rows[(distance.ravel() <= reach) & (rows[:, 2] > 0)])


def ends_of(world: World, start: Pose) -> Floats:
    """Points (N, 2) in the odometry frame between which all obstacles lie [m]; `start` as in `Costmap.draw`."""
    middles, radii = to_robot(world.circles[:, :2], start), world.circles[:, 2:]
    return np.vstack([to_robot(world.edges.reshape(-1, 2), start), middles - radii, middles + radii])


def _layout(config: CostmapConfig, positions: Floats) -> tuple[Grid, tuple[int, int]]:
    """Grid around the origin and the positions (N, 2), and its shape (I, J)."""
    ends = np.vstack([np.zeros(2), positions])
    below, above = np.ceil(
        (config.margin + np.array([-ends.min(axis=0), ends.max(axis=0)])) / config.cell_size
    )
    size = [int(cells) + 1 for cells in below + above]
    cells = size[0] * size[1]
    if cells > _MOST_CELLS:
        # A side has up to three cells more than its length has: the ends are rounded outwards.
        finest = math.ceil(1000 * config.cell_size * math.sqrt(cells) / (math.sqrt(_MOST_CELLS) - 3)) / 1000
        raise argument_error(
            f"costmap.cell_size is {config.cell_size:g}: the global map with a margin of {config.margin:g} m "
            f"has {cells:,} cells: must have at most {_MOST_CELLS:,}, so cells of at least {finest:g} m, or a smaller "
            "margin"
        )
    return (-int(below[0]), -int(below[1]), config.cell_size), (size[0], size[1])


@dataclass(slots=True)
class LocalCostmapConfig(LayersConfig):
    """Size of the grid."""

    size: float

    def __post_init__(self) -> None:
        LayersConfig.__post_init__(self)  # super() fails in a dataclass with slots
        require("size", self.size, above=0.0, at_most=1000.0 * self.cell_size)
        require("inflation_radius", self.inflation_radius, at_most=self.size)


class LocalCostmap:
    """Obstacles near the robot.

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

    def forget(self) -> None:
        """Forget all obstacles until the next update, as resetLayers of costmap_2d."""
        self.costs[:] = 0
        self._hits[:] = 0

    def _clear(self) -> None:
        side = 2 * self._half + 1
        self.grid: Grid = (-self._half, -self._half, self._config.cell_size)
        self.costs = np.zeros((side, side), dtype=np.uint8)
        self._hits = np.zeros((side, side), dtype=np.int32)
        self._scans = 0

    def update(self, observation: Observation) -> None:
        """Move the map to the robot and take in the scan, if the map is due."""
        map_input = self._clock.due(observation)
        if map_input is None:
            return
        # Move the map by whole cells, so that the robot is in its middle.
        scan, pose, config = map_input.scan, map_input.pose, self._config
        cell = config.cell_size
        low_i, low_j = lattice(pose.x / cell) - self._half, lattice(pose.y / cell) - self._half
        self._hits = _shifted(self._hits, low_i - self.grid[0], low_j - self.grid[1])
        self.grid = (low_i, low_j, cell)
        # Take in the scan; nothing is where the robot is.
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


def _shifted(hits: Hits, di: int, dj: int) -> Hits:
    """Return the map after its corner has moved by (di, dj) cells; new cells are free."""
    if di == 0 and dj == 0:
        return hits
    rows, columns = hits.shape
    di, dj = min(max(di, -rows), rows), min(max(dj, -columns), columns)
    padded = np.pad(hits, ((max(-di, 0), max(di, 0)), (max(-dj, 0), max(dj, 0))))
    return np.ascontiguousarray(padded[max(di, 0) :, max(dj, 0) :][:rows, :columns])
