"""What the LiCS network sees, on any lidar, and where its goal lies on a path."""

import math

import numpy as np
import pytest

from lme.planners.lics.observation import FRONT, direction_along, sweep
from lme.types import LaserScan
from tests.tolerances import KERNEL

FOV = math.radians(270.0)
RANGES = np.linspace(0.3, 4.9, 720).astype(np.float32)
JACKAL = LaserScan(RANGES, -FOV / 2, FOV / 719, 0.1, 30.0)


def test_a_jackal_s_scan_is_the_sweep_itself_clipped():
    np.testing.assert_array_equal(sweep(JACKAL, 0.0, 5.0), RANGES)
    assert sweep(JACKAL, 0.0, 2.0).max() == 2.0


def test_a_clockwise_scan_gives_the_same():
    turned = JACKAL._replace(ranges=RANGES[::-1].copy(), angle_min=FOV / 2, angle_increment=-FOV / 719)
    np.testing.assert_array_equal(sweep(turned, 0.0, 5.0), RANGES)


def test_beams_without_return_and_directions_without_beam_are_free():
    holes = RANGES.copy()
    holes[:5] = [np.nan, np.inf, 0.0, 0.05, 31.0]
    assert (sweep(JACKAL._replace(ranges=holes), 0.0, 5.0)[:5] == 5.0).all()
    half = JACKAL._replace(ranges=RANGES[:300].copy())
    assert (sweep(half, 0.0, 5.0)[300:] == 5.0).all()
    np.testing.assert_array_equal(sweep(half, 0.0, 5.0)[:300], RANGES[:300])
    assert (sweep(JACKAL._replace(ranges=np.empty(0, np.float32)), 0.0, 5.0) == 5.0).all()


@pytest.mark.parametrize("yaw", [0.0, 1.0, math.pi])
def test_a_full_circle_is_read_by_bearing_however_the_lidar_is_turned(yaw):
    bearings = np.arange(1440) * math.tau / 1440 - math.pi
    ahead = np.where(np.abs(np.angle(np.exp(1j * (bearings + yaw)))) < math.radians(40.0), 1.0, 4.0)
    full = LaserScan(ahead.astype(np.float32), -math.pi, math.tau / 1440, 0.1, 30.0)
    seen = sweep(full, yaw, 5.0)
    assert (seen[FRONT] == 1.0).mean() > 0.98
    assert (seen[: FRONT.start - 1] == 4.0).all()
    assert (seen[FRONT.stop + 1 :] == 4.0).all()


def test_the_direction_is_that_of_the_first_point_far_enough_along():
    path = np.array([[0.0, 0.0], [1.0, 0.0], [1.9, 0.0], [2.0, 1.0], [9.0, 9.0]])
    assert direction_along(path, 2.0) == pytest.approx(np.array([2.0, 1.0]) / math.sqrt(5.0), abs=KERNEL)
    assert direction_along(path[:3], 2.0) == pytest.approx([1.0, 0.0], abs=KERNEL)
    aside = path + np.array([0.0, 1.0])  # begins a metre beside the robot: counted from there
    assert direction_along(aside, 2.0) == pytest.approx(np.array([2.0, 1.0]) / math.sqrt(5.0), abs=KERNEL)
    assert direction_along(np.zeros((2, 2)), 2.0).tolist() == [0.0, 0.0]
