"""Ray casting of lidar beams against discs and line segments, and the noise of their ranges.

`lme.perception.leaf_scan` has the arithmetic.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from lme.errors import InputError
from lme.geometry.frames import compose
from lme.grids.edge_grid import EdgeGrid, first_hit
from lme.grids.lattice import NO_LATTICE, Lattice, cast_lattice
from lme.grids.leaves import Leaves
from lme.perception.leaf_scan import scan_discs, scan_edges, scan_shapes
from lme.perception.scan_points import beam_directions
from lme.robots import Lidar
from lme.types import Floats, LaserScan, Pose


def cast(lidar: Lidar, pose: Pose, circles: ArrayLike = (), segments: ArrayLike = ()) -> LaserScan:
    """Return the scan, without noise, of a planar lidar on a robot at `pose`.

    pose: of the robot in the world. circles: (C, 3) solid discs [x, y, radius] [m]. segments: (S, 4) thin walls
    [x0, y0, x1, y1] [m], in the world. Inside a disc all ranges are 0. Raises InputError for other shapes, numbers that
    are not finite, and a radius below 0.
    """
    if not all(map(math.isfinite, pose)):
        raise InputError(f"pose is {tuple(pose)}: must be x [m], y [m] and yaw [rad], all finite")
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    lidar_pose = compose(pose, lidar.mount)
    discs, walls = _rows("circles", circles, 3), _rows("segments", segments, 4)
    if (discs[:, 2] < 0.0).any():
        raise InputError(
            f"circles holds {discs[discs[:, 2].argmin()].tolist()}: must have a radius of at least 0 m"
        )
    ranges = cast_shapes(lidar_pose, angles, lidar.range_max, discs, walls)
    return LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)


def _rows(name: str, values: ArrayLike, columns: int) -> Floats:
    rows = np.ascontiguousarray(values, dtype=np.float64)
    if rows.size and (rows.ndim != 2 or rows.shape[1] != columns):
        raise InputError(f"{name} has shape {rows.shape}: must be rows of {columns} numbers")
    rows = rows.reshape(-1, columns)
    is_finite = np.isfinite(rows).all(axis=1)
    if not is_finite.all():
        raise InputError(f"{name} holds {rows[is_finite.argmin()].tolist()}: must be finite numbers [m]")
    return rows


def cast_shapes(
    lidar_pose: Pose,
    angles: tuple[float, float, int],
    range_max: float,
    circles: Floats,
    edges: Floats,
) -> NDArray[np.float32]:
    """Distance along each beam to the first obstacle, or range_max if none is nearer: (B,) [m].

    lidar_pose: in the world; angles: (angle_min, angle_increment, num_beams), with a positive increment and at
    most two turns; circles (C, 3) solid [x, y, r]; edges (E, 4) thin [x0, y0, x1, y1]. Inside a disc all ranges
    are 0. A beam does not hit an edge that it runs along.
    """
    x, y, yaw = lidar_pose
    angle_min, increment, num_beams = angles
    table = beam_table(increment, num_beams)
    ranges: NDArray[np.float32] = _cast_shapes(
        float(x), float(y), yaw + angle_min, increment, float(range_max), table, circles, edges
    )
    return ranges


def cast_leaves(
    lidar_pose: Pose, angles: tuple[float, float, int], range_max: float, discs: Leaves, edges: Leaves
) -> NDArray[np.float32]:
    """Distance along each beam to the first disc or edge of the leaves: (B,) [m].

    The result is that of `cast_shapes`, which describes the parameters, for all shapes in the leaves.
    """
    x, y, yaw = lidar_pose
    angle_min, increment, num_beams = angles
    start = (
        float(x),
        float(y),
        yaw + angle_min,
        increment,
        float(range_max),
        beam_table(increment, num_beams),
    )
    ranges: NDArray[np.float32] = _cast_leaves(*start, *discs, *edges)
    return ranges


def cast_grid(
    lidar_pose: Pose,
    angles: tuple[float, float, int],
    range_max: float,
    grid: EdgeGrid,
    lattice: Lattice = NO_LATTICE,
) -> NDArray[np.float32]:
    """Distance along each beam to the first edge of a grid, or range_max if none is nearer: (B,) [m].

    The result is that of `cast_shapes`, which describes the parameters, for all edges of the grid. A lattice of the
    same edges makes it faster.
    """
    x, y, yaw = lidar_pose
    angle_min, increment, num_beams = angles
    start = (float(x), float(y), yaw + angle_min, float(range_max), beam_table(increment, num_beams))
    ranges: NDArray[np.float32]
    ranges = cast_lattice(*start, *grid, *lattice) if len(lattice.edges) else _cast_grid(*start, *grid)
    return ranges


@lru_cache(maxsize=16)
def beam_table(angle_increment: float, num_beams: int) -> Floats:
    """Cosines and sines of the beams relative to the first one: (2, B)."""
    return np.ascontiguousarray(beam_directions(0.0, angle_increment, num_beams).T)


@njit(cache=True, error_model="numpy")
def _cast_shapes(x, y, heading, increment, range_max, table, circles, edges):
    """Return the result of `cast_shapes`. heading: of the first beam in the world [rad]; table: `beam_table`."""
    ranges = np.full(table.shape[1], np.float32(range_max))
    scan_shapes(
        (x, y, math.cos(heading), math.sin(heading)), increment, range_max, table, circles, edges, ranges
    )
    return ranges


@njit(cache=True, error_model="numpy")
def _cast_leaves(x, y, heading, increment, range_max, table, disc_bounds, discs, edge_bounds, edges):
    """Return the result of `cast_leaves`."""
    ranges = np.empty(table.shape[1], np.float32)
    leaves = disc_bounds, discs, 0, len(discs), edge_bounds, edges, 0, len(edges)
    scan_leaves(x, y, heading, increment, range_max, table, leaves, ranges)
    return ranges


@njit(cache=True, error_model="numpy")
def scan_leaves(x, y, heading, increment, range_max, table, leaves, ranges):
    """Write the ranges (B,) float32. heading: of the first beam in the world [rad]; table: `beam_table`.

    leaves: bounds and shapes of discs, the first leaf and the last + 1, and the same of edges. It works in the lidar's
    frame, rotated so that the first beam is along +x.
    """
    disc_bounds, discs, first_disc, stop_disc, edge_bounds, edges, first_edge, stop_edge = leaves
    frame = (x, y, math.cos(heading), math.sin(heading))
    ranges[:] = np.float32(range_max)
    if scan_discs(frame, increment, range_max, table, disc_bounds, discs, first_disc, stop_disc, ranges):
        ranges[:] = np.float32(0.0)
    elif stop_edge > first_edge:
        scan_edges(frame, increment, range_max, table, edge_bounds, edges, first_edge, stop_edge, ranges)


@njit(cache=True, error_model="numpy")
def _cast_grid(x, y, heading, range_max, table, frame, starts, edges):
    """Return the result of `cast_grid` without a lattice. heading: of the first beam in the world [rad]."""
    ranges = np.empty(table.shape[1], np.float32)
    turn = (math.cos(heading), math.sin(heading))
    for i in range(len(ranges)):
        ranges[i] = first_hit(x, y, turn, (table[0, i], table[1, i]), range_max, frame, starts, edges)
    return ranges


@njit(cache=True)
def add_noise(ranges: NDArray[np.float32], noise: NDArray[np.float32], std: float, range_max: float) -> None:
    """Add Gaussian noise to every return, in place; beams without a return stay at range_max.

    ranges (B,) [m]; noise (B,) standard normal; std, range_max [m].
    """
    for i in range(len(ranges)):
        if ranges[i] < np.float32(range_max):
            ranges[i] = min(max(ranges[i] + std * noise[i], 0.0), range_max)
