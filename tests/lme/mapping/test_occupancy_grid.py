"""Occupancy grids: which cells beams pass and hit, and what of them a robot may drive on."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, densified, trace_beams
from lme.types import LaserScan, Pose
from tests.made_logs import CLOSET, CORRIDOR, PILLAR, WAYPOINTS, scan, truth_clearance, way

INCREMENT = math.pi / 180


def value_at(made, place):
    column, row = np.floor((np.array(place) - made.origin) / made.resolution).astype(int)
    rows, columns = made.cells.shape
    return made.cells[row, column] if 0 <= row < rows and 0 <= column < columns else UNKNOWN


def room(resolution=0.05, radius=0.25, reach=5.0, max_range=10.0, beams=181):
    grid = OccupancyGrid(resolution, max_range)
    for pose in way():
        ranges = scan(pose, beams).astype(np.float32)
        grid.add(LaserScan(ranges, -math.pi / 2, math.pi / (beams - 1), 0.0, 80.0), pose)
    return grid.finish(np.array([pose[:2] for pose in way()]), radius, reach)


@pytest.fixture(scope="module")
def made():
    return room()


def centres(made):
    rows, columns = np.indices(made.cells.shape)
    return (np.column_stack((columns.ravel(), rows.ravel())) + 0.5) * made.resolution + made.origin


def test_the_map_of_a_drive_is_the_room(made):
    """Free cells lie in the room, and every place of the room that the robot can reach is free."""
    points, cells = centres(made), made.cells.ravel()
    clearance = truth_clearance(points)
    inside = (points > 0.0).all(axis=1) & (points < (10.0, 6.0)).all(axis=1) & (clearance > 0.0)
    sure = clearance > made.resolution  # a wall may lie anywhere in a cell
    assert not ((cells == FREE) & ~inside & sure & (points[:, 1] > 0.0)).any()
    assert (cells == FREE)[inside & (clearance > 0.3)].all()
    assert (clearance[cells == OCCUPIED] < 1.5 * made.resolution).all()


def test_what_the_body_cannot_reach_is_closed(made):
    assert value_at(made, CLOSET) == UNKNOWN  # seen through a slit of 30 cm
    assert value_at(room(radius=0.1), CLOSET) == FREE


def test_what_is_far_from_the_way_is_closed(made):
    assert value_at(made, (1.5, -2.0)) == FREE
    assert value_at(made, (1.5, -5.5)) == UNKNOWN  # 1 m to the door, and 5.5 m more
    assert value_at(room(reach=20.0, beams=721), (1.5, -5.5)) == FREE
    assert (
        value_at(room(reach=20.0, beams=721), CORRIDOR) == UNKNOWN
    )  # more than 10 m from where the robot was
    assert value_at(room(reach=20.0, beams=721, max_range=20.0), CORRIDOR) == FREE


def test_the_map_has_a_rim_around_its_free_cells(made):
    rows, columns = np.nonzero(made.cells == FREE)
    assert rows.min() == columns.min() == 5
    assert (rows.max() + 6, columns.max() + 6) == made.cells.shape
    assert made.free_area == pytest.approx((made.cells == FREE).sum() * 0.0025)
    assert made.size == pytest.approx((made.cells.shape[1] * 0.05, made.cells.shape[0] * 0.05))


def test_a_passer_by_leaves_no_trace_and_the_robots_own_way_is_free():
    """Two scans of a hundred meet somebody; what a beam met where the robot drove later is free too."""
    grid = OccupancyGrid(0.05, 10.0)
    for k in range(100):
        ranges = np.full(3, 2.0 if k < 2 else 4.0, np.float32)
        grid.add(LaserScan(ranges, -INCREMENT, INCREMENT, 0.0, 80.0), Pose(0.0, 0.0, 0.0))
    made = grid.finish(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.25, 5.0)
    assert value_at(made, (2.02, 0.02)) != OCCUPIED
    assert value_at(made, (4.02, 0.02)) in (OCCUPIED, UNKNOWN)
    blocked = OccupancyGrid(0.05, 10.0)
    for _ in range(10):
        blocked.add(
            LaserScan(np.full(3, 0.6, np.float32), -INCREMENT, INCREMENT, 0.0, 80.0), Pose(0.0, 0.0, 0.0)
        )
    swept = blocked.finish(np.array([[0.0, 0.0], [1.0, 0.0]]), 0.25, 5.0)
    assert value_at(swept, (0.61, 0.0)) == FREE


@pytest.mark.parametrize("clears", [True, False])
def test_a_beam_without_a_return_clears_or_says_nothing(clears):
    grid = OccupancyGrid(0.1, 5.0)
    whole_turn = np.full(360, np.inf, np.float32)
    for _ in range(3):
        grid.add(LaserScan(whole_turn, -math.pi, INCREMENT, 0.0, 30.0), Pose(0.0, 0.0, 0.0), clears)
    made = grid.finish(np.zeros((1, 2)), 0.25, 3.0)
    assert (value_at(made, (1.5, 0.0)) == FREE) == clears
    assert value_at(made, (0.1, 0.1)) == FREE  # the body


@pytest.mark.parametrize("bad", [math.nan, 0.0, -1.0, 0.04])
def test_invalid_ranges_say_nothing(bad):
    grid = OccupancyGrid(0.1, 5.0)
    for _ in range(3):
        grid.add(
            LaserScan(np.full(360, bad, np.float32), -math.pi, INCREMENT, 0.05, 30.0), Pose(0.0, 0.0, 0.0)
        )
    made = grid.finish(np.zeros((1, 2)), 0.25, 3.0)
    assert made.free_area == pytest.approx(math.pi * 0.25**2, rel=0.3)  # the body's
    assert not (made.cells == OCCUPIED).any()


def test_a_range_at_the_limit_of_the_lidar_is_not_a_hit():
    """range_max as float32 is a little less than as float64."""
    grid = OccupancyGrid(0.1, 10.0)
    for _ in range(3):
        grid.add(LaserScan(np.full(360, 5.6, np.float32), -math.pi, INCREMENT, 0.0, 5.6), Pose(0.0, 0.0, 0.0))
    made = grid.finish(np.zeros((1, 2)), 0.25, 8.0)
    assert not (made.cells == OCCUPIED).any()
    assert value_at(made, (5.0, 0.0)) == FREE


def test_the_grid_grows_and_the_order_of_scans_does_not_matter():
    poses = [Pose(60.0 * k, -45.0 * k, 0.3 * k) for k in (0, 2, -1, 1)]

    def built(order):
        grid = OccupancyGrid(0.1, 6.0)
        for pose in order:
            grid.add(LaserScan(np.full(360, 4.0, np.float32), -math.pi, INCREMENT, 0.0, 30.0), pose)
            grid.add(LaserScan(np.full(360, 4.0, np.float32), -math.pi, INCREMENT, 0.0, 30.0), pose)
        return grid.finish(np.array([pose[:2] for pose in poses]), 0.25, 3.0)

    one, other = built(poses), built(poses[::-1])
    assert one.origin == other.origin
    assert (one.cells == other.cells).all()
    for pose in poses:
        assert value_at(one, pose[:2]) == FREE
    assert one.free_area > 4 * 20.0


def test_poses_that_jump_far_are_an_error_of_one_line(says):
    grid = OccupancyGrid(0.05, 10.0)
    scan_ = LaserScan(np.full(3, 4.0, np.float32), 0.0, INCREMENT, 0.0, 30.0)
    grid.add(scan_, Pose(0.0, 0.0, 0.0))
    with says.raises(InputError):
        grid.add(scan_, Pose(1e6, 1e6, 0.0))


coordinate = st.floats(1.0, 19.0)


@given(coordinate, coordinate, coordinate, coordinate)
def test_a_beam_passes_the_cells_that_lie_on_it(x0, y0, x1, y1):
    """Against many points on the beam: every cell with a good part of the beam is passed, no other one is."""
    hits, misses = np.zeros((20, 20), np.int32), np.zeros((20, 20), np.int32)
    length = math.hypot(x1 - x0, y1 - y0)
    angles = (math.atan2(y1 - y0, x1 - x0), 0.0)
    trace_beams(
        hits, misses, np.array([length], np.float32), angles, (0.0, 40.0, 80.0), True, (x0, y0, 0.0), 1.0
    )
    if length == 0.0:
        assert not hits.any()
        return
    assert hits.sum() == 1
    assert misses.max(initial=0) <= 1
    passed = misses + hits
    shares = np.linspace(0.0, float(np.float32(length)) / length, 4001)
    at = np.floor(np.column_stack((y0 + shares * (y1 - y0), x0 + shares * (x1 - x0)))).astype(int)
    counts = np.zeros((20, 20), int)
    np.add.at(counts, tuple(at.T), 1)
    assert passed[counts > 8].all()  # a cell that the beam only grazes may go to its neighbour
    rows, columns = np.nonzero(passed)
    for row, column in zip(rows, columns, strict=True):
        assert counts[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2].any()
    assert passed.sum() == abs(at[-1] - at[0]).sum() + 1 or counts[at[-1][0], at[-1][1]] <= 8


def test_the_reach_counts_along_rows_and_columns_and_around_walls():
    grid, ranges = OccupancyGrid(0.1, 5.0), np.full(360, 4.0, np.float32)
    ranges[180:270] = 1.0  # a wall ahead on the left
    for _ in range(3):
        grid.add(LaserScan(ranges, -math.pi, INCREMENT, 0.05, 30.0), Pose(0.0, 0.0, 0.0))
    made = grid.finish(np.zeros((1, 2)), 0.1, 2.0)
    for place in [(-1.7, 0.05), (0.05, -1.7), (-0.8, -0.8)]:
        assert value_at(made, place) == FREE
    for place in [(-2.5, 0.05), (0.05, -2.5), (-1.5, -1.5), (1.5, 0.6)]:
        assert value_at(made, place) == UNKNOWN


def test_a_way_is_not_joined_across_a_jump():
    points = densified(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 5.0]]), 0.25, 2.0)
    assert points.tolist() == [[0.0, 0.0], [0.25, 0.0], [0.5, 0.0], [0.75, 0.0], [1.0, 0.0], [1.0, 5.0]]


def test_the_pillar_stands_and_the_waypoints_are_free(made):
    assert value_at(made, PILLAR[:2]) == UNKNOWN  # nobody saw inside it
    assert all(value_at(made, place) == FREE for place in WAYPOINTS)
