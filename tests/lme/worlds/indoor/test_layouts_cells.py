"""Rectangles of cells."""

import numpy as np
import pytest

from lme.worlds.indoor.layouts import Rectangle, random_size

BOX = Rectangle(2, 4, 6, 5)


def test_a_rectangle_is_moved_grown_and_transposed():
    assert BOX.size == (4, 1)
    assert BOX.enlarged(2) == (0, 2, 8, 7)
    assert BOX.shifted(-2, 1) == (0, 5, 4, 6)
    assert BOX.transposed() == (4, 2, 5, 6)


@pytest.mark.parametrize(
    ("other", "meets"),
    [((5, 4, 9, 9), True), ((6, 4, 9, 9), False), ((2, 5, 6, 6), False), ((0, 0, 9, 9), True)],
)
def test_rectangles_that_touch_do_not_meet(other, meets):
    assert BOX.meets(Rectangle(*other)) == Rectangle(*other).meets(BOX) == meets


def test_a_rectangle_holds_places_in_metres():
    assert BOX.holds(np.array([0.2, 0.22]))
    assert not BOX.holds(np.array([0.2, 0.26]))


def test_a_random_size_may_be_either_bound():
    rng = np.random.default_rng(0)
    assert {random_size(rng, (3, 5)) for _ in range(50)} == {3, 4, 5}
