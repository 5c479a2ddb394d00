"""Expected time to a target from every cell of a local disc, around obstacle points.

The eikonal equation |∇T| = s is solved from the target outwards (fast marching: Sethian 1999, SIAM Review 41(2),
DOI 10.1137/S0036144598347059), with buckets instead of a heap (Yatziv, Bartesaghi & Sapiro 2006, J. Comput. Phys.
212(2), DOI 10.1016/j.jcp.2005.08.005). s is the time per metre. Cells are taken in the order of T plus the time that
the straight line from the robot takes, as in A*, so cells far from every possible way of the robot are never
visited. In this order a cell may come before one that it depends on; then its time is recomputed.

At the edge of the disc the time is that of the straight line, or what earlier searches have learned of the place if
that is more (Learning Real-Time A*, Korf 1990, Artificial Intelligence 42(2-3), DOI 10.1016/0004-3702(90)90054-4).
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.guides.lme_plus.travel_grid import (
    HALF_DIAGONAL,
    Grid,
    GridNumbers,
    PaceNumbers,
    SpeedProfile,
    Workspace,
    disc_radius,
    draw,
    erase,
    pad,
)
from lme.types import Floats

BUCKETS = 4096  # each as wide as the time for one cell at v_max; later times share the last one
_NEIGHBOURS = 4
_PASSAGE = 20.0  # [-] factor of the time at v_max, from the nearest passage to a target that has none
_TINY = 1e-9  # [m] instead of a band without width
_GAIN = 0.1  # [times for a cell] by which a known time must improve to be recomputed
_ONE_SIDED = 0.9  # share of a step away from points on one side alone by which they become farther, at least


@njit(cache=True, error_model="numpy")
def travel_times(
    work: Workspace | tuple[Any, ...],
    points: Floats,
    target: Floats,
    robot: Floats,
    grid: Grid | GridNumbers,
    pace: SpeedProfile | PaceNumbers,
    people: Floats,
    learned: Floats,
    corner: tuple[int, int],
    slack: float,
    leave: bool,
) -> float:
    """Solve for T of every cell [s], in `work.times` until the next call, and return that of the robot's cell.

    points (M, 2); target (2,), robot (2,), in the frame of the grid [m]. people (P, 6): x, y, vx, vy [m, m/s], the
    radius within which they are in the way [m], and the time per metre that it costs to be there when they are [s/m];
    the robot is expected at a place after the time of the straight way. learned (A, B): the least times known before
    [s], where `corner` is that of the grid's frame. A way that leaves the disc is straight and free from there to the
    target, or takes what was learned of the cell at its edge if that is more; to a target in the disc, ways leave it
    only if `leave` is true. Only ways from the robot that take at most `slack` [s] more than the best are searched;
    cells on no such way are inf, as are those without passage. Python passes plain tuples: Numba needs 5 µs more to
    recognise each named one.
    """
    work, grid, pace = Workspace(*work), Grid(*grid), SpeedProfile(*pace)
    # Target and robot as (row, column); the frame is row and column 0.
    x, y = (target[0] - grid.x) / grid.cell + 0.5, (target[1] - grid.y) / grid.cell + 0.5
    rx, ry = (robot[0] - grid.x) / grid.cell + 0.5, (robot[1] - grid.y) / grid.cell + 0.5
    frame = grid.x, grid.y, grid.cell, grid.size
    # Draw the distances to the obstacle points; they are erased after the search.
    following = np.empty(len(points), np.int32)
    lists = work.first, following, work.marks
    marks, nearest = draw(work.squares, *lists, points, robot, frame, pace.comfort, pace.inner)
    min_distance = min(nearest, pace.inner) - HALF_DIAGONAL * grid.cell
    enclosed = _inside(x, y, grid.size) and not leave
    obstacles = points, following, work.first
    time: float = _march(
        work, obstacles, (x, y), (rx, ry), grid, pace, people, learned, corner, min_distance, slack, enclosed
    )
    erase(work.squares, work.first, work.marks, marks, pace.comfort, grid.cell)
    return time


@njit(cache=True, error_model="numpy")
def _clear(work):
    """Erase the last result."""
    times = work.times.ravel()
    # Only cells that were put into a bucket or seen to be no passage have changed.
    for n in range(work.used[0]):
        cell = work.nodes[0, n]
        times[cell] = work.tentative[cell] = np.inf
        work.steps[cell], work.narrow[cell] = 0.0, False
    for n in range(work.used[1]):
        cell = work.walls[n]
        work.tentative[cell], work.steps[cell] = np.inf, 0.0
    work.used[:] = 0


@njit(cache=True, error_model="numpy")
def _march(
    work, obstacles, target, robot, grid, pace, people, learned, corner, min_distance, slack, enclosed
):
    """Solve |∇T| = s from the target, and from the edge of the disc unless the ways are `enclosed` in it.

    target, robot: (row, column). min_distance [m]: distance to points that suffices near the robot.
    """
    _clear(work)
    width, cell_time = grid.size + 2, grid.cell / pace.v_max
    # Robot's cell, flat views of the arrays, and lengths in cells.
    x, y = target
    rx, ry = robot
    robot_cell = min(max(int(rx + 0.5), 1), grid.size) * width + min(max(int(ry + 0.5), 1), grid.size)
    final, tentative, steps, robot_distances = work.times.ravel(), work.tentative, work.steps, work.away
    narrow, passable = work.narrow, pace.tight < pace.inner
    half_min, comfort = pace.tight / grid.cell, pace.comfort / grid.cell
    cells, follow, walls, squares = work.nodes[0], work.nodes[1], work.walls, work.squares
    border = pad(pace.comfort, grid.cell) - 1
    # Sources: cells around the target, and at the edge the straight time or what was learned, if that is more.
    beside_square = _passage_radius_square(squares, border, x, y, grid, pace)
    at_target, count = _sources(cells, work.edge, x, y, grid.size, enclosed)
    # Sort them into buckets, linked lists of nodes, by T plus the straight way from the robot, in cells.
    heads = np.full(BUCKETS, -1, np.int32)
    first = math.floor(math.hypot(x - rx, y - ry)) - 2.0  # no key is less
    for n in range(count):
        i, j = cells[n] // width, cells[n] % width
        time = math.hypot(i - x, j - y) * cell_time
        if n >= at_target:
            time = max(time, learned[i + corner[0], j + corner[1]])
        tentative[cells[n]] = time
        bucket = min(int(time / cell_time + math.hypot(i - rx, j - ry) - first), BUCKETS - 1)
        follow[n], heads[bucket] = heads[bucket], n
    # Take nodes bucket by bucket, until `slack` after the robot's cell.
    bucket, stop, min_gain, blocked = 0, BUCKETS, _GAIN * cell_time, 0
    node = heads[0]
    dj, di = np.uint64(1), np.uint64(width)  # indices without a sign are faster: none can be negative
    while True:
        if node < 0:
            bucket += 1
            if bucket >= stop:
                break
            node = heads[bucket]
            continue
        cell = np.uint64(cells[node])
        node = follow[node]
        # Skip a node if its cell has already got this time or a better one.
        arrival = tentative[cell]
        if final[cell] <= arrival:
            continue
        final[cell] = arrival
        if cell == np.uint64(robot_cell):
            stop = min(bucket + int(slack / cell_time) + 1, BUCKETS)
        # Update the four neighbours by way of this cell.
        for k in range(_NEIGHBOURS):
            neighbour = cell + dj if k == 0 else cell - dj if k == 1 else cell + di if k == 2 else cell - di
            max_time = tentative[neighbour] - min_gain
            if arrival >= max_time:
                continue  # a time by way of this cell is longer than its own
            step = steps[neighbour]
            if step == 0.0:
                # First visit: time across the cell, by its distance to points and the width of a passage.
                i, j = int(neighbour) // width, int(neighbour) % width
                distance = math.sqrt((i - rx) ** 2 + (j - ry) ** 2)
                square = squares[i + border, j + border] * grid.cell * grid.cell
                tight, half = square < pace.inner * pace.inner, 0.0
                if tight and passable and may_be_passage(squares, i + border, j + border, half_min, comfort):
                    half = half_width(i - 1, j - 1, squares, border + 1, obstacles, grid, pace)
                step = grid.cell * _slowness(
                    max(square, half * half), half, distance * grid.cell, min_distance, pace
                )
                # Close to a target without a passage, cells without a point in them are slow instead of closed.
                if (
                    tight
                    and step > _PASSAGE * cell_time
                    and (i - x) ** 2 + (j - y) ** 2 < beside_square
                    and square > 0.5 * grid.cell**2
                ):
                    step = _PASSAGE * cell_time
                # Time that people on their way cost when the robot can be here.
                if len(people):
                    position = grid.x + (i - 0.5) * grid.cell, grid.y + (j - 0.5) * grid.cell
                    step += grid.cell * _people_cost(position, distance * cell_time, people)
                steps[neighbour], robot_distances[neighbour], narrow[neighbour] = step, distance, half > 0.0
                if step == np.inf:
                    walls[blocked] = neighbour
                    blocked += 1
                    if tentative[neighbour] == np.inf:
                        tentative[neighbour] = -np.inf  # not looked at again
            if step == np.inf:
                continue
            # Upwind difference: the lesser final time along each axis.
            time = _eikonal(
                min(final[neighbour - di], final[neighbour + di]),
                min(final[neighbour - dj], final[neighbour + dj]),
                step,
            )
            # Put the neighbour into its bucket; if that is not a later one, it comes next.
            if time < max_time and count < len(cells):
                tentative[neighbour] = time
                new_bucket = min(int(time / cell_time + robot_distances[neighbour] - first), BUCKETS - 1)
                cells[count] = neighbour
                if new_bucket <= bucket:
                    follow[count], node = node, count
                else:
                    follow[count], heads[new_bucket] = heads[new_bucket], count
                count += 1
    work.used[0], work.used[1] = count, blocked
    return final[robot_cell]


@njit(cache=True, error_model="numpy")
def _passage_radius_square(squares, border, x, y, grid, pace):
    """Squared distance up to which slow ways lead to a target without a passage [cells²]; 0 if it has one."""
    if _inside(x, y, grid.size):
        square = squares[int(x + 0.5) + border, int(y + 0.5) + border] * grid.cell * grid.cell
        if square < pace.inner * pace.inner:
            return 4.0 * pace.inner * pace.inner / (grid.cell * grid.cell)
    return 0.0


@njit(cache=True, error_model="numpy")
def _sources(cells, edge, x, y, size, enclosed):
    """Put the cells whose time is known from the start into `cells`.

    Returns how many of them are around the target, and how many there are with the edge.
    """
    at_target = 0
    # The four cells around the target.
    if _inside(x, y, size):
        for i in range(int(x), int(x) + 2):
            for j in range(int(y), int(y) + 2):
                cells[at_target] = i * (size + 2) + j
                at_target += 1
    count = at_target
    if not enclosed:
        for cell in edge:
            cells[count] = cell
            count += 1
    return at_target, count


@njit(cache=True, error_model="numpy", inline="always")
def _inside(x, y, size):
    """Return whether a (row, column) is inside the disc by a cell's diagonal, so that the cells around it are too."""
    middle = 0.5 * (size + 1.0)
    return math.hypot(x - middle, y - middle) <= disc_radius(size) - 2.0 * HALF_DIAGONAL


