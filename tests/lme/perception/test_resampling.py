"""Scans of any lidar: orientation, conventions for "no return", and the same scene on other beams."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.perception.raycast import cast_shapes
from lme.perception.resampling import own_lidar, resampled, same_lidar, tidied
from lme.perception.scan_points import obstacle_points
from lme.robots import Lidar
from lme.types import LaserScan, Pose
from tests.tolerances import KERNEL, RANGE

HERE = Pose(0.0, 0.0, 0.0)
GRAZING = math.radians(80.0)


def scan(ranges, angle_min=-1.0, increment=0.5, limits=(0.1, 10.0)):
    return LaserScan(np.array(ranges, np.float32), angle_min, increment, *limits)


def by_bearing(scan):
    """{bearing [rad], rounded and in (−π, π]: range} of the returns."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    pairs = zip(angles, scan.ranges, strict=True)
    return {round(math.remainder(a, math.tau), 6): float(r) for a, r in pairs if np.isfinite(r)}


# Conventions


def test_a_tidy_scan_stays_as_it_is():
    given_scan = scan([1, 2, 3, 4, 5])
    tidy = tidied(given_scan)
    np.testing.assert_array_equal(tidy.ranges, given_scan.ranges)
    assert tidy[1:] == given_scan[1:]


def test_a_clockwise_scan_is_turned_round_not_mirrored():
    turned = tidied(scan([1, 2, 3, 4], angle_min=1.2, increment=-0.4))
    assert turned.angle_increment == 0.4
    assert by_bearing(turned) == {1.2: 1, 0.8: 2, 0.4: 3, 0.0: 4}


def test_upside_down_left_is_right():
    assert by_bearing(tidied(scan([1, 2, 3, 4, 5]), upside_down=True)) == {
        1.0: 1,
        0.5: 2,
        0.0: 3,
        -0.5: 4,
        -1.0: 5,
    }


def test_upside_down_and_clockwise_is_counter_clockwise():
    same = tidied(scan([1, 2, 3], angle_min=0.5, increment=-0.5), upside_down=True)
    np.testing.assert_array_equal(same.ranges, [1, 2, 3])
    assert (same.angle_min, same.angle_increment) == (-0.5, 0.5)


@pytest.mark.parametrize("nothing", [math.inf, -math.inf, math.nan, 0.0, -1.0, 0.0999, 10.0, 65.533])
def test_every_way_to_say_no_return(nothing):
    ranges = tidied(scan([1, nothing, 2])).ranges
    assert list(np.isfinite(ranges)) == [True, False, True]


def test_a_beam_that_failed_stays_unknown():
    ranges = tidied(scan([1, math.nan, math.inf, 0.0])).ranges
    np.testing.assert_array_equal(ranges, np.array([1, math.nan, math.inf, math.inf], np.float32))


def test_a_range_of_zero_is_not_a_return_even_where_range_min_is_zero():
    assert np.isinf(tidied(scan([0, 1], limits=(0.0, 10.0))).ranges[0])


def test_a_sweep_that_ends_where_it_began_loses_the_double():
    assert len(tidied(scan(np.ones(361), -math.pi, math.radians(1))).ranges) == 360
    assert len(tidied(scan(np.ones(360), -math.pi, math.radians(1))).ranges) == 360


def test_the_given_scan_is_not_touched():
    ranges = np.array([0.0, 1.0, np.nan], np.float32)
    tidied(LaserScan(ranges, 1.0, -0.5, 0.1, 10.0))
    np.testing.assert_array_equal(ranges, np.array([0.0, 1.0, np.nan], np.float32))


@pytest.mark.parametrize(
    "bad",
    [
        scan([1]),
        scan([1, 2], increment=0.0),
        scan([1, 2], angle_min=math.nan),
        scan([1, 2], limits=(0.1, math.inf)),
        scan([1, 2], limits=(5.0, 1.0)),
    ],
)
def test_invalid_scans_are_refused(bad, says):
    with says.raises(InputError):
        tidied(bad)


# The lidar it comes from


@given(st.integers(2, 40), st.floats(-4.0, 4.0), st.floats(0.01, 0.15), st.floats(-3.0, 3.0), st.booleans())
def test_the_own_lidar_sees_the_same_points(num_beams, angle_min, increment, yaw, full):
    if full:
        increment = math.tau / num_beams
    given_scan = scan(np.linspace(1, 5, num_beams), angle_min, increment)
    mount = Pose(0.2, -0.1, yaw)
    lidar, own = own_lidar(given_scan, mount)
    assert lidar.full_circle == full
    assert own.angle_min == lidar.angle_min
    before = obstacle_points(given_scan, mount)
    after = obstacle_points(own, lidar.mount)
    distance = np.linalg.norm(before[:, None] - after[None], axis=2)
    assert distance.min(axis=1).max() < 1e-6


