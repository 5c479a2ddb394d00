import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.perception.point_cloud import (
    Projection,
    cleared_per_bin,
    rigid_transform,
    to_scan,
    without_unmeasured,
)
from lme.perception.scan_points import is_full_circle, obstacle_points
from lme.types import Pose
from tests.tolerances import KERNEL, RANGE

SEEDS = st.integers(0, 2**32 - 1)
FLOAT32, FLOAT64, INT16 = 7, 8, 3


def obvious_scan(points, projection, transform):
    """Every point in turn, as the documentation of the ROS package has it."""
    p = projection
    ranges = np.full(p.num_beams, math.inf if p.use_inf else p.range_max + p.inf_epsilon)
    for point in points:
        x, y, z, _ = transform @ [*point, 1.0]
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        counts = p.min_height <= z <= p.max_height and p.range_min <= distance <= p.range_max
        if np.isfinite(point).all() and counts and p.angle_min <= bearing <= p.angle_max:
            beam = min(int((bearing - p.angle_min) / p.angle_increment), p.num_beams - 1)
            ranges[beam] = min(ranges[beam], distance)
    return ranges


def cluttered(seed):
    """Any cloud, some of it not finite, any projection, any mount."""
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, 3.0, (rng.integers(0, 400), 3))
    points[rng.random(points.shape) < 0.02] = rng.choice([np.nan, np.inf, -np.inf])
    angles = np.sort(rng.uniform(-math.pi, math.pi, 2)) if rng.random() < 0.5 else [-math.pi, math.pi]
    projection = Projection(
        min_height=rng.uniform(-3, 0),
        max_height=rng.uniform(0, 3),
        angle_min=angles[0],
        angle_max=angles[1],
        angle_increment=(angles[1] - angles[0]) / rng.uniform(1, 300),
        range_min=rng.uniform(0, 1),
        range_max=rng.uniform(2, 9),
        use_inf=bool(rng.random() < 0.5),
    )
    return points, projection, rng.uniform(-math.pi, math.pi, 6)


@given(SEEDS)
def test_equals_every_point_looked_at_in_turn(seed):
    points, projection, mount = cluttered(seed)
    scan = to_scan(points, projection, mount)
    assert scan.ranges.dtype == np.float32
    with np.errstate(invalid="ignore"):
        expected = obvious_scan(points, projection, rigid_transform(mount))
    assert scan.ranges == pytest.approx(expected, abs=RANGE)


@given(SEEDS)
def test_order_does_not_matter_and_another_point_never_lengthens_a_beam(seed):
    points, projection, mount = cluttered(seed)
    rng = np.random.default_rng(seed)
    scan = to_scan(points, projection, mount)
    shuffled = to_scan(rng.permutation(points), projection, mount)
    np.testing.assert_array_equal(shuffled.ranges, scan.ranges)
    more = to_scan(np.vstack([points, rng.normal(0.0, 2.0, (50, 3))]), projection, mount)
    assert (more.ranges <= scan.ranges).all()


@given(SEEDS, st.integers(0, 359))
def test_turning_the_cloud_by_whole_beams_rolls_the_scan(seed, beams):
    rng = np.random.default_rng(seed)
    # Away from the borders of beams, where rounding decides.
    bearings = (rng.integers(0, 360, 200) + rng.uniform(0.1, 0.9, 200)) * (math.tau / 360)
    distances = rng.uniform(0.1, 9.0, 200)
    points = np.column_stack([distances * np.cos(bearings), distances * np.sin(bearings), np.ones(200)])
    projection = Projection(angle_increment=math.tau / 360)
    turned = to_scan(points, projection, (0, 0, 0, 0, 0, beams * math.tau / 360))
    assert turned.ranges == pytest.approx(np.roll(to_scan(points, projection).ranges, beams), abs=RANGE)


def test_defaults_are_those_of_the_ros_package():
    scan = to_scan([[1.0, 0.0, 0.1]], Projection())
    assert len(scan.ranges) == 360
    assert (scan.angle_min, scan.angle_increment) == (-math.pi, math.pi / 180)
    assert (scan.range_min, scan.range_max) == (0.0, math.inf)
    assert is_full_circle(scan)
    assert scan.ranges[180] == 1.0
    assert np.isinf(np.delete(scan.ranges, 180)).all()


@pytest.mark.parametrize(
    ("height", "counts"), [(-0.1, False), (0.0, False), (1e-300, True), (50.0, True), (math.inf, False)]
)
def test_by_default_everything_above_the_frame_counts_and_nothing_below(height, counts):
    scan = to_scan([[2.0, 0.0, height]], Projection())
    assert np.isfinite(scan.ranges).any() == counts


