"""Marking, clearing and inflating a grid of obstacles, and its cells under the outline of a footprint.

Cell (i, j) of the lattice is centred on (i, j) · cell_size. The lattice is symmetric about both axes, so that a
mirrored scene gives a mirrored grid. A `Grid` is (low_i, low_j, cell_size); (low_i, low_j) is the lattice cell with
the array index (0, 0). `hits` (I, J) int32: number of the last scan that hit each cell, 0 if free. `costs` (I, J)
uint8: as in ROS costmap_2d. A stamp (K, 3) int64: costs around one occupied cell, rows (di, dj, cost). An outline (P,
2) holds the corners of a convex polygon in the robot frame [m]. Its sides are drawn from cell to cell: Bresenham
1965, DOI 10.1147/sj.41.0025.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Bools, Floats, Ints

Hits = NDArray[np.int32]
Costs = NDArray[np.uint8]
Grid = tuple[int, int, float]

TOUCHING = 254  # the footprint touches the obstacle at any heading
INSCRIBED = 253  # the padded footprint touches it at any heading
HIGHEST = 252  # highest cost of other cells


@njit(cache=True, error_model="numpy")
def lattice(value: float) -> int:
    """Round to the nearest integer, halves away from zero, so that rounding is symmetric."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


@njit(cache=True, error_model="numpy")
def observe(
    hits: Hits,
    costs: Costs,
    grid: Grid,
    stamp: Ints,
    number: int,
    keep: int,
    pose: tuple[float, float, float],
    ranges: NDArray[np.float32],
    angles: tuple[float, float],
    spans: tuple[float, float, float, float],
    inf_is_valid: bool,
) -> bool:
    """Mark the cells that beams of scan `number` (≥ 1) hit and clear those they pass, in place.

    pose: of the lidar in the frame of the grid. ranges (B,) [m]; angles (angle_min, angle_increment) [rad];
    spans (range_min, range_max, obstacle_range, raytrace_range) [m]. A hit beyond obstacle_range marks no free
    cell, but refreshes a marked one if `keep` > 0. Cells beyond raytrace_range are not cleared, nor cells hit by
    this scan or one of the last `keep`. A beam with a range ≥ range_max clears its cells, up to range_max, if
    `inf_is_valid`; one below range_min or NaN is ignored.
    New hits raise costs; the costs of cleared hits remain until `inflate`. Returns whether a hit was cleared.
    """
    range_min, range_max = np.float32(spans[0]), np.float32(spans[1])
    # Mark the cell of each return, or renew the number of its last hit.
    for k in range(len(ranges)):
        if range_min <= ranges[k] < range_max:
            bearing = pose[2] + angles[0] + k * angles[1]
            x, y = pose[0] + ranges[k] * math.cos(bearing), pose[1] + ranges[k] * math.sin(bearing)
            i, j = lattice(x / grid[2]) - grid[0], lattice(y / grid[2]) - grid[1]
            if 0 <= i < hits.shape[0] and 0 <= j < hits.shape[1]:
                if hits[i, j] == 0 and ranges[k] <= spans[2]:
                    _raise_costs(costs, stamp, i, j)
                    hits[i, j] = number
                elif hits[i, j] != 0 and (keep > 0 or ranges[k] <= spans[2]):
                    hits[i, j] = number  # else walls beyond obstacle_range would be cleared
    has_cleared = False
    for k in range(len(ranges)):
        # Clear the cells that the beam passes, up to the range to which it may clear.
        if ranges[k] >= range_min and (inf_is_valid or ranges[k] < range_max):
            bearing = pose[2] + angles[0] + k * angles[1]
            length = min(ranges[k], range_max, spans[3])
            cos, sin = math.cos(bearing), math.sin(bearing)
            has_cleared |= _clear_beam(hits, grid, number - keep, pose, cos, sin, length)
    return has_cleared


@njit(cache=True, error_model="numpy")
def inflate(hits: Hits, stamp: Ints, costs: Costs) -> None:
    """Recompute the costs from the hits, in place."""
    costs[:] = 0
    for i in range(hits.shape[0]):
        for j in range(hits.shape[1]):
            if hits[i, j] != 0:
                _raise_costs(costs, stamp, i, j)


@njit(cache=True, error_model="numpy")
def _raise_costs(costs, stamp, i, j):
    """Raise the costs around cell (i, j) to those of the stamp."""
    for k in range(len(stamp)):
        a, b = i + stamp[k, 0], j + stamp[k, 1]
        if 0 <= a < costs.shape[0] and 0 <= b < costs.shape[1] and costs[a, b] < stamp[k, 2]:
            costs[a, b] = stamp[k, 2]


@njit(cache=True, error_model="numpy")
def forbidden(costs: Costs, grid: Grid, points: Floats) -> Bools:
    """Return whether each of the points (K, 2) [m] lies in a forbidden cell: (K,). False outside the grid."""
    is_forbidden = np.zeros(len(points), np.bool_)
    for k in range(len(points)):
        i, j = int(np.rint(points[k, 0] / grid[2])) - grid[0], int(np.rint(points[k, 1] / grid[2])) - grid[1]
        if 0 <= i < costs.shape[0] and 0 <= j < costs.shape[1]:
            is_forbidden[k] = costs[i, j] >= INSCRIBED
    return is_forbidden


