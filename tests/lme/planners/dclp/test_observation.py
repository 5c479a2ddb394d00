"""What the network sees. Its frame has x to the right and y ahead."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.perception.scan_points import beam_directions
from lme.planners.dclp.observation import DIRECTIONS, nearest_by_direction, nearest_returns
from lme.types import LaserScan, Pose
from tests import oracles
from tests.tolerances import KERNEL, RANGE

AT_BASE = Pose(0.0, 0.0, 0.0)
NO_RETURN, BLIND = 5.0, 4.0

SECTORS = 12
MIDDLES = beam_directions(math.pi / SECTORS, math.tau / SECTORS, SECTORS)


def scan(num_beams=720, fov=math.tau, returns=()):
    """A scan without returns but those: (bearing [rad], range [m])."""
    increment = fov / (num_beams if fov == math.tau else num_beams - 1)
    ranges = np.full(num_beams, np.inf, np.float32)
    for bearing, reach in returns:
        ranges[round((bearing + fov / 2) / increment)] = reach
    return LaserScan(ranges, -fov / 2, increment, 0.1, 30.0)


def seen(scan, mount=AT_BASE):
    return nearest_by_direction(scan, mount, NO_RETURN, BLIND)


def test_ninety_directions_of_no_return():
    directions = seen(scan())
    assert directions.shape == (DIRECTIONS, 3)
    assert directions[:, 2] == pytest.approx(np.full(DIRECTIONS, NO_RETURN))
    angles = np.arange(DIRECTIONS) * math.radians(4.0)  # of the first beam of eight, from the right
    assert directions[:, :2] == pytest.approx(np.column_stack((np.cos(angles), np.sin(angles))))


def test_the_nearest_return_of_a_direction_with_its_own_bearing():
    bearings = [math.radians(degrees) for degrees in (4.0, 2.5, 5.5)]  # all in the direction of 2° to 6°
    directions = seen(scan(returns=zip(bearings, (3.0, 2.0, 2.5), strict=True)))
    (nearest,) = directions[directions[:, 2] < NO_RETURN - RANGE]
    assert nearest == pytest.approx([-math.sin(bearings[1]), math.cos(bearings[1]), 2.0])


def test_a_return_beyond_the_range_of_no_return_gives_way_to_it_within_a_direction():
    far = [(math.radians(2.0 + degrees / 2), 9.0) for degrees in range(8)]  # one direction
    assert seen(scan(returns=far)).max(axis=0)[2] == pytest.approx(9.0)
    assert seen(scan(returns=far[:7])).max(axis=0)[2] == pytest.approx(NO_RETURN)


def test_the_lidar_may_sit_anywhere():
    ahead = scan(returns=[(0.0, 1.0)])
    middle = DIRECTIONS // 4
    assert seen(ahead, Pose(0.065, 0.0, 0.0))[middle] == pytest.approx([0.0, 1.0, 1.065])
    assert seen(ahead, Pose(0.0, 1.0, 0.0))[middle] == pytest.approx([-(0.5**0.5), 0.5**0.5, 2**0.5])
    turned = seen(ahead, Pose(0.0, 0.0, math.pi / 2))
    assert turned[turned[:, 2].argmin()] == pytest.approx([-1.0, 0.0, 1.0])


def test_a_blind_arc_of_a_quarter():
    directions = seen(scan(fov=math.radians(270.0)))
    blind = directions[:, 2] < NO_RETURN - RANGE
    assert blind.sum() == 21  # of 22.5: the two at its edges are seen in part
    assert directions[blind, 2] == pytest.approx(np.full(21, BLIND))
    assert directions[blind, 1].max() < -(0.5**0.5)  # all behind


def test_an_empty_scan_is_blind():
    assert seen(scan()._replace(ranges=np.empty(0, np.float32)))[:, 2] == pytest.approx(
        np.full(DIRECTIONS, BLIND)
    )


@given(st.integers(0, 2**32 - 1))
def test_equals_looking_at_every_sector(seed):
    rng = np.random.default_rng(seed)
    num_beams = int(rng.integers(0, 60))
    start, increment = rng.uniform(-7, 7), rng.choice([-1, 1]) * rng.uniform(0.01, 0.1)
    angles = start + increment * np.arange(num_beams)
    sectors = np.floor(angles / (math.tau / SECTORS)).astype(np.int64) % SECTORS
    ranges = rng.choice([0.5, 1.0, 2.0, 5.0, 0.0, np.nan, np.inf, 30.0], num_beams).astype(np.float32)
    limits, offset = (0.1, 30.0, 5.0), tuple(rng.uniform(-0.3, 0.3, 2))
    given = (ranges, sectors, beam_directions(start, increment, num_beams), limits, 4.0 * MIDDLES, offset)
    wanted = oracles.nearest_returns(ranges, sectors, angles, limits, 4.0 * MIDDLES, offset)
    assert nearest_returns(*given) == pytest.approx(wanted, abs=KERNEL)


def test_a_return_at_the_base_has_no_direction():
    middle = np.array([[1.0, 0.0]])
    (seen,) = nearest_returns(
        np.array([0.5], np.float32), np.zeros(1, np.int64), middle, (0.1, 9.0, 5.0), middle, (-0.5, 0.0)
    )
    assert list(seen) == [0.0, 0.0, 0.0]
