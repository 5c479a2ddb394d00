import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.guides.lme.surmount import cluster
from tests import oracles

SEEDS = st.integers(0, 2**32 - 1)


def polar(ranges, bearings):
    return np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings)])


def assert_equals_oracle(points, gap, full_circle):
    sectors, closed = cluster(points, gap, full_circle)
    expected, expected_closed = oracles.cluster(points, gap, full_circle)
    assert sectors.tolist() == expected.tolist()
    assert closed == expected_closed


def scattered(rng, bearings):
    return rng.uniform(0.05, 3, len(bearings))


def spiral(rng, bearings):
    return np.linspace(rng.uniform(0.1, 1), rng.uniform(0.1, 3), len(bearings))


def ring(rng, bearings):
    return np.full(len(bearings), rng.uniform(0.1, 3))


def layers(rng, bearings):
    return rng.choice([0.5, 2.0, 2.3, 4.0], len(bearings))


def runs(rng, bearings):
    """Stretches of wall at different distances, as in a scan of a cluttered world."""
    lengths = rng.integers(1, 40, len(bearings) + 1)
    return np.repeat(rng.uniform(0.3, 4, len(lengths)), lengths)[: len(bearings)]


@settings(max_examples=200)
@given(SEEDS, st.sampled_from([scattered, spiral, ring, layers, runs]), st.booleans())
def test_equals_every_pair_of_points(seed, shape, full_circle):
    rng = np.random.default_rng(seed)
    fov = rng.choice([math.pi, 3.0, 2.4, 0.5])
    bearings = np.sort(rng.uniform(-fov, fov, rng.choice([1, 2, 3, 12, 60, 300])))
    assert_equals_oracle(polar(shape(rng, bearings), bearings), rng.uniform(0.02, 1.2), full_circle)


@given(SEEDS, st.booleans())
def test_pairs_across_plus_minus_pi(seed, full_circle):
    rng = np.random.default_rng(seed)
    behind = math.pi - rng.uniform(0, 0.2, 6)
    bearings = np.sort(np.concatenate([behind[:3], -behind[3:], rng.uniform(-2, 2, 5)]))
    assert_equals_oracle(polar(rng.uniform(0.5, 2, 11), bearings), 0.4, full_circle)


@settings(max_examples=200)
@given(SEEDS)
def test_cluster_agrees_with_the_oracle_near_the_robot(seed):
    # Around the origin itself arcs are long, and points on opposite sides are near each other.
    rng = np.random.default_rng(seed)
    bearings = np.sort(rng.uniform(-math.pi, math.pi, rng.integers(2, 30)))
    assert_equals_oracle(polar(rng.uniform(0.01, 0.4, len(bearings)), bearings), 0.3, True)


@given(SEEDS, st.integers(0, 60))
def test_turning_the_scan_turns_the_sectors(seed, shift):
    # An odd number of beams: no two are opposite, where neither arc between them is the shorter.
    rng = np.random.default_rng(seed)
    bearings = (np.arange(61) - 30) * math.tau / 61
    ranges = rng.uniform(0.2, 3, 61)
    sectors, closed = cluster(polar(ranges, bearings), 0.5, True)
    turned, turned_closed = cluster(polar(np.roll(ranges, shift), bearings), 0.5, True)
    assert turned_closed == closed
    if not closed:
        assert sorted(turned.tolist()) == sorted(((sectors + shift) % 61).tolist())


@given(SEEDS, st.booleans())
def test_mirroring_the_scan_mirrors_the_sectors(seed, full_circle):
    rng = np.random.default_rng(seed)
    bearings = np.sort(rng.uniform(-3, 3, 60))
    points = polar(runs(rng, bearings), bearings)
    sectors, closed = cluster(points, 0.5, full_circle)
    mirrored, mirrored_closed = cluster(points[::-1] * [1.0, -1.0], 0.5, full_circle)
    assert mirrored_closed == closed
    if not closed:
        assert sorted(mirrored.tolist()) == sorted((59 - sectors[:, ::-1]).tolist())


def test_no_points_make_no_sector():
    sectors, closed = cluster(np.empty((0, 2)), 0.5, True)
    assert sectors.shape == (0, 2)
    assert not closed


def test_one_point_is_one_open_sector():
    sectors, closed = cluster(np.array([[1.0, 0.0]]), 0.5, True)
    assert sectors.tolist() == [[0, 0]]
    assert not closed


def test_a_gap_of_exactly_the_limit_stays_open():
    points = np.array([[1.0, -0.25], [1.0, 0.25]])
    assert cluster(points, 0.5, True)[0].tolist() == [[0, 0], [1, 1]]
    assert cluster(points, 0.5 + 1e-12, True)[0].tolist() == [[0, 1]]


def test_a_far_point_seen_through_a_gap_belongs_to_the_sector():
    # A far point seen through the gap between two near ones.
    points = np.array([[1.0, -0.2], [3.0, 0.0], [1.0, 0.2]])
    assert cluster(points, 0.5, True)[0].tolist() == [[0, 2]]


@pytest.mark.parametrize(("full_circle", "sectors"), [(True, [[0, 39]]), (False, [[0, 39]])])
def test_a_ring_is_closed_only_on_a_full_circle(full_circle, sectors):
    points = polar(np.ones(40), (np.arange(40) - 19.5) * math.pi / 20)  # neighbours 0.157 apart
    found, closed = cluster(points, 0.2, full_circle)
    assert found.tolist() == sectors
    assert closed is full_circle


def test_a_ring_with_a_door_is_open():
    points = polar(np.ones(40), (np.arange(40) - 19.5) * math.pi / 20)
    found, closed = cluster(np.delete(points, [10, 11, 12], axis=0), 0.2, True)
    assert found.tolist() == [[10, 9]]
    assert not closed