@njit(cache=True, error_model="numpy")
def _clear_beam(hits, grid, first_scan, pose, cos, sin, length):
    """Clear the cells that a beam passes, except those hit in scan `first_scan` or later; return whether one was hit.

    Source: Amanatides & Woo 1987, "A fast voxel traversal algorithm".
    """
    x, y, reach = pose[0] / grid[2], pose[1] / grid[2], length / grid[2]
    i, j = lattice(x), lattice(y)
    step_i, step_j = (1 if cos > 0.0 else -1), (1 if sin > 0.0 else -1)
    # Distances along the beam to the next border in each direction, and from border to border [cells].
    next_i = (i + 0.5 * step_i - x) / cos if cos != 0.0 else np.inf
    next_j = (j + 0.5 * step_j - y) / sin if sin != 0.0 else np.inf
    per_i = abs(1.0 / cos) if cos != 0.0 else np.inf
    per_j = abs(1.0 / sin) if sin != 0.0 else np.inf
    a, b = i - grid[0], j - grid[1]
    entered, has_cleared = 0.0, False
    # Go from cell to cell; the beam enters the current one at `entered`.
    while entered < reach:
        if 0 <= a < hits.shape[0] and 0 <= b < hits.shape[1] and 0 < hits[a, b] < first_scan:
            hits[a, b], has_cleared = 0, True
        entered = min(next_i, next_j)
        if next_i < next_j:
            a, next_i = a + step_i, next_i + per_i
        else:
            b, next_j = b + step_j, next_j + per_j
    return has_cleared


@njit(cache=True, error_model="numpy")
def draw_discs(hits: Hits, grid: Grid, discs: Floats) -> None:
    """Mark every cell that a solid disc (C, 3) [x, y, radius] touches, in place."""
    cell = grid[2]
    for k in range(len(discs)):
        x, y, reach = discs[k, 0] / cell, discs[k, 1] / cell, discs[k, 2] / cell
        for i in range(lattice(x - reach), lattice(x + reach) + 1):
            for j in range(lattice(y - reach), lattice(y + reach) + 1):
                # Distance from the centre to the nearest point of the cell.
                distance = math.hypot(max(abs(i - x) - 0.5, 0.0), max(abs(j - y) - 0.5, 0.0))
                if distance <= reach:
                    _occupy(hits, grid, i, j)


@njit(cache=True, error_model="numpy")
def draw_edges(hits: Hits, grid: Grid, edges: Floats) -> None:
    """Mark the cells along thin walls (E, 4) [x0, y0, x1, y1] without gaps, in place."""
    cell = grid[2]
    for k in range(len(edges)):
        x0, y0 = edges[k, 0] / cell, edges[k, 1] / cell
        dx, dy = edges[k, 2] / cell - x0, edges[k, 3] / cell - y0
        # At least two samples per cell, so that none is passed over.
        steps = math.ceil(2.0 * math.hypot(dx, dy)) + 1
        for s in range(steps + 1):
            _occupy(hits, grid, lattice(x0 + dx * s / steps), lattice(y0 + dy * s / steps))


@njit(cache=True, error_model="numpy")
def draw_polygon(hits: Hits, grid: Grid, polygon: Floats) -> None:
    """Mark the cells whose centres lie in a polygon (V, 2) by the even–odd rule, in place.

    A line of cells changes sides where it crosses an edge.
    """
    cell, rows, last_corner = grid[2], hits.shape[0], len(polygon) - 1
    low = max(lattice(polygon[:, 1].min() / cell) - grid[1], 0)
    high = min(lattice(polygon[:, 1].max() / cell) - grid[1], hits.shape[1] - 1)
    # [i, j]: whether line j of cells crosses an edge between its cells i − 1 and i
    changes = np.zeros((rows + 1, max(high - low + 1, 0)), np.bool_)
    for k in range(len(polygon)):
        (x0, y0), (x1, y1) = polygon[k], polygon[k + 1 if k < last_corner else 0]
        first = max(lattice(min(y0, y1) / cell) - grid[1], low)
        for j in range(first, min(lattice(max(y0, y1) / cell) - grid[1], high) + 1):
            y = (j + grid[1]) * cell
            if (y < y0) != (y < y1):
                # First cell whose centre is not before the crossing; the loops correct rounding.
                x = x0 + (x1 - x0) * (y - y0) / (y1 - y0)
                i = min(max(math.ceil(x / cell) - grid[0], 0), rows)
                while i > 0 and (i - 1 + grid[0]) * cell >= x:
                    i -= 1
                while i < rows and (i + grid[0]) * cell < x:
                    i += 1
                changes[i, j - low] ^= True
    # Along each line, every crossing changes between outside and inside.
    for j in range(low, high + 1):
        inside = False
        for i in range(rows - 1, -1, -1):
            inside ^= changes[i + 1, j - low]
            if inside:
                hits[i, j] = 1


