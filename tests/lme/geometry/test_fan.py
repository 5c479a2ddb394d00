import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.fan import fan_blocked
from tests import oracles

SEEDS = st.integers(0, 2**32 - 1)
ORIGIN = np.zeros(2)


def polar(ranges, bearings):
    return np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])


def scene(seed):
    """Ends and points round about or in a narrow fan: apex, ends, points, radius."""
    rng = np.random.default_rng(seed)
    num_ends, num_points = rng.choice([1, 7, 40, 302]), rng.choice([1, 8, 60, 540])
    spread = rng.choice([math.pi, 1.0, 1e-3])
    ahead = rng.uniform(-math.pi, math.pi)
    ends = polar(rng.uniform(0, 5, num_ends), ahead + rng.uniform(-spread, spread, num_ends))
    least = rng.choice([0.0, 0.3, 2.0])
    points = polar(rng.uniform(least, 6, num_points), rng.uniform(-math.pi, math.pi, num_points))
    apex = rng.choice([0.0, 1.0, 8.0]) * np.array([math.cos(ahead), math.sin(ahead)])
    return apex, ends, points, rng.choice([0.02, 0.26, 1.0])


def scan_scene(seed):
    """Ends in front of and behind a wall of points all round, seen from inside or from outside."""
    rng = np.random.default_rng(seed)
    bearings = np.linspace(-math.pi, math.pi, 540, endpoint=False)
    wall = 2.5 + np.cos(bearings * rng.integers(1, 6) + rng.uniform(0, 6)) + rng.uniform(0, 0.2, 540)
    ends = polar(rng.uniform(0, 5, 302), rng.uniform(-math.pi, math.pi, 302))
    apex = rng.choice([0.0, 0.5, 10.0]) * np.array([math.cos(seed), math.sin(seed)])
    return apex, ends, polar(wall, bearings), 0.26


@given(SEEDS, st.sampled_from([scene, scan_scene]))
def test_equals_every_segment_against_every_point(seed, make):
    arguments = make(seed)
    assert np.array_equal(fan_blocked(*arguments), oracles.fan_blocked(*arguments))


@given(SEEDS)
def test_the_order_of_ends_and_points_does_not_matter(seed):
    apex, ends, points, radius = scene(seed)
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(ends))
    shuffled = fan_blocked(apex, ends[order], rng.permutation(points), radius)
    assert np.array_equal(shuffled, fan_blocked(apex, ends, points, radius)[order])


@given(SEEDS)
def test_mirroring_everything_changes_nothing(seed):
    apex, ends, points, radius = scene(seed)
    mirror = np.array([1.0, -1.0])
    mirrored = fan_blocked(apex * mirror, ends * mirror, points * mirror, radius)
    assert np.array_equal(mirrored, fan_blocked(apex, ends, points, radius))


@given(SEEDS)
def test_a_point_more_never_frees_an_end(seed):
    apex, ends, points, radius = scene(seed)
    fewer = fan_blocked(apex, ends, points[1:], radius)
    assert (fan_blocked(apex, ends, points, radius) >= fewer).all()


@given(SEEDS)
def test_ends_at_the_apex_and_twice_the_same(seed):
    apex, ends, points, radius = scene(seed)
    ends = np.vstack([np.tile(apex, (5, 1)), ends, ends])
    blocked = fan_blocked(apex, ends, points, radius)
    assert np.array_equal(blocked, oracles.fan_blocked(apex, ends, points, radius))
    once, twice = np.split(blocked[5:], 2)
    assert np.array_equal(once, twice)


def test_nothing_blocks_where_there_are_no_points():
    assert not fan_blocked(ORIGIN, np.ones((20, 2)), np.empty((0, 2)), 0.5).any()


def test_a_fan_without_ends_is_empty():
    assert fan_blocked(ORIGIN, np.empty((0, 2)), np.ones((20, 2)), 0.5).shape == (0,)


@pytest.mark.parametrize("bearing", np.linspace(-3.0, 3.0, 7))
def test_a_point_within_the_radius_of_the_apex_blocks_all_round(bearing):
    ends = polar(np.full(40, 2.0), np.linspace(-math.pi, math.pi, 40))
    points = np.tile(polar(0.2, bearing), (20, 1))
    assert fan_blocked(ORIGIN, ends, points, 0.21).all()
    assert not fan_blocked(ORIGIN, ends, points, 0.19).all()


def test_a_fan_with_all_ends_at_the_apex():
    points = np.tile([0.5, 0.0], (20, 1))
    assert fan_blocked(ORIGIN, np.zeros((20, 2)), points, 0.6).all()
    assert not fan_blocked(ORIGIN, np.zeros((20, 2)), points, 0.5).any()


@pytest.mark.parametrize("copies", [1, 20])  # tested one by one, and sorted
def test_a_distance_of_exactly_the_radius_does_not_block(copies):
    # Along +x: beside at 0.5, beyond the end at 0.5, behind the apex at 0.5; then each a hair nearer.
    ends = np.tile([2.0, 0.0], (copies, 1))
    for x, y, towards in ((1.0, 0.5, (0, -1)), (2.5, 0.0, (-1, 0)), (-0.5, 0.0, (1, 0))):
        point = np.array([x, y])
        assert not fan_blocked(ORIGIN, ends, np.tile(point, (copies, 1)), 0.5).any()
        assert fan_blocked(ORIGIN, ends, np.tile(point + 1e-9 * np.array(towards), (copies, 1)), 0.5).all()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e60, -1e154, 1e230, 1e308])
@pytest.mark.parametrize("of", ["apex", "ends", "points"])
def test_coordinates_that_overflow_harm_nothing_else(value, of):
    """A localisation that fails can put the target anywhere; the kernel must stay within its arrays."""
    apex, ends, points, radius = scan_scene(0)
    sound = fan_blocked(apex, ends, points, radius)
    changed = {"apex": apex[None], "ends": ends, "points": points}[of]
    changed[0, 1] = value
    blocked = fan_blocked(apex, ends, points, radius)
    if of == "ends":
        assert np.array_equal(blocked[1:], sound[1:])
    elif of == "points":
        assert np.array_equal(blocked, fan_blocked(apex, ends, points[1:], radius))
    assert len(blocked) == len(ends)