def test_a_lidar_is_known_again_from_what_float32_leaves_of_it():
    lidar = Lidar(720, math.radians(270), 0.1, 30.0, 0.001, x=0.055)
    told = (float(np.float32(value)) for value in (lidar.angle_min, lidar.angle_increment, 0.1, 30.0))
    found, _ = own_lidar(LaserScan(np.ones(720, np.float32), *told), lidar.mount)
    assert same_lidar(found, lidar)
    for change in (
        {"x": 0.06},
        {"yaw": 0.01},
        {"fov": math.radians(269)},
        {"num_beams": 719},
        {"range_max": 10.0},
    ):
        other = {
            key: getattr(lidar, key)
            for key in ("num_beams", "fov", "range_min", "range_max", "x", "y", "yaw")
        }
        assert not same_lidar(found, Lidar(**{**other, **change}))


# On other beams


def slow_twin(scan, mount, lidar):
    """Every beam against every return and every piece between neighbours."""
    angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges)) + mount.yaw
    valid = np.isfinite(scan.ranges)
    far = np.where(valid, scan.ranges, 0.0)
    xy = np.column_stack((mount.x + far * np.cos(angles), mount.y + far * np.sin(angles)))
    cos, sin = math.cos(lidar.yaw), math.sin(lidar.yaw)
    xy = (xy - [lidar.x, lidar.y]) @ np.array([[cos, -sin], [sin, cos]])
    full = (len(scan.ranges) + 0.5) * scan.angle_increment >= math.tau
    pieces = [
        (i, (i + 1) % len(xy))
        for i in range(len(xy) if full else len(xy) - 1)
        if valid[i] and valid[(i + 1) % len(xy)]
    ]
    widest = 2 * math.sin(scan.angle_increment / 2) / math.cos(GRAZING)
    out = np.full(lidar.num_beams, np.inf)
    for k in range(lidar.num_beams):
        beam = lidar.angle_min + k * lidar.angle_increment
        ahead = np.array([math.cos(beam), math.sin(beam)])
        for i in np.flatnonzero(valid):
            off = math.remainder(math.atan2(xy[i][1], xy[i][0]) - beam, math.tau)
            if abs(off) < lidar.angle_increment / 2:
                out[k] = min(out[k], np.hypot(*xy[i]))
        for i, j in pieces:
            if np.hypot(*(xy[j] - xy[i])) > widest * max(scan.ranges[i], scan.ranges[j]):
                continue
            side = [ahead[0] * xy[n][1] - ahead[1] * xy[n][0] for n in (i, j)]
            if side[0] * side[1] < 0:
                hit = xy[i] + (xy[j] - xy[i]) * side[0] / (side[0] - side[1])
                if hit @ ahead > 0:
                    out[k] = min(out[k], np.hypot(*hit))
    out[(out < lidar.range_min) | (out >= lidar.range_max)] = np.inf
    return out


@given(st.data())
def test_resampling_is_its_slow_twin(data):
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    beams = int(rng.integers(8, 40))
    fov = math.tau if data.draw(st.booleans()) else rng.uniform(1.0, 6.0)
    increment = fov / beams if fov == math.tau else fov / (beams - 1)
    ranges = np.cumsum(rng.normal(0, 0.3, beams)) + 4
    ranges[(rng.random(beams) < 0.2) | (ranges < 0.6)] = np.inf
    before = scan(ranges, rng.uniform(-3, 3), increment, (0.1, 30.0))
    onto = Lidar(int(rng.integers(8, 50)), math.tau if rng.random() < 0.5 else rng.uniform(1, 6), 0.1, 20.0,
                 x=rng.uniform(-0.2, 0.2), y=rng.uniform(-0.2, 0.2), yaw=rng.uniform(-3, 3))  # fmt: skip
    mount = Pose(rng.uniform(-0.2, 0.2), 0.1, rng.uniform(-3, 3))
    after = resampled(before, mount, onto).ranges
    expected = slow_twin(before, mount, onto)
    finite = np.isfinite(expected)
    np.testing.assert_array_equal(np.isfinite(after), finite)
    np.testing.assert_allclose(after[finite], expected[finite], rtol=1e-5)


def test_resampling_onto_the_same_beams_changes_nothing():
    rng = np.random.default_rng(1)
    ranges = rng.uniform(0.5, 9.0, 270).astype(np.float32)
    ranges[::7] = np.inf
    lidar, own = own_lidar(scan(ranges, -2.0, 0.01), Pose(0.1, 0.0, 0.3))
    np.testing.assert_allclose(resampled(own, lidar.mount, lidar).ranges, ranges, rtol=1e-6)


@pytest.mark.parametrize("native", [None, 90])
def test_beams_that_failed_stay_unknown_on_finer_beams(native):
    ranges = np.full(90, 3.0)
    ranges[10:20], ranges[40:50] = math.nan, math.inf
    coarse = scan(ranges, -math.pi, math.tau / 90, (0.05, 12.0))
    fine = Lidar(720, math.tau, 0.05, 12.0, yaw=0.5, native_beams=native)
    turned = resampled(tidied(coarse), HERE, fine).ranges
    bearings = fine.angle_min + fine.angle_increment * np.arange(720) + fine.yaw
    old = np.round((bearings + math.pi) % math.tau / (math.tau / 90)).astype(int) % 90
    inside = np.isin(old - 10, range(1, 9)), np.isin(old - 40, range(1, 9))
    assert np.isnan(turned[inside[0]]).all()
    assert np.isinf(turned[inside[1]]).all()
    assert np.isnan(turned).sum() <= 88  # and nowhere else
    assert np.isfinite(turned).sum() > 540