@njit(cache=True, error_model="numpy")
def _occupy(hits, grid, i, j):
    """Mark lattice cell (i, j) if it is on the grid."""
    a, b = i - grid[0], j - grid[1]
    if 0 <= a < hits.shape[0] and 0 <= b < hits.shape[1]:
        hits[a, b] = 1


@njit(cache=True, error_model="numpy")
def outline_capacity(outline: Floats, cell_size: float) -> int:
    """Greatest number of cells that `outline_cells` can list at any pose."""
    length = 0.0
    for k in range(len(outline)):
        m = (k + 1) % len(outline)
        length += math.hypot(outline[m, 0] - outline[k, 0], outline[m, 1] - outline[k, 1])
    return math.ceil(length / cell_size) + 3 * len(outline)


@njit(cache=True, error_model="numpy")
def outline_cells(
    outline: Floats, pose: tuple[float, float, float], grid: Grid, shape: tuple[int, int], cells: Ints
) -> int:
    """List the cells under the outline at `pose` in `cells` (M,), M ≥ `outline_capacity`, and return how many.

    Cells are indices of the flat array, corners are listed twice. Returns -1 if a corner is outside the array.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    count, last_corner = 0, len(outline) - 1
    i, j = _corner(outline, last_corner, pose, cos, sin, grid)
    # Draw the side from each corner to the next, beginning with the last corner.
    for k in range(len(outline)):
        a, b = _corner(outline, k, pose, cos, sin, grid)
        if a < 0 or b < 0 or a >= shape[0] or b >= shape[1]:
            return -1
        if k > 0 or (0 <= i < shape[0] and 0 <= j < shape[1]):  # the last corner is checked last
            count = _line(i, j, a, b, shape[1], cells, count)
        i, j = a, b
    return count


@njit(cache=True, error_model="numpy")
def outline_cost(
    costs: Costs, outline: Floats, pose: tuple[float, float, float], grid: Grid, cells: Ints
) -> int:
    """Highest cost under the outline at `pose`; -1 if it is `TOUCHING` or a corner is off the map.

    cells (M,), M ≥ `outline_capacity`, is overwritten.
    """
    flat = costs.ravel()
    highest = 0
    # Only the cells under the sides count, not those inside.
    count = outline_cells(outline, pose, grid, costs.shape, cells)
    for k in range(count):
        highest = max(highest, int(flat[cells[k]]))
    return -1 if count < 0 or highest >= TOUCHING else highest


@njit(cache=True, error_model="numpy")
def covered_cells(
    outline: Floats, pose: tuple[float, float, float], grid: Grid, shape: tuple[int, int]
) -> Bools:
    """Return whether each cell of the array lies under the outline at `pose` or inside it: (I, J).

    No cell does if a corner is outside the array.
    """
    cells = np.empty(outline_capacity(outline, grid[2]), np.int64)
    count = outline_cells(outline, pose, grid, shape, cells)
    covered = np.zeros(shape, np.bool_)
    # First and last column of the outline in each row; it is convex, so all between them are covered.
    low, high = np.full(shape[0], shape[1]), np.full(shape[0], -1)
    for k in range(count):
        i, j = cells[k] // shape[1], cells[k] % shape[1]
        low[i], high[i] = min(low[i], j), max(high[i], j)
    for i in range(shape[0]):
        covered[i, low[i] : high[i] + 1] = True
    return covered


@njit(cache=True, error_model="numpy")
def free_covered(hits: Hits, outline: Floats, pose: tuple[float, float, float], grid: Grid) -> bool:
    """Free the cells under and inside the outline at `pose`, in place: the robot is there, so nothing else is.

    Returns whether one of them was occupied.
    """
    covered = covered_cells(outline, pose, grid, hits.shape)
    has_freed = False
    for i in range(hits.shape[0]):
        for j in range(hits.shape[1]):
            if covered[i, j] and hits[i, j] != 0:
                hits[i, j], has_freed = 0, True
    return has_freed


@njit(cache=True, error_model="numpy", inline="always")
def _corner(outline, k, pose, cos, sin, grid):
    """Array index of the cell under corner k."""
    x = pose[0] + cos * outline[k, 0] - sin * outline[k, 1]
    y = pose[1] + sin * outline[k, 0] + cos * outline[k, 1]
    return lattice(x / grid[2]) - grid[0], lattice(y / grid[2]) - grid[1]


@njit(cache=True, error_model="numpy", inline="always")
def _line(i, j, a, b, columns, cells, count):
    """Append the cells from (i, j) to (a, b), both included, and return the new count."""
    di, dj = abs(a - i), abs(b - j)
    # Steps of the flat index along the longer axis and across it.
    along, across = (columns if a > i else -columns), (1 if b > j else -1)
    if dj > di:
        along, across = across, along
    major, minor = max(di, dj), min(di, dj)
    error, cell = major // 2, i * columns + j
    for _ in range(major + 1):
        cells[count] = cell
        count += 1
        # Step across whenever the error reaches a whole cell.
        error += minor
        if error >= major:
            error -= major
            cell += across
        cell += along
    return count
