"""An occupancy grid of hits and misses, and the map that it gives for a robot that drove in it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from lme.errors import InputError
from lme.types import Bools, Floats, Ints, LaserScan, Pose

FREE, OCCUPIED, UNKNOWN = 254, 0, 205  # as map_saver of ROS writes them
MAX_CELLS = 60_000_000  # of the grid while scans are added: 387 × 387 m with cells of 5 cm
MIN_HITS = 2  # of an occupied cell
HIT_SHARE = 0.12  # of the beams that reach an occupied cell, at least, end in it
JUMP_M = 2.0  # between two poses: the robot did not drive straight from one to the other
_GROWTH_M = 20.0  # by which the grid grows at least, so that it is copied rarely
_RIM_M = 0.25  # around the free space


@njit(cache=True, error_model="numpy")
def trace_beams(hits, misses, ranges, angles, limits, clears_far, pose, resolution):
    """Count the cells that the beams of a scan pass and hit.

    hits, misses (rows, columns) int32: changed in place; they must hold every cell within limits[1] of the lidar.
    ranges (num_beams,) float32 [m]; angles (first, increment) [rad] in the frame of `pose`; limits (nearest valid
    range, farthest range that counts, range without a return) [m]; pose: x [cells], y [cells], yaw [rad].
    A beam that ends beyond limits[1] passes everything up to there; one without a return does so if `clears_far`.
    """
    x0, y0 = pose[0], pose[1]
    nearest, farthest, no_return = limits[0], limits[1], limits[2]
    for i in range(len(ranges)):
        length = float(ranges[i])
        if not (length > 0.0 and length >= nearest):  # also for nan
            continue
        if length >= no_return and not clears_far:
            continue
        is_hit = length <= farthest and length < no_return
        # End of the beam, or of the part of it that counts.
        length = min(length, farthest) / resolution
        bearing = pose[2] + angles[0] + i * angles[1]
        x1, y1 = x0 + length * math.cos(bearing), y0 + length * math.sin(bearing)
        # The cells before the last one are passed; the last one is hit or passed.
        row, column = _pass(misses, x0, y0, x1, y1)
        if is_hit:
            hits[row, column] += 1
        else:
            misses[row, column] += 1


@njit(cache=True, error_model="numpy")
def _pass(misses, x0, y0, x1, y1):
    """Add 1 to every cell from (x0, y0) to just before the cell of (x1, y1); return that cell's row and column.

    Amanatides and Woo, "A fast voxel traversal algorithm for ray tracing", 1987.
    """
    column, row = math.floor(x0), math.floor(y0)
    end_column, end_row = math.floor(x1), math.floor(y1)
    dx, dy = x1 - x0, y1 - y0
    right, up = 1 if dx > 0.0 else -1, 1 if dy > 0.0 else -1
    # Shares of the beam from border to border, and up to the next border, in each direction.
    per_column = abs(1.0 / dx) if dx != 0.0 else np.inf
    per_row = abs(1.0 / dy) if dy != 0.0 else np.inf
    next_column = abs(column + (dx > 0.0) - x0) * per_column if dx != 0.0 else np.inf
    next_row = abs(row + (dy > 0.0) - y0) * per_row if dy != 0.0 else np.inf
    for _ in range(abs(end_column - column) + abs(end_row - row)):
        misses[row, column] += 1
        # Rounding must not carry the ray past the row or the column in which it ends.
        if row == end_row or (column != end_column and next_column < next_row):
            column += right
            next_column += per_column
        else:
            row += up
            next_row += per_row
    return end_row, end_column


@njit(cache=True, error_model="numpy")
def densified(path: Floats, step: float, jump: float) -> Floats:
    """Points (P, 2) at most `step` apart on the lines between the points of a path (N, 2), except across a `jump`."""
    count = 1
    for k in range(1, len(path)):
        count += _pieces(path, k, step, jump)
    # The points of each line, after the last point of the one before.
    points = np.empty((count, 2))
    points[0] = path[0]
    index = 1
    for k in range(1, len(path)):
        pieces = _pieces(path, k, step, jump)
        for i in range(1, pieces + 1):
            points[index] = path[k - 1] + (path[k] - path[k - 1]) * (i / pieces)
            index += 1
    return points


@njit(cache=True, error_model="numpy")
def _pieces(path, k, step, jump):
    length = math.hypot(path[k, 0] - path[k - 1, 0], path[k, 1] - path[k - 1, 1])
    return 1 if length > jump else max(math.ceil(length / step), 1)


class GridMap(NamedTuple):
    """Cells (rows, columns) uint8, FREE, OCCUPIED or UNKNOWN; row 0 at the bottom.

    resolution: side of a cell [m]. origin: x, y of the lower left corner [m].
    """

    cells: NDArray[np.uint8]
    resolution: float
    origin: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Width and height [m]."""
        rows, columns = self.cells.shape
        return columns * self.resolution, rows * self.resolution

    @property
    def free_area(self) -> float:
        """Area of the free cells [m²]."""
        return float((self.cells == FREE).sum()) * self.resolution**2


