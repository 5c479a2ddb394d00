"""Ray casting of lidar beams against discs and line segments, and the noise of their ranges.

Each obstacle is tested only against the beams in its angular extent. The extent is a cheap polynomial upper bound;
the beams in it are tested exactly.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from lme.geometry.fan import BEARING_ERROR, bearing
from lme.geometry.frames import compose
from lme.grids.edge_grid import EdgeGrid, first_hit
from lme.grids.lattice import NO_LATTICE, Lattice, cast_lattice
from lme.perception.scan_points import beam_directions
from lme.robots import Lidar
from lme.types import Floats, LaserScan, Pose

_TWO_PI = 2.0 * math.pi
_ASIN_CUBIC = math.pi / 2.0 - 1.0  # asin(z) ≤ z + (π/2 − 1) z³ on [0, 1], with equality at both ends


def cast(lidar: Lidar, pose: Pose, circles: ArrayLike = (), segments: ArrayLike = ()) -> LaserScan:
    """Return the scan, without noise, of a planar lidar on a robot at `pose`.

    pose: of the robot in the world. circles: (C, 3) solid discs [x, y, radius] [m]. segments: (S, 4) thin walls
    [x0, y0, x1, y1] [m], in the world. Inside a disc all ranges are 0. Raises ValueError for other shapes.
    """
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    lidar_pose = compose(pose, lidar.mount)
    ranges = cast_shapes(lidar_pose, angles, lidar.range_max, _rows(circles, 3), _rows(segments, 4))
    return LaserScan(ranges, lidar.angle_min, lidar.angle_increment, lidar.range_min, lidar.range_max)


def _rows(values: ArrayLike, columns: int) -> Floats:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1, columns)


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
    ranges: NDArray[np.float32] = cast_beams(
        float(x), float(y), yaw + angle_min, increment, float(range_max), table, circles, edges
    )
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
def cast_beams(x, y, heading, increment, range_max, table, circles, edges):
    """Return the result of `cast_shapes`. heading: of the first beam in the world [rad]; table: `beam_table`.

    It works in the lidar's frame, rotated so that the first beam is along +x.
    """
    ranges = np.full(table.shape[1], range_max)
    frame = (x, y, math.cos(heading), math.sin(heading))
    if _cast_circles(frame, increment, range_max, table, circles, ranges):
        ranges[:] = 0.0
    elif len(edges) > 0:
        _cast_edges(frame, increment, range_max, table, edges, ranges)
    return ranges.astype(np.float32)


@njit(cache=True, error_model="numpy")
def _cast_grid(x, y, heading, range_max, table, frame, starts, edges):
    """Return the result of `cast_grid` without a lattice. heading: of the first beam in the world [rad]."""
    ranges = np.empty(table.shape[1], np.float32)
    turn = (math.cos(heading), math.sin(heading))
    for i in range(len(ranges)):
        ranges[i] = first_hit(x, y, turn, (table[0, i], table[1, i]), range_max, frame, starts, edges)
    return ranges


@njit(cache=True, error_model="numpy")
def _cast_circles(frame, increment, range_max, table, circles, ranges):
    """Shorten ranges to the discs; return True if the lidar is inside one."""
    u, v, low, high, inside = _circle_extents(frame, increment, circles)
    if inside:
        return True
    for i in range(len(circles)):
        # Skip discs that begin beyond range_max.
        reach = range_max + circles[i, 2]
        if u[i] * u[i] + v[i] * v[i] >= reach * reach:
            continue
        square = circles[i, 2] * circles[i, 2]
        num_beams, turn = len(ranges), _TWO_PI / increment
        # Beams within the extent, and within the same extent one turn earlier or later if there are any.
        _meet_disc(u[i], v[i], square, low[i], high[i], table, ranges)
        if high[i] >= turn:
            _meet_disc(u[i], v[i], square, low[i] - turn, high[i] - turn, table, ranges)
        if low[i] + turn < num_beams:
            _meet_disc(u[i], v[i], square, low[i] + turn, high[i] + turn, table, ranges)
    return False


@njit(cache=True, error_model="numpy")
def _circle_extents(frame, increment, circles):
    """Centres (u, v) in the lidar's frame, extents [low, high] in beams, and whether a disc contains the lidar.

    It has no branches, so the loop is vectorised.
    """
    x, y, cos, sin = frame
    u, v = np.empty(len(circles)), np.empty(len(circles))
    low, high = np.empty(len(circles)), np.empty(len(circles))
    inside = 0
    per_radian = 1.0 / increment
    for i in range(len(circles)):
        dx, dy, r = circles[i, 0] - x, circles[i, 1] - y, circles[i, 2]
        u[i], v[i] = cos * dx + sin * dy, cos * dy - sin * dx
        square = dx * dx + dy * dy
        inside += square <= r * r
        # Upper bound of the half angle asin(r / d).
        sine = r / math.sqrt(square)
        half = sine + _ASIN_CUBIC * sine * sine * sine + BEARING_ERROR
        middle = bearing(u[i], v[i])
        low[i], high[i] = (middle - half) * per_radian, (middle + half) * per_radian
    return u, v, low, high, inside > 0


@njit(cache=True, error_model="numpy")
def _meet_disc(u, v, square, low, high, table, ranges):
    """Test beams low…high against a disc of squared radius `square` centred on (u, v)."""
    first_beam, last_beam = max(math.ceil(low), 0), min(math.floor(high), len(ranges) - 1)
    for i in range(first_beam, last_beam + 1):
        c, s = table[0, i], table[1, i]
        across = u * s - v * c
        along = u * c + v * s
        # Near intersection at along − √(r² − across²).
        depth = square - across * across
        if depth >= 0.0 and along > 0.0:
            ranges[i] = min(ranges[i], along - math.sqrt(depth))


@njit(cache=True, error_model="numpy")
def _cast_edges(frame, increment, range_max, table, edges, ranges):
    """Shorten ranges to the edges."""
    x, y, cos, sin = frame
    turn = _TWO_PI / increment
    for i in range(len(edges)):
        ax, ay, bx, by = edges[i, 0] - x, edges[i, 1] - y, edges[i, 2] - x, edges[i, 3] - y
        if _beyond(ax, ay, bx, by, range_max):
            continue
        # The edge in the lidar's frame, with the first beam along +x.
        start = (cos * ax + sin * ay, cos * ay - sin * ax)
        end = (cos * bx + sin * by, cos * by - sin * bx)
        low, high = _edge_extent(start, end, increment)
        # Beams within the extent, and within the same extent one turn earlier or later if there are any.
        _meet_edge(start, end, low, high, table, ranges)
        if high >= turn:
            _meet_edge(start, end, low - turn, high - turn, table, ranges)
        if low + turn < len(ranges):
            _meet_edge(start, end, low + turn, high + turn, table, ranges)


@njit(cache=True, error_model="numpy")
def _beyond(ax, ay, bx, by, range_max):
    """Return whether the bounding box of the edge from a to b is farther than range_max from the origin."""
    gap_x = max(min(ax, bx), -max(ax, bx), 0.0)
    gap_y = max(min(ay, by), -max(ay, by), 0.0)
    return gap_x * gap_x + gap_y * gap_y >= range_max * range_max


@njit(cache=True, error_model="numpy")
def _edge_extent(start, end, increment):
    """Extent [low, high] of an edge in beams; a whole turn if the lidar is on the edge or almost."""
    cross = start[0] * end[1] - start[1] * end[0]
    dot = start[0] * end[0] + start[1] * end[1]
    if abs(cross) <= -1e-6 * dot or start == (0.0, 0.0) or end == (0.0, 0.0):
        return 0.0, _TWO_PI / increment
    # Counter-clockwise from low to high, across the bearing 0 if need be.
    low, high = bearing(start[0], start[1]), bearing(end[0], end[1])
    if cross < 0.0:
        low, high = high, low
    if high < low - 2.0 * BEARING_ERROR:
        high += _TWO_PI
    return (low - BEARING_ERROR) / increment, (high + BEARING_ERROR) / increment


@njit(cache=True, error_model="numpy")
def _meet_edge(start, end, low, high, table, ranges):
    """Test beams low…high against the edge from start to end.

    A beam hits the edge if it passes the two ends on different sides. Edges with a shared corner agree on the
    corner's side, so no beam passes between them.
    """
    first_beam, last_beam = max(math.ceil(low), 0), min(math.floor(high), len(ranges) - 1)
    lever = start[0] * end[1] - start[1] * end[0]
    for i in range(first_beam, last_beam + 1):
        c, s = table[0, i], table[1, i]
        across_start = start[0] * s - start[1] * c
        across_end = end[0] * s - end[1] * c
        # Distance along the beam to the line of the edge.
        distance = lever / (across_start - across_end)
        if (across_start > 0.0) != (across_end > 0.0) and distance >= 0.0:
            ranges[i] = min(ranges[i], distance)


@njit(cache=True)
def add_noise(ranges: NDArray[np.float32], noise: NDArray[np.float32], std: float, range_max: float) -> None:
    """Add Gaussian noise to every return, in place; beams without a return stay at range_max.

    ranges (B,) [m]; noise (B,) standard normal; std, range_max [m].
    """
    for i in range(len(ranges)):
        if ranges[i] < np.float32(range_max):
            ranges[i] = min(max(ranges[i] + std * noise[i], 0.0), range_max)