@njit(cache=True, error_model="numpy", inline="always")
def _eikonal(a, b, step):
    """Time of a cell whose neighbours have the times a along one axis and b along the other; inf: no neighbour."""
    # (T − a)² + (T − b)² = step² if T is later than both, else T is a straight step from the earlier one.
    difference = abs(a - b)
    if difference < step:
        return 0.5 * (a + b + math.sqrt(2.0 * step * step - difference * difference))
    return min(a, b) + step


@njit(cache=True, error_model="numpy", inline="always")
def _slowness(square, half, robot_distance, min_distance, pace):
    """Time per metre [s/m] by squared distance to the nearest point and distance to the robot; inf: no passage."""
    if square >= pace.comfort * pace.comfort:
        return 1.0 / pace.v_max
    d = math.sqrt(square)
    # Nearer than `inner`: slower up to `narrow` times at `tight`, but in the robot's own passage as at `inner`.
    if d < pace.inner:
        is_beside = d >= min_distance and robot_distance <= pace.room
        if d < pace.tight and not is_beside:
            return np.inf
        if half == 0.0 or not is_beside:
            fraction = (pace.inner - max(d, pace.tight)) / max(pace.inner - pace.tight, _TINY)
            return (1.0 + pace.slowdown + (pace.narrow - 1.0 - pace.slowdown) * fraction) / pace.v_max
        d = pace.inner
    # From `inner` to `comfort`: 1 + slowdown · fraction², with fraction 1 at `inner`.
    fraction = (pace.comfort - d) / (pace.comfort - pace.inner)
    return (1.0 + pace.slowdown * fraction * fraction) / pace.v_max


