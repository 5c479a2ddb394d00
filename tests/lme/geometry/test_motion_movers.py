"""Whose points are whose, among people."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.motion import movers_among
from tests import oracles
from tests.tolerances import KERNEL

SKIN = 0.1  # as in lme/geometry/motion.py


@given(st.integers(0, 10**6), st.integers(0, 3))
def test_points_of_movers_agree_with_its_slow_twin(seed, count):
    rng = np.random.default_rng(seed)
    people = rng.uniform(-2.0, 2.0, (count, 4))
    seen = rng.uniform(-2.5, 2.5, (rng.integers(0, 30), 2))
    points = np.concatenate((seen, rng.uniform(-2.5, 2.5, (30, 2))))
    own, movers = movers_among(points, seen, people, 1.0)
    slow_left, slow_movers = oracles.split(points, seen, people, 1.0, SKIN)
    np.testing.assert_array_equal(points[~own], slow_left)
    np.testing.assert_allclose(movers, slow_movers, rtol=0.0, atol=KERNEL)


def test_a_person_takes_its_points_and_leaves_the_wall():
    person, wall = np.array([[2.0, 0.0, 0.0, 1.0]]), np.array([[3.0, 0.0]])
    front = np.array([[1.7, 0.0], [1.78, 0.2], [1.78, -0.2]])
    remembered = np.array([[2.0, 0.39], [2.0, 0.41]])  # within and beyond 0.3 m and the skin
    own, movers = movers_among(np.concatenate((front, wall, remembered)), front, person, 1.0)
    np.testing.assert_array_equal(own, [True, True, True, False, True, False])
    assert movers == pytest.approx(np.array([[2.0, 0.0, 0.0, 1.0, math.hypot(0.22, 0.2)]]))
