"""When a decision is due, which steps are drawn, and where the robot went."""

import math

import numpy as np
import pytest

from lme.errors import InputError
from runners.recordings.driver import _Sampler, _Ticks
from runners.recordings.posed_scans import Order
from runners.recordings.report import headings_ahead

SECOND = 1_000_000_000


def test_time_that_goes_backwards_is_reported(says):
    order = Order("/odom")
    assert order.accepts(5 * SECOND)
    assert not order.accepts(5 * SECOND - SECOND // 20)  # overtaken by a few milliseconds
    with says.raises(InputError):
        order.accepts(2 * SECOND)


def due(dt, rate, stamps):
    ticks = _Ticks(dt, rate)
    return [stamp for stamp in stamps if ticks.due(round(stamp * SECOND))]


def test_every_scan_is_a_tick_where_they_come_at_the_robots_rate():
    jittered = [0.1 * k + 0.03 * (k % 3 - 1) for k in range(1, 60)]
    assert due(0.1, 10.0, jittered) == jittered


def test_of_faster_scans_the_one_nearest_to_the_due_time_is_taken():
    scans = [k / 9.9 for k in range(500)]
    taken = due(0.2, 9.9, scans)
    assert abs(len(taken) - 5.0 * scans[-1]) < 3
    assert all(abs(stamp - 0.2 * k) < 0.6 / 9.9 for k, stamp in enumerate(taken))


def test_after_a_gap_ticks_continue_from_the_next_scan():
    assert due(0.2, 10.0, [0.0, 0.1, 0.2, 5.03, 5.13, 5.23, 5.43]) == [0.0, 0.2, 5.03, 5.23, 5.43]


@pytest.mark.parametrize("number", [1, 59, 120, 1000])
def test_the_sample_is_spread_evenly(number):
    sampler = _Sampler()
    for k in range(number):
        sampler.offer(k)
    gaps = set(np.diff(sampler.kept))
    assert sampler.kept[0] == 0
    assert len(gaps) <= 1
    assert min(number, 60) <= len(sampler.kept) < 120


def test_the_robots_heading_is_where_it_came_to():
    poses = np.array([(x, 0.0, 0.5) for x in np.arange(0.0, 3.01, 0.25)] + [(3.0, 1.0, 0.0)])
    headings = headings_ahead(poses, 1.0)
    np.testing.assert_allclose(headings[:9], -0.5)
    assert headings[12] == pytest.approx(math.pi / 2 - 0.5)
    assert np.isnan(headings[13])