@pytest.mark.parametrize(("height", "counts"), [(0.09, False), (0.1, True), (0.5, True), (0.51, False)])
def test_min_height_and_max_height_are_inclusive(height, counts):
    scan = to_scan([[2.0, 0.0, height]], Projection(min_height=0.1, max_height=0.5))
    assert np.isfinite(scan.ranges).any() == counts


@pytest.mark.parametrize(("distance", "counts"), [(0.49, False), (0.5, True), (4.0, True), (4.01, False)])
def test_points_nearer_or_farther_than_the_range_are_dropped(distance, counts):
    points = [[distance, 0.0, 0.2], [3.0, 0.0, 9.0]]
    scan = to_scan(points, Projection(max_height=1.0, range_min=0.5, range_max=4.0))
    assert np.isfinite(scan.ranges).any() == counts


def test_a_point_in_the_blind_zone_does_not_hide_what_is_behind():
    scan = to_scan([[0.0, 0.0, 0.2], [0.2, 0.0, 0.2], [2.0, 0.0, 0.2]], Projection(range_min=0.35))
    assert scan.ranges[180] == 2.0


def test_a_beam_reads_the_least_horizontal_range_not_the_least_distance():
    # In space the first is nearer (2.0 against 3.2 m), on the ground the second.
    scan = to_scan([[2.0, 0.0, 0.1], [1.2, 0.0, 3.0]], Projection())
    assert scan.ranges[180] == np.float32(1.2)


@pytest.mark.parametrize(
    ("bearing_deg", "beam"), [(-179.1, 0), (-178.9, 1), (0.0, 180), (0.9, 180), (1.1, 181), (179.9, 359)]
)
def test_a_beam_holds_the_bearings_up_to_the_next(bearing_deg, beam):
    bearing = math.radians(bearing_deg)
    scan = to_scan([[math.cos(bearing), math.sin(bearing), 0.5]], Projection())
    assert np.flatnonzero(np.isfinite(scan.ranges)).tolist() == [beam]


def test_straight_behind_is_the_last_beam():
    # At exactly π the ROS package writes past the end of its array.
    assert np.flatnonzero(np.isfinite(to_scan([[-1.0, 0.0, 0.5]], Projection()).ranges)).tolist() == [359]


def test_points_outside_the_angles_are_dropped():
    ahead, left, behind = [1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [-1.0, 0.0, 0.5]
    scan = to_scan([ahead, left, behind], Projection(angle_min=-1.0, angle_max=1.0, angle_increment=0.5))
    assert scan.ranges.tolist() == [math.inf, math.inf, 1.0, math.inf]


def test_without_inf_an_empty_beam_reads_beyond_the_range():
    projection = Projection(range_max=10.0, use_inf=False, inf_epsilon=0.5)
    scan = to_scan([[2.0, 0.0, 0.5]], projection)
    assert set(scan.ranges.tolist()) == {2.0, 10.5}
    assert len(obstacle_points(scan, Pose(0.0, 0.0, 0.0))) == 1


@pytest.mark.parametrize(
    ("angle", "increment", "beams"),
    [
        (math.pi, 0.003, 2095),  # 2094.4: the last beam is cut short
        (1.0, 0.1, 20),
        (1.57, 0.01, 315),  # 314.00003 in the float32 of the message
        (math.pi, 0.0174532925, 360),  # 360.0000004 in float64
    ],
)
def test_as_many_beams_as_the_ros_package_makes(angle, increment, beams):
    assert Projection(angle_min=-angle, angle_max=angle, angle_increment=increment).num_beams == beams


def test_an_empty_cloud_is_an_empty_scan():
    assert np.isinf(to_scan(np.empty((0, 3)), Projection()).ranges).all()


@given(SEEDS)
def test_the_policy_sees_obstacles_where_they_are_to_a_beam(seed):
    rng = np.random.default_rng(seed)
    point = np.array([*rng.uniform(-5, 5, 2), 0.5])
    (seen,) = obstacle_points(to_scan(point[None], Projection(range_max=20.0)), Pose(0.0, 0.0, 0.0))
    assert math.dist(seen, point[:2]) <= math.radians(1.0) * math.hypot(*point[:2]) + RANGE


def test_a_mount_by_hand():
    # 0.4 m up, pitched nose down by 90°: what the sensor sees ahead lies below it.
    down = rigid_transform((0.1, 0.2, 0.4, 0.0, math.pi / 2, 0.0))
    assert down @ [0.3, 0.0, 0.0, 1.0] == pytest.approx([0.1, 0.2, 0.1, 1.0], abs=KERNEL)
    # Rolled over and turned left: its left is the robot's right, (0, −1, 0), and then ahead.
    over = rigid_transform((0.0, 0.0, 0.0, math.pi, 0.0, math.pi / 2))
    assert over @ [0.0, 1.0, 0.0, 1.0] == pytest.approx([1.0, 0.0, 0.0, 1.0], abs=KERNEL)
    # Roll before pitch before yaw, about fixed axes: up → right → right → ahead.
    turned = rigid_transform((0.0, 0.0, 0.0, math.pi / 2, math.pi / 2, math.pi / 2))
    assert turned @ [0.0, 0.0, 1.0, 1.0] == pytest.approx([1.0, 0.0, 0.0, 1.0], abs=KERNEL)


@given(SEEDS)
def test_a_matrix_and_its_six_numbers_say_the_same(seed):
    points, projection, mount = cluttered(seed)
    matrix = rigid_transform(mount)
    np.testing.assert_array_equal(rigid_transform(matrix), matrix)
    assert matrix[:3, :3] @ matrix[:3, :3].T == pytest.approx(np.eye(3), abs=KERNEL)
    by_matrix, by_numbers = to_scan(points, projection, matrix), to_scan(points, projection, mount)
    np.testing.assert_array_equal(by_matrix.ranges, by_numbers.ranges)


@pytest.mark.parametrize(
    "mount",
    [(0, 0, 0), (0, 0, math.nan, 0, 0, 0), np.eye(3), 2 * np.eye(4), np.diag([1, 1, -1, 1]), np.ones((4, 4))],
)
def test_a_mount_that_is_not_a_rigid_transform_is_refused(mount, says):
    with says.raises(InputError):
        rigid_transform(mount)


@pytest.mark.parametrize("points", [np.zeros(3), np.zeros((4, 2)), np.zeros((2, 2, 3))])
def test_points_of_another_shape_are_refused(points, says):
    with says.raises(InputError):
        to_scan(points, Projection())


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("angle_increment", 0.0),
        ("angle_increment", 1e-9),
        ("angle_min", -4.0),
        ("angle_max", 6.28),
        ("range_min", -1.0),
        ("range_max", math.nan),
        ("max_height", -1.0),
        ("min_height", math.nan),
        ("use_inf", False),
    ],
)
def test_bad_projections_are_named(key, value, says):
    with says.raises(InputError, match=key):
        Projection(**{key: value})


