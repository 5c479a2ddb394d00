"""Places along a polyline, against dense sampling."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.polyline import evenly_spaced, exit_point, project, stretch
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS)
def test_places_on_a_line_equal_dense_sampling(seed):
    rng = np.random.default_rng(seed)
    line = rng.uniform(-2, 2, (int(rng.integers(2, 6)), 2))
    lengths = np.hypot(*np.diff(line, axis=0).T)
    ticks = np.concatenate([[0], np.cumsum(lengths)])

    def at(along):
        return np.column_stack([np.interp(along, ticks, line[:, k]) for k in (0, 1)])

    dense = np.linspace(0, ticks[-1], 4001)
    x, y = rng.uniform(-2, 2, 2)
    gaps = np.hypot(*(at(dense) - (x, y)).T)
    along, off, segment = project(line, x, y)
    assert off == pytest.approx(gaps.min(), abs=1e-2)
    assert np.hypot(*(at([along])[0] - (x, y))) == pytest.approx(off, abs=KERNEL)
    assert ticks[segment] - KERNEL <= along <= ticks[segment + 1] + KERNEL
    begin, end = np.sort(rng.uniform(0, 1.2 * ticks[-1], 2))
    places = stretch(line, begin, end, 0.1)
    count = max(math.ceil((min(end, ticks[-1]) - begin) / 0.1 - 1e-9), 0)
    evenly = begin + (min(end, ticks[-1]) - begin) * np.arange(1, count + 1) / max(count, 1)
    assert places == pytest.approx(at(evenly), abs=KERNEL)
    radius = rng.uniform(0.1, 3)
    *out, length = exit_point(line, radius)
    outside = np.flatnonzero(np.hypot(*(at(dense) - line[0]).T) > radius)
    expected = at(dense[outside[:1]])[0] if len(outside) else line[-1]
    assert length == pytest.approx(ticks[-1], abs=KERNEL)
    if len(outside):
        assert math.dist(out, line[0]) == pytest.approx(radius, abs=1e-6)
    assert math.dist(out, expected) < 0.05 * ticks[-1] or _grazes(at(dense), line[0], radius)


def _grazes(places, centre, radius):
    """The line only just leaves the disc, or comes back into it, between two samples."""
    gaps = np.hypot(*(places - centre).T) - radius
    return bool((np.abs(gaps) < 1e-2).any())


@given(SEEDS)
def test_evenly_spaced_points_keep_the_ends_and_the_spacing(seed):
    rng = np.random.default_rng(seed)
    line = rng.uniform(-2, 2, (int(rng.integers(2, 6)), 2))
    points = evenly_spaced(line, 0.1)
    np.testing.assert_allclose(points[[0, -1]], line[[0, -1]], rtol=0, atol=KERNEL)
    assert np.hypot(*np.diff(points, axis=0).T).max() <= 0.1 + KERNEL
    assert len(points) == math.ceil(np.hypot(*np.diff(line, axis=0).T).sum() / 0.1 - KERNEL) + 1
    assert np.abs([project(line, x, y)[1] for x, y in points]).max() <= KERNEL


def test_a_line_without_length_has_both_ends():
    np.testing.assert_array_equal(evenly_spaced(np.ones((2, 2)), 0.1), np.ones((2, 2)))
