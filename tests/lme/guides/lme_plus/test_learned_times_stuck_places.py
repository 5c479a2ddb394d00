"""Places before which the robot was stuck: from when on they count, how much, and for how long."""

import numpy as np
import pytest

from lme.guides.lme_plus.learned_times import StuckPlaces

DT = 0.125
HERE, NEAR, FAR = np.array([3.0, -2.0]), np.array([3.3, -2.3]), np.array([3.0, -1.0])


def waited(*places, times):
    made = StuckPlaces(DT)
    for place, count in zip(places, times, strict=True):
        for _ in range(count):
            made.wait(place)
    return made


def seconds(row):
    """How much longer the way through the middle takes [s]."""
    return 2.0 * row[4] * row[5]


def test_a_place_counts_after_two_seconds_and_then_for_ten_times_as_long():
    assert len(waited(HERE, times=[16]).rows) == 0
    assert seconds(waited(HERE, times=[17]).rows[0]) == pytest.approx(10.0 * 17 * DT)
    assert seconds(waited(HERE, times=[170]).rows[0]) == pytest.approx(10.0 * 170 * DT)
    assert waited(HERE, times=[17]).rows[0, :4].tolist() == [3.0, -2.0, 0.0, 0.0]


def test_near_places_are_one_and_far_ones_are_not():
    rows = waited(HERE, NEAR, FAR, HERE, times=[10, 10, 20, 4]).rows
    assert rows[:, :2].tolist() == [HERE.tolist(), FAR.tolist()]
    assert seconds(rows[0]) == pytest.approx(10.0 * 24 * DT)
    assert seconds(rows[1]) == pytest.approx(10.0 * 20 * DT)


def test_for_another_target_all_are_forgotten():
    made = waited(HERE, times=[100])
    made.forget()
    assert len(made.rows) == 0
    made.wait(HERE)
    assert len(made.rows) == 0


def test_the_nearest_place_counts():
    beside, between = np.add(HERE, [0.6, 0.0]), np.add(HERE, [0.4, 0.0])
    rows = waited(HERE, beside, between, times=[10, 10, 10]).rows
    assert rows[:, :2].tolist() == [beside.tolist()]
