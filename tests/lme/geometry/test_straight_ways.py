"""Straight ways: a free one is free for a footprint that turns and drives in small steps; what clears is free."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.collision import sweep
from lme.geometry.straight_ways import reachable, straight_ways

JACKAL, DISC, QUADRUPED = (0.21, 0.155, 0.0), (0.0, 0.0, 0.2), (0.35, 0.155, 0.0)
LONG = [JACKAL, DISC, QUADRUPED, (0.3, 0.1, 0.1)]
BOXES = st.sampled_from([*LONG, (0.12, 0.2, 0.0)])
MARGIN, TURN_MARGIN = 0.08, 0.05
STEP = 0.005  # [m] between two poses of the slow sweep
NO_EDGES = np.empty((0, 4))


def free(places, points, box=JACKAL, margin=MARGIN, turn_margin=TURN_MARGIN):
    places, points = (np.array(each, dtype=float).reshape(-1, 2) for each in (places, points))
    return straight_ways(places, points, box, margin, turn_margin)


def clears(poses, points, box, margin):
    """Whether the footprint, grown by the margin with round corners, touches no point at any of the poses."""
    circles = np.column_stack((points, np.full(len(points), margin)))
    return sweep(np.asarray(poses), box, circles, NO_EDGES)[1] < 0


def swept(place, points, box, margin, turn_margin):
    """The same, first in the turn and then straight ahead."""
    bearing, away = math.atan2(place[1], place[0]), math.hypot(*place)
    turns = np.linspace(0.0, bearing, math.ceil(abs(bearing) / STEP * 0.4) + 2)
    ways = np.linspace(0.0, away, math.ceil(away / STEP) + 2)
    turn = np.column_stack((np.zeros((len(turns), 2)), turns))
    drive = np.column_stack((ways * math.cos(bearing), ways * math.sin(bearing), np.full(len(ways), bearing)))
    return clears(turn, points, box, turn_margin) and clears(drive, points, box, margin)


def scene(seed, box, least):
    """Places, and points that are at least `least` from the robot."""
    rng = np.random.default_rng(seed)
    places, points = rng.uniform(-1.5, 1.5, (12, 2)), rng.uniform(-1.8, 1.8, (rng.integers(0, 10), 2))
    away = [clears([[0.0, 0.0, 0.0]], point[None], box, least) for point in points]
    return places, points[np.array(away, dtype=bool)]


@given(st.integers(0, 10**6), BOXES)
def test_a_free_way_is_free_to_drive(seed, box):
    places, points = scene(seed, box, 0.0)
    for place in places[free(places, points, box)]:
        assert swept(place, points, box, 0.0, 0.0)


@given(st.integers(0, 10**6), BOXES, st.sampled_from([1, 12]))
def test_tight_ways_count_half_where_no_other_is_free(seed, box, number):
    places, points = scene(seed, box, 0.0)
    places, tight = places[:number], 0.75
    wide, narrow = (free(places, points, box, share * MARGIN, share * TURN_MARGIN) for share in (1.0, tight))
    expected = wide if wide.any() else 0.5 * narrow
    found = reachable(places, points, box, MARGIN, TURN_MARGIN, tight)
    assert found.tolist() == expected.tolist()


@given(st.integers(0, 10**6), st.sampled_from(LONG))
def test_a_way_that_keeps_the_margins_is_free(seed, box):
    places, points = scene(seed, box, MARGIN)
    found = free(places, points, box)
    for k, place in enumerate(places):
        assert found[k] or not swept(place, points, box, MARGIN + STEP, TURN_MARGIN + STEP)


@pytest.mark.parametrize("side", [1, -1])
def test_sides_and_front_keep_the_margin(side):
    beside = 0.155 + MARGIN
    for off, is_free in ((beside - 0.001, False), (beside + 0.001, True)):
        assert free([(2.0, 0.0)], [(1.0, side * off)]).tolist() == [is_free]
    front = 0.21 + MARGIN
    for ahead, is_free in ((front - 0.001, False), (front + 0.001, True)):
        assert free([(2.0, 0.0)], [(2.0 + ahead, 0.0)]).tolist() == [is_free]


def test_a_turn_needs_room_for_the_corners():
    # Beside the middle, 5 cm off the side: straight ahead passes it, a turn's corner would meet it.
    point = [(0.0, 0.245)]
    places = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]
    assert free(places, point).tolist() == [True, False, False, False]
    assert free(places, point, box=(0.0, 0.0, 0.16)).tolist() == [
        True,
        False,
        True,
        True,
    ]  # a disc only meets it


def test_a_point_within_the_margin_must_come_no_nearer():
    point = [(-0.02, 0.2)]  # 4.5 cm off the side
    assert free([(1.0, 0.0)], point).tolist() == [True]
    assert free([(1.0, 0.0)], [(0.02, 0.2)]).tolist() == [True]
    assert free([(1.0, 0.3)], [(0.1, 0.2)]).tolist() == [False]


@given(st.integers(0, 10**6), BOXES)
def test_a_mirrored_scene_has_the_mirrored_ways(seed, box):
    places, points = scene(seed, box, 0.0)
    flip = np.array([1.0, -1.0])
    np.testing.assert_array_equal(free(places * flip, points * flip, box), free(places, points, box))


def test_without_points_every_way_is_free():
    assert free([(1.0, 0.0), (-1.0, 0.5), (0.0, 0.0)], []).all()
    assert free([], [(1.0, 0.0)]).shape == (0,)
