import math

import numpy as np
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
    bearings = np.sort(rng.uniform(-fov, fov, rng.choice([0, 1, 2, 3, 12, 60, 300])))
    assert_equals_oracle(polar(shape(rng, bearings), bearings), rng.uniform(0.02, 1.2), full_circle)


@given(SEEDS, st.booleans())
def test_pairs_across_plus_minus_pi(seed, full_circle):
    rng = np.random.default_rng(seed)
    behind = math.pi - rng.uniform(0, 0.2, 6)
    bearings = np.sort(np.concatenate([behind[:3], -behind[3:], rng.uniform(-2, 2, 5)]))
    assert_equals_oracle(polar(rng.uniform(0.5, 2, 11), bearings), 0.4, full_circle)


def test_a_gap_of_exactly_the_limit_stays_open():
    points = np.array([[1.0, -0.25], [1.0, 0.25]])
    assert cluster(points, 0.5, True)[0].tolist() == [[0, 0], [1, 1]]
    assert cluster(points, 0.5 + 1e-12, True)[0].tolist() == [[0, 1]]