class OccupancyGrid:
    """Grid that counts, for each cell, the beams that end in it and those that pass it. It grows with the scans."""

    def __init__(self, resolution: float, max_range: float) -> None:
        """resolution: side of a cell [m]. max_range [m]: only what is nearer to the lidar counts."""
        self._resolution, self._max_range = resolution, max_range
        self._corner = np.zeros(2, dtype=np.int64)  # column and row, from x = y = 0, of the lowest cell
        self._hits = np.zeros((0, 0), dtype=np.int32)
        self._misses = np.zeros((0, 0), dtype=np.int32)

    def add(self, scan: LaserScan, lidar: Pose, clears_far: bool = True) -> None:
        """Add a scan taken from the pose `lidar`, upright; its angle_increment may be negative.

        A range above max_range clears the cells up to there; one of at least scan.range_max, which is without a
        return, does so if `clears_far`. Ranges that are nan, ≤ 0 or below scan.range_min say nothing. Raises
        InputError if the grid becomes too large.
        """
        self._cover(np.array([lidar.x, lidar.y]))
        column, row = np.array([lidar.x, lidar.y]) / self._resolution - self._corner
        no_return = float(np.float32(scan.range_max))
        trace_beams(
            self._hits,
            self._misses,
            np.ascontiguousarray(scan.ranges, dtype=np.float32),
            (float(scan.angle_min), float(scan.angle_increment)),
            (float(scan.range_min), min(self._max_range, no_return), no_return),
            clears_far,
            (float(column), float(row), float(lidar.yaw)),
            self._resolution,
        )

    def finish(self, path: Floats, radius: float, reach: float) -> GridMap:
        """Return the map for a robot of `radius` [m] that drove along `path` (N, 2) [m].

        Occupied are the cells with enough hits. Free are those that the robot's disc swept, and those with a beam
        where the disc can go in at most `reach` [m] from the path, counted along rows and columns. All others are
        unknown: never seen, too narrow, or too far away.
        """
        self._cover(path.min(axis=0) - radius)
        self._cover(path.max(axis=0) + radius)
        # Cells of the path, and the part of the grid that matters.
        points = densified(np.ascontiguousarray(path, dtype=np.float64), self._resolution / 2.0, JUMP_M)
        path_cells = np.unique(np.floor(points / self._resolution).astype(np.int64), axis=0) - self._corner
        columns, rows = path_cells.T
        box = self._observed_box(rows, columns, math.ceil(radius / self._resolution))
        rows, columns = rows - box[0].start, columns - box[1].start
        hits, beams = self._hits[box], self._hits[box] + self._misses[box]
        occupied = (hits >= MIN_HITS) & (hits >= HIT_SHARE * beams)
        # Where the disc swept, and where it can go in `reach` from the path.
        on_way = np.zeros(hits.shape, dtype=bool)
        on_way[rows, columns] = True
        swept = self._distance_to(on_way) <= radius
        open_ = ((beams > 0) & ~occupied) | swept
        roomy = self._distance_to(~np.pad(open_, 1))[1:-1, 1:-1] >= radius
        steps = round(reach / self._resolution)  # 0 would be without end
        reached = ndimage.binary_dilation(on_way, iterations=steps, mask=roomy) if steps else on_way
        free = (open_ & (self._distance_to(reached) < radius)) | swept
        cells = np.where(free, FREE, np.where(occupied, OCCUPIED, UNKNOWN)).astype(np.uint8)
        return self._cropped(cells, self._corner + np.array([box[1].start, box[0].start]))

    def _cover(self, position: Floats) -> None:
        """Grow the grid, if needed, to hold all cells within max_range of a position (2,) [m]."""
        low = np.floor((position - self._max_range) / self._resolution).astype(np.int64) - 1
        high = np.ceil((position + self._max_range) / self._resolution).astype(np.int64) + 1
        first_cell, last_cell = self._corner, self._corner + self._hits.shape[::-1]
        if not self._hits.size:
            self._corner = first_cell = last_cell = low
        elif (low >= first_cell).all() and (high <= last_cell).all():
            return
        growth = math.ceil(_GROWTH_M / self._resolution)
        pad_before = np.where(low < first_cell, np.maximum(first_cell - low, growth), 0)
        pad_after = np.where(high > last_cell, np.maximum(high - last_cell, growth), 0)
        self._check_size(last_cell + pad_after - (first_cell - pad_before))
        widths = ((pad_before[1], pad_after[1]), (pad_before[0], pad_after[0]))
        self._corner = first_cell - pad_before
        self._hits, self._misses = np.pad(self._hits, widths), np.pad(self._misses, widths)

    def _check_size(self, size: Ints) -> None:
        cells = float(size[0]) * float(size[1])
        if cells > MAX_CELLS:
            width, height = size * self._resolution
            raise InputError(
                f"resolution is {self._resolution:g} m for a drive over {width:.0f} by {height:.0f} m: must give at "
                f"most {MAX_CELLS} cells, so at least {self._resolution * math.sqrt(cells / MAX_CELLS):.2g} m"
            )

    def _observed_box(self, rows: Ints, columns: Ints, margin: int) -> tuple[slice, slice]:
        """Rows and columns from the first to the last with a beam or a part of the way, and `margin` more."""
        observed = (self._hits > 0) | (self._misses > 0)
        observed[rows, columns] = True
        sides = ndimage.find_objects(observed.view(np.uint8))[0]
        row_side, column_side = (slice(max(side.start - margin, 0), side.stop + margin) for side in sides)
        return row_side, column_side

    def _distance_to(self, cells: Bools) -> Floats:
        """Distance [m] (rows, columns) from the middle of each cell to that of the nearest of `cells`."""
        return np.asarray(ndimage.distance_transform_edt(~cells)) * self._resolution

    def _cropped(self, cells: NDArray[np.uint8], corner: Ints) -> GridMap:
        """Crop a map to its free cells and a rim. corner: column and row of the first cell from x = y = 0."""
        rim = math.ceil(_RIM_M / self._resolution)
        padded = np.pad(cells, rim, constant_values=UNKNOWN)
        rows, columns = np.nonzero(padded == FREE)
        row, column = int(rows.min()) - rim, int(columns.min()) - rim
        cropped = padded[row : rows.max() + rim + 1, column : columns.max() + rim + 1]
        x, y = (corner + np.array([column - rim, row - rim])) * self._resolution
        return GridMap(cropped, self._resolution, (round(float(x), 9), round(float(y), 9)))
