import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.fan import direction
from lme.grids.edge_grid import NO_EDGES
from lme.simulation.mid360.cloud_scan import (
    MOST_NOISE,
    beam_noise,
    beam_pattern,
    beams_between,
    cloud_scan,
    rise_share,
)
from lme.types import Pose
from tests import oracles
from tests.tolerances import RANGE

SEEDS = st.integers(0, 2**32 - 1)


def scattered(rng):
    """A pose, and a few obstacles of which none holds it."""
    bearings, away = rng.uniform(-4, 4, 6), rng.uniform(1.0, 8.0, 6)
    centres = np.column_stack([away * np.cos(bearings), away * np.sin(bearings)])
    circles = np.column_stack([centres, rng.uniform(0.05, 0.7, 6)])[: rng.integers(0, 7)]
    edges = rng.uniform(-6.0, 6.0, (rng.integers(0, 7), 4))
    return Pose(*rng.uniform(-0.2, 0.2, 2), rng.uniform(-4, 4)), circles, edges


@given(SEEDS)
def test_the_scan_is_that_of_the_whole_cloud(seed):
    rng = np.random.default_rng(seed)
    pose, circles, edges = scattered(rng)
    first, number, phase, key = (
        int(rng.integers(0, 10**6)),
        400,
        tuple(rng.random(2)),
        int(rng.integers(2**63)),
    )
    std, height = rng.choice([0.0, 0.02, 0.3]), rng.uniform(0.1, 0.8)
    elevations, limits = (rng.uniform(-1.0, -0.1), rng.uniform(0.0, 1.0)), (0.1, rng.uniform(3.0, 40.0))
    heights = np.sort(
        rng.uniform(-0.2, 1.0, 2)
    )  # below, around or above the sensor, with and without the ground
    spans, bins = (0.1, rng.uniform(4.0, 20.0)), int(rng.integers(4, 400))
    scan = cloud_scan(
        pose, (first, number, *phase), (key, float(std)), (height, *elevations, *limits), tuple(heights), spans,
        bins, circles, edges, tuple(NO_EDGES),
    )  # fmt: skip
    beams, noise = beam_pattern(first, number, phase, elevations), std * beam_noise(first, number, key)
    expected = oracles.cloud_scan(pose, beams, noise, height, limits, heights, spans, bins, circles, edges)
    assert scan.dtype == np.float32
    np.testing.assert_allclose(scan, expected, rtol=0, atol=2 * RANGE)


@given(SEEDS)
def test_the_beams_between_two_elevations_are_found_without_the_others(seed):
    rng = np.random.default_rng(seed)
    first, number, phase = int(10 ** rng.uniform(0, 9)), int(rng.integers(1, 3000)), rng.random()
    lowest = rng.choice([0.0, rng.random(), rng.uniform(-1.0, 1.0)])
    highest = lowest + rng.choice([10 ** rng.uniform(-6, 0.0), 1.0 - lowest, -0.1])
    beams = np.arange(first, first + number)
    shares = np.array([rise_share(int(beam), phase) for beam in beams])
    chosen = beams_between(first, number, phase, lowest, highest)
    assert (np.diff(chosen) > 0).all()
    assert np.isin(beams[(shares >= lowest) & (shares <= highest)], chosen).all()
    # Others lie as near to the interval as a share is exact, on the circle of shares.
    slack, of_chosen = 1e-14 * (first + number), shares[chosen - first]
    turned = (of_chosen - max(lowest, 0.0) + slack) % 1.0
    assert (turned <= min(highest, 1.0) - max(lowest, 0.0) + 2 * slack).all()


@given(SEEDS)
def test_what_is_hidden_does_not_change_the_scan(seed):
    rng = np.random.default_rng(seed)
    pose, circles, edges = scattered(rng)
    wall = np.array([[7.0, 7.0], [-7.0, 7.0], [-7.0, -7.0], [7.0, -7.0]])
    room, outer = (np.hstack([side * wall, side * np.roll(wall, 1, axis=0)]) for side in (1.0, 1.2))

    def scan(edges):
        return cloud_scan(
            pose, (0, 5000, 0.1, 0.2), (1, 0.02), (0.4, -0.12, 0.9, 0.1, 40.0), (0.05, 0.5), (0.1, 20.0),
            360, circles, edges, tuple(NO_EDGES),
        )  # fmt: skip

    np.testing.assert_array_equal(scan(np.vstack([edges, room, outer])), scan(np.vstack([edges, room])))


def test_the_ground_counts_if_its_height_does():
    def returns(lowest):
        scan = cloud_scan(
            Pose(0.0, 0.0, 0.0), (0, 5000, 0.1, 0.2), (1, 0.0), (0.4, -0.5, 0.1, 0.1, 40.0), (lowest, 0.5), (0.1, 20.0),
            90, np.empty((0, 3)), np.empty((0, 4)), tuple(NO_EDGES),
        )  # fmt: skip
        return np.isfinite(scan).sum()

    assert returns(-0.05) == 90
    assert returns(0.05) == 0


def test_the_noise_of_a_beam_is_its_own_bounded_and_standard():
    noise = beam_noise(0, 200_000, 7)
    assert noise.mean() == pytest.approx(0.0, abs=0.01)
    assert noise.std() == pytest.approx(1.0, abs=0.01)
    assert np.abs(noise).max() <= MOST_NOISE
    assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.01
    np.testing.assert_array_equal(beam_noise(150, 50, 7), noise[150:200])
    assert not np.array_equal(beam_noise(0, 50, 8), noise[:50])


@given(st.floats(-3.0, 3.0))
def test_directions_are_exact(turn):
    expected = math.cos(math.tau * turn), math.sin(math.tau * turn)
    assert direction(turn) == pytest.approx(expected, abs=1e-14)
