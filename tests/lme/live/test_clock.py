"""Jumps and standstills of the node's clock."""

import pytest

from lme.live.clock import Clock

SECOND = 1_000_000_000


def read(*seconds):
    """What is said of each of these times."""
    clock = Clock(SECOND, lambda: 0)
    return [clock.read(round(100 * SECOND + one * SECOND)) for one in seconds]


def test_time_that_passes_is_not_a_jump():
    assert read(0.0, 0.2, 0.2, 1.2, 1.15, 2.1) == [""] * 6


@pytest.mark.parametrize("by", [1.1, -0.2, 1e6, -99.0])
def test_a_jump_of_the_clock_is_reported_once(by, says):
    said = read(0.0, by, by + 0.2)
    assert said[0] == said[2] == ""
    says(said[1])


def test_threads_that_swap_two_readings_do_not_hide_a_standstill():
    wall = [0]
    clock = Clock(SECOND, lambda: wall[0])
    clock.read(SECOND)
    for k in range(10):
        wall[0] += SECOND
        clock.read(SECOND - (k % 2) * SECOND // 20)
    assert clock.stalled_for == 10 * SECOND
    clock.read(SECOND + 1)
    assert clock.stalled_for == 0