@njit(cache=True, error_model="numpy")
def _people_cost(position, time, people):
    """Time per metre that people cost at a position after some time [s/m]."""
    cost = 0.0
    for n in range(len(people)):
        # Offset of the person by then, at constant velocity.
        dx = people[n, 0] + time * people[n, 2] - position[0]
        dy = people[n, 1] + time * people[n, 3] - position[1]
        if dx * dx + dy * dy < people[n, 4] * people[n, 4]:
            cost = max(cost, people[n, 5])
    return cost


@njit(cache=True, error_model="numpy")
def half_width(
    i: int,
    j: int,
    squares: Floats,
    border: int,
    obstacles: tuple[Floats, NDArray[np.int32], NDArray[np.int32]],
    grid: Grid,
    pace: SpeedProfile,
) -> float:
    """Half of the distance between the points on both sides of a cell [m]; 0 if it is in no narrow passage.

    The cell is in row i and column j of the grid, from 0. squares, and obstacles, which are points (M, 2), following
    (M,) and first (size, size): see `travel_grid.draw`; `border` cells of squares are around the grid. One of the
    two points is the nearest in the grid to the cell's centre, at least half a cell away. The other is on the other
    side: the angle between them is more than a right one, and they are less than 2 `inner` apart.
    """
    (points, following, first), (low_x, low_y, cell, size) = obstacles, grid
    square = squares[i + border, j + border]
    x, y = low_x + (i + 0.5) * cell, low_y + (j + 0.5) * cell
    # Direction and squared distance of the nearest point.
    ax, ay, nearest = 0.0, 0.0, np.inf
    reach = int(math.sqrt(square) + 0.5)
    for a in range(max(i - reach, 0), min(i + reach + 1, size)):
        for b in range(max(j - reach, 0), min(j + reach + 1, size)):
            m = first[a, b]
            while m >= 0:
                dx, dy = points[m, 0] - x, points[m, 1] - y
                point_square = dx * dx + dy * dy
                if point_square < nearest:
                    ax, ay, nearest = dx, dy, point_square
                m = following[m]
    if nearest < 0.25 * cell * cell:
        return 0.0
    # Least distance from that point to one on the other side.
    max_square = 4.0 * pace.inner * pace.inner
    side = HALF_DIAGONAL * math.sqrt(nearest)
    width, reach = max_square, int(2.0 * pace.inner / cell + 0.5)
    for a in range(max(i - reach, 0), min(i + reach + 1, size)):
        for b in range(max(j - reach, 0), min(j + reach + 1, size)):
            # Skip cells that lie wholly on the side of the first point.
            if (a - i) * ax + (b - j) * ay > side:
                continue
            m = first[a, b]
            while m >= 0:
                dx, dy = points[m, 0] - x, points[m, 1] - y
                if dx * ax + dy * ay < 0.0:
                    width = min(width, (dx - ax) ** 2 + (dy - ay) ** 2)
                m = following[m]
    return 0.5 * math.sqrt(width) if width < max_square else 0.0


