"""What the network sees."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from lme.planners.drl_vo.observation import (
    BINS,
    SWEEPS,
    Outlines,
    Sweeps,
    free_ahead,
    image_of,
    velocity_maps,
)
from lme.types import LaserScan, Pose
from tests.tolerances import RANGE

THREE_QUARTERS = math.radians(270.0)
BARN = {"fov": THREE_QUARTERS, "range_max": 10.0, "no_return": 10.0}
ORIGINAL = {"fov": math.pi, "range_max": 30.0, "no_return": 0.0}


def scan(ranges, fov=THREE_QUARTERS, range_max=30.0):
    """A scan from the right to the left."""
    ranges = np.asarray(ranges, np.float32)
    increment = fov / (len(ranges) - 1) if len(ranges) > 1 else 1.0
    return LaserScan(ranges, -fov / 2, increment, 0.1, range_max)


def metres(sweeps, range_max=BARN["range_max"]):
    """The ranges of the sweeps (20, 80) [m]."""
    return (sweeps.rows() + 1.0) / 2.0 * range_max


def seen(*scans, rates=(20.0, 20.0), mount_yaw=0.0, **settings):
    settings = {**BARN, **settings}
    sweeps = Sweeps(**settings, rates=rates)
    for each in scans:
        sweeps.add(each, mount_yaw)
    return metres(sweeps, settings["range_max"])


def numbered(number):
    """A scan that is recognisable."""
    return scan(np.full(720, float(number)))


def test_nine_beams_of_jackal_make_a_bin_as_in_the_authors_code():
    ranges = np.random.default_rng(0).uniform(0.2, 20.0, 720).astype(np.float32)
    bins = np.minimum(ranges, 10.0).reshape(BINS, 9)
    image = seen(scan(ranges))
    assert image.shape == (20, 80)
    for row in range(0, 20, 2):
        assert image[row] == pytest.approx(bins.min(axis=1), abs=RANGE)
        assert image[row + 1] == pytest.approx(bins.mean(axis=1), abs=RANGE)


def test_the_original_sees_the_middle_of_1080_beams():
    ranges = np.random.default_rng(1).uniform(0.2, 20.0, 1080).astype(np.float32)
    image = seen(scan(ranges), **ORIGINAL)
    assert image[0] == pytest.approx(ranges[180:900].reshape(BINS, 9).min(axis=1), abs=RANGE)


@pytest.mark.parametrize(("settings", "nothing"), [(BARN, 10.0), (ORIGINAL, 0.0)])
def test_a_beam_without_return_has_a_range_of_its_own(settings, nothing):
    ranges = np.full(720, 4.0)
    ranges[[360, 361, 362, 363]] = np.nan, np.inf, 0.05, 30.0
    image = seen(scan(ranges), **settings)
    for row, expected in ((0, min(nothing, 4.0)), (1, None)):
        middle = image[row, 40]
        assert middle == pytest.approx(expected) if expected is not None else middle != pytest.approx(4.0)
        assert image[row, 45] == pytest.approx(4.0, abs=RANGE)


def test_a_bin_that_no_beam_falls_in_is_like_one_without_return():
    narrow = scan(np.full(540, 2.0), fov=math.radians(180.0))
    assert seen(narrow)[0, [0, 12, 14, 40, 65, 67, 79]] == pytest.approx([10.0, 10.0, 2, 2, 2, 10.0, 10.0])
    assert seen(scan([]))[:2] == pytest.approx(np.full((2, BINS), 10.0))


def test_the_scan_may_be_clockwise_turned_and_of_a_full_turn():
    ranges = np.random.default_rng(2).uniform(0.2, 9.0, 720)
    full = LaserScan(ranges.astype(np.float32), -math.pi, math.tau / 720, 0.1, 30.0)
    clockwise = LaserScan(full.ranges[::-1], math.pi - math.tau / 720, -math.tau / 720, 0.1, 30.0)
    assert seen(clockwise) == pytest.approx(seen(full))
    ahead = np.roll(full.ranges, 180)  # of a lidar that is turned to the left
    assert seen(full, mount_yaw=math.pi / 2) == pytest.approx(seen(full._replace(ranges=ahead)))


# The authors' Jackal is 0.42 × 0.33 m with the lidar 0.065 m ahead of its middle; their Turtlebot's outline is 0.1 m
# ahead of its lidar and 0.1 √3 m away at ±135°.
JACKAL = Outlines((0.21, 0.165, 0.0), Pose(0.065, 0.0, 0.0), 0.1, 0.1 * math.sqrt(3.0), THREE_QUARTERS)


@pytest.mark.parametrize(
    ("degrees", "own", "turtlebot"),
    [
        (0.0, 0.145, 0.1),  # to the front
        (30.0, 0.145 / math.cos(math.radians(30.0)), 0.1 + 0.0732050808 * 30.0 / 135.0),
        (-60.0, 0.165 / math.sin(math.radians(60.0)), 0.1 + 0.0732050808 * 60.0 / 135.0),  # to the side
        (90.0, 0.165, 0.1 + 0.0732050808 * 90.0 / 135.0),
        (135.0, 0.165 * math.sqrt(2.0), 0.1732050808),
        (180.0, 0.275, 0.1732050808),  # to the rear; the authors' lidar does not see it
    ],
)
def test_a_range_counts_from_the_outline_as_in_the_authors_code(degrees, own, turtlebot):
    change = JACKAL.change(np.array([math.radians(degrees)]))
    assert change == pytest.approx([turtlebot - own], abs=1e-9)


@example(bearing=5e-324, x=0.0, y=0.0, is_disc=False)  # almost parallel to the sides
@given(st.floats(-math.pi, math.pi), st.floats(-0.15, 0.15), st.floats(-0.1, 0.1), st.booleans())
def test_the_outline_is_where_a_beam_leaves_the_footprint(bearing, x, y, is_disc):
    box = (0.0, 0.0, 0.2) if is_disc else (0.21, 0.165, 0.0)
    own = -Outlines(box, Pose(x, y, 0.0), 0.0, 0.0, math.tau).change(np.array([bearing]))[0]
    exit_x, exit_y = x + own * math.cos(bearing), y + own * math.sin(bearing)
    outward = [max(abs(exit_x) - box[0], 0.0), max(abs(exit_y) - box[1], 0.0)]
    edge = math.hypot(*outward) - box[2] if is_disc else max(abs(exit_x) - box[0], abs(exit_y) - box[1])
    assert edge == pytest.approx(0.0, abs=1e-9)


def test_a_lidar_outside_of_the_footprint_has_no_outline_before_it():
    for box in ((0.2, 0.1, 0.0), (0.0, 0.0, 0.2)):
        ahead = Outlines(box, Pose(0.3, 0.0, 0.0), 0.0, 0.0, math.pi).change(np.array([0.0, 0.5]))
        assert ahead == pytest.approx([0.0, 0.0])


def test_the_sweeps_count_from_the_outline_beams_without_return_too():
    ranges = np.full(720, 3.0)
    ranges[:9] = np.inf
    sweeps = Sweeps(**BARN, rates=(20.0, 20.0), outlines=JACKAL)
    sweeps.add(scan(ranges), 0.0)
    rows = metres(sweeps)[:2]
    bearings = np.radians(-135.0 + 270.0 / 719.0 * np.arange(720))
    change = JACKAL.change(bearings).reshape(BINS, 9)
    assert rows[0, 1:] == pytest.approx(3.0 + change.min(axis=1)[1:], abs=RANGE)
    assert rows[1, 0] == pytest.approx(10.0 + change.mean(axis=1)[0], abs=RANGE)


def test_ten_sweeps_the_oldest_first():
    rows = seen(*map(numbered, range(1, 13)), range_max=20.0)
    assert rows[0:20:2, 7] == pytest.approx(np.arange(3.0, 13.0))


def test_the_image_has_the_sweeps_four_times_and_the_pedestrians():
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 80)).astype(np.float32)
    image = image_of(rows, np.array([[5.1, 9.9, 1.0, -0.5]]))
    assert image.shape == (3, 80, 80)
    for tile in range(4):
        np.testing.assert_array_equal(image[0, 20 * tile : 20 * tile + 20], rows)
    assert image[1:, 20, 0] == pytest.approx([0.5, -0.25])


@pytest.mark.parametrize(
    ("rate", "sweeps"),
    [
        (10.0, [7, 8, 8, 9, 9, 10, 10, 11, 11, 12]),
        (50.0, [12 - 23, 12 - 20, 12 - 18, 12 - 15, 12 - 13, 12 - 10, 12 - 8, 12 - 5, 12 - 3, 12]),
    ],
)
def test_a_sweep_is_the_last_scan_that_was_there(rate, sweeps):
    """At 10 Hz, 50 ms ago the last scan was 100 ms old."""
    image = seen(*map(numbered, range(-20, 13)), rates=(rate, 20.0), range_max=40.0, no_return=0.0)
    assert image[0:20:2, 0] == pytest.approx([max(number, 0) for number in sweeps])


def test_before_the_first_scan_all_were_like_it():
    image = seen(numbered(3), numbered(5))
    assert image[0:20:2, 0] == pytest.approx([3.0] * (SWEEPS - 1) + [5.0])


def test_cleared_sweeps_are_forgotten():
    sweeps = Sweeps(**BARN, rates=(20.0, 20.0))
    sweeps.add(numbered(3), 0.0)
    sweeps.clear()
    sweeps.add(numbered(5), 0.0)
    assert metres(sweeps) == pytest.approx(np.full((20, 80), 5.0))


def test_the_rows_are_scaled_to_one():
    sweeps = Sweeps(**{**ORIGINAL, "no_return": 30.0}, rates=(20.0, 20.0))
    sweeps.add(scan(np.resize([0.1, 40.0], 720), range_max=50.0), 0.0)
    assert sweeps.rows().min() == pytest.approx(-1.0 + 0.2 / 30.0)
    assert sweeps.rows()[0].max() < sweeps.rows()[1].min() <= 1.0


@pytest.mark.parametrize(
    ("x", "y", "cell"),
    [
        (0.0, 0.0, (0, 40)),
        (5.1, 9.9, (20, 0)),
        (20.0, -10.0, (79, 79)),
        (3.0, 10.0, (12, 0)),
        (0.3, -0.3, (1, 41)),
    ],
)
def test_a_pedestrian_in_a_cell(x, y, cell):
    maps = velocity_maps(np.array([[x, y, 1.0, -0.5]]))
    assert maps[:, cell[0], cell[1]] == pytest.approx([0.5, -0.25])
    maps[:, cell[0], cell[1]] = 0.0
    assert not maps.any()


def test_pedestrians_outside_of_the_maps_and_two_in_a_cell():
    outside = [[-0.1, 0.0], [20.1, 0.0], [5.0, 10.1], [5.0, -10.1]]
    assert not velocity_maps(np.column_stack((outside, np.ones((4, 2))))).any()
    both = velocity_maps(np.array([[1.0, 1.0, 0.2, 0.2], [1.1, 0.9, 0.4, 0.6]]))
    assert both.max(axis=(1, 2)) == pytest.approx([0.2, 0.3])
    assert not velocity_maps(np.empty((0, 4))).any()


def test_free_ahead_is_the_least_return_within_45_degrees():
    ranges = np.full(720, np.inf)
    assert free_ahead(scan(ranges), 0.0) == math.inf
    ranges[[239, 480]] = 0.3  # the first beams beyond
    assert free_ahead(scan(ranges), 0.0) == math.inf
    ranges[[240, 479]] = 0.9, 0.8
    assert free_ahead(scan(ranges), 0.0) == pytest.approx(0.8)
    ranges[300] = np.nan
    ranges[301] = 0.01  # too near to be a return
    assert free_ahead(scan(ranges), 0.0) == pytest.approx(0.8)
    assert free_ahead(scan([]), 0.0) == math.inf
