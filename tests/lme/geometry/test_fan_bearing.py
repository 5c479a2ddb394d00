"""Bearings without trigonometric functions: as accurate as they say."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lme.geometry.fan import BEARING_ERROR, bearing, unsigned_bearing

EXACT = 1e-15  # [rad]
SHORTEST = 1e-280
LENGTHS = st.one_of(st.floats(-100.0, 100.0), st.floats(-1e-200, 1e-200), st.floats(-1e200, 1e200))


@given(LENGTHS, LENGTHS)
def test_an_unsigned_bearing_is_that_of_atan2(x, y):
    assume(math.hypot(x, y) > SHORTEST)
    assert unsigned_bearing(x, y) == pytest.approx(abs(math.atan2(y, x + 0.0)), abs=EXACT)


@pytest.mark.parametrize(
    ("x", "y", "found"),
    [
        (1.0, 0.0, 0.0),
        (0.0, -2.0, math.pi / 2),
        (-1.0, 0.0, math.pi),
        (3.0, 3.0, math.pi / 4),
        (0.0, 0.0, 0.0),
    ],
)
def test_unsigned_bearings_along_axes_and_diagonals(x, y, found):
    assert unsigned_bearing(x, y) == pytest.approx(found, abs=EXACT)


def test_a_bearing_is_as_accurate_as_it_says():
    for turn in np.random.default_rng(0).uniform(0.0, 2.0 * math.pi, 1000):
        assert bearing(math.cos(turn), math.sin(turn)) == pytest.approx(turn, abs=BEARING_ERROR)