@njit(cache=True, error_model="numpy", inline="always")
def may_be_passage(squares, i, j, tight, comfort):
    """Return whether a cell can be in a narrow passage.

    tight, comfort: as in `SpeedProfile`, in cells. i, j: the cell, in `squares`.

    It cannot if all places in it are less than `tight` from a point, or if the points are on one side alone: then the
    nearest is farther from one of twelve cells about 2 cells away, by nearly all of the way there.
    """
    square = squares[i, j]
    min_distance = max(tight - HALF_DIAGONAL, 0.5)
    if square < min_distance * min_distance:
        return False
    distance = math.sqrt(square)
    # Four cells 2 away along the axes, then eight that are √5 away.
    straight = min(distance + _ONE_SIDED * 2.0, comfort) ** 2
    if max(squares[i - 2, j], squares[i + 2, j], squares[i, j - 2], squares[i, j + 2]) >= straight:
        return False
    aslant = min(distance + _ONE_SIDED * math.sqrt(5.0), comfort) ** 2
    rows = max(squares[i - 2, j - 1], squares[i - 2, j + 1], squares[i + 2, j - 1], squares[i + 2, j + 1])
    columns = max(squares[i - 1, j - 2], squares[i - 1, j + 2], squares[i + 1, j - 2], squares[i + 1, j + 2])
    return max(rows, columns) < aslant