# Bins without points


LOW, HIGH, SENSOR = 0.05, 0.5, np.array([0.0, 0.0, 0.45])
BAND = Projection(min_height=LOW, max_height=HIGH, angle_increment=math.pi / 2, range_max=20.0)


def ray_ends(bearing, elevations, distance):
    """Where rays of a lidar at `SENSOR` meet the floor, or a high wall at a distance [m]."""
    ends = []
    for elevation in elevations:
        reach = distance if elevation >= 0.0 else min(distance, SENSOR[2] / math.tan(-elevation))
        height = SENSOR[2] + reach * math.tan(elevation)
        ends.append((reach * math.cos(bearing), reach * math.sin(bearing), height))
    return np.array(ends)


@pytest.mark.parametrize(
    ("elevations", "distance", "expected"),
    [
        ((-0.12, 0.0, 0.3), 1.9, 1.9),  # a level lidar sees the wall
        ((0.03, 0.1, 0.3), 1.9, math.nan),  # one that is tilted up sees only what is too high
        ((-0.12, 0.03, 0.3), 15.0, math.inf),  # one ray meets the floor 3.7 m away: free
        ((0.3, 0.6), 15.0, math.nan),
    ],
)
def test_a_bin_that_no_ray_crosses_is_not_measured(elevations, distance, expected):
    cloud = ray_ends(-3.0, elevations, distance)  # in the first of four bins
    scan = without_unmeasured(to_scan(cloud, BAND), cloud, SENSOR, BAND)
    np.testing.assert_allclose(scan.ranges[0], expected, rtol=1e-6)
    assert np.isnan(scan.ranges[1:]).all()


@given(
    st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-0.5, 2.0)), min_size=1, max_size=20),
    st.floats(0.06, 0.49),
)
def test_the_cleared_distance_is_that_of_the_slow_twin(points, height):
    """Walk along each ray in short steps, and note where it was last between the heights."""
    sensor, cloud = np.array([0.1, -0.2, height]), np.array(points)
    cleared = cleared_per_bin(cloud, sensor, (LOW, HIGH), (-math.pi, math.pi / 2, 4))
    expected = np.zeros(4)
    for point in cloud:
        track = sensor + np.linspace(0.0, 1.0, 4001)[:, None] * (point - sensor)
        last = track[(track[:, 2] >= LOW - 1e-9) & (track[:, 2] <= HIGH + 1e-9)][-1]
        bearing = (math.atan2(last[1], last[0]) + math.pi) / (math.pi / 2)
        assume(abs(bearing - round(bearing)) > 0.02)
        bin_number = int(bearing)
        expected[bin_number] = max(expected[bin_number], math.dist(last[:2], sensor[:2]))
    np.testing.assert_allclose(cleared, expected, atol=0.005)