def test_a_wall_seen_from_another_place_stays_a_wall():
    """A finer lidar elsewhere on the robot: interpolated beams meet the true wall."""
    walls = np.array([[3.0, -9.0, 3.0, 9.0]])
    coarse = Lidar(180, math.tau, 0.05, 12.0)
    fine = Lidar(720, math.radians(120), 0.05, 12.0, x=0.2, y=0.1, yaw=0.2)
    none = np.empty((0, 3))
    before = cast_shapes(HERE, (coarse.angle_min, coarse.angle_increment, 180), 12.0, none, walls)
    after = resampled(
        tidied(LaserScan(before, coarse.angle_min, coarse.angle_increment, 0.05, 12.0)), HERE, fine
    )
    truth = cast_shapes(fine.mount, (fine.angle_min, fine.angle_increment, 720), 12.0, none, walls)
    near = truth < 6.0
    np.testing.assert_allclose(after.ranges[near], truth[near], atol=RANGE + 5e-2)
    inner = near & (np.abs(fine.angle_min + fine.angle_increment * np.arange(720) + 0.2) < 0.8)
    assert np.isfinite(after.ranges[inner]).all()


def test_beams_are_not_interpolated_across_a_depth_edge():
    step = scan([1, 1, 1, 4, 4, 4], angle_min=-0.25, increment=0.1)
    fine = Lidar(101, 0.5, 0.1, 10.0)
    ranges = resampled(step, HERE, fine).ranges
    seen = ranges[np.isfinite(ranges)]
    assert not ((seen > 1.02) & (seen < 3.9)).any()
    assert np.isinf(ranges[45:55]).any()


def test_unseen_directions_stay_unknown():
    half = scan(np.full(91, 2.0), -math.pi / 2, math.radians(2))
    circle = Lidar(360, math.tau, 0.1, 10.0)
    ranges = resampled(half, HERE, circle).ranges
    bearings = circle.angle_min + circle.angle_increment * np.arange(360)
    np.testing.assert_array_equal(np.isfinite(ranges), np.abs(bearings) <= math.pi / 2 + KERNEL)


def test_the_nearest_return_wins_where_beams_grow_fewer():
    ranges = np.full(361, 5.0)
    ranges[180] = 1.0
    few = Lidar(19, math.radians(180), 0.1, 10.0)
    after = resampled(scan(ranges, -math.pi / 2, math.radians(0.5)), HERE, few).ranges
    assert after[9] == 1.0
    np.testing.assert_allclose(np.delete(after, 9), 5.0, atol=1e-3)


@given(st.integers(0, 2**32 - 1))
def test_native_beams_are_interpolated_linearly_in_the_bearing(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(8, 60))
    ranges = rng.uniform(0.5, 9.0, count).astype(np.float32)
    onto = Lidar(int(rng.integers(4, 80)), math.tau, 0.1, 10.0, yaw=rng.uniform(-3, 3), native_beams=count)
    scan = LaserScan(ranges, rng.uniform(-4, 4), math.tau / count, 0.1, 10.0)
    mount = Pose(0.0, 0.0, rng.uniform(-3, 3))
    bearing = onto.yaw + onto.angle_min + onto.angle_increment * np.arange(onto.num_beams)
    source = mount.yaw + scan.angle_min + scan.angle_increment * np.arange(count)
    expected = np.interp(bearing, source, ranges, period=math.tau)
    assert resampled(scan, mount, onto).ranges == pytest.approx(expected, abs=1e-4)


def test_interpolation_crosses_depth_edges_but_not_gaps():
    ranges = np.array([1.0, 5.0, np.inf, np.inf, 2.0, 2.0, 2.0, 2.0], np.float32)
    onto = Lidar(32, math.tau, 0.1, 10.0, native_beams=8)
    seen = resampled(LaserScan(ranges, -math.pi, math.tau / 8, 0.1, 10.0), Pose(0.0, 0.0, 0.0), onto).ranges
    assert seen[:5] == pytest.approx([1.0, 2.0, 3.0, 4.0, 5.0], abs=1e-4)  # points between two surfaces
    assert seen[5] == pytest.approx(5.0)  # nearer to the return than to the gap
    assert np.isinf(seen[7:14]).all()
    assert seen[15:29] == pytest.approx(2.0)


def test_interpolation_leaves_the_blind_arc_empty():
    ranges = np.full(10, 2.0, np.float32)
    onto = Lidar(36, math.tau, 0.1, 10.0, native_beams=10)
    scan = LaserScan(ranges, 0.0, math.radians(10), 0.1, 10.0)  # 0° to 90°
    seen = resampled(scan, Pose(0.0, 0.0, 0.0), onto).ranges
    bearing = np.arange(-180, 180, 10)
    np.testing.assert_array_equal(np.isfinite(seen), (bearing >= 0) & (bearing <= 90))
