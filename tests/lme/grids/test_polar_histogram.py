"""Each reduction of VFH+ against a slow twin, and by hand."""

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from lme.grids import polar_histogram as kernels
from tests.tolerances import KERNEL

N = 72
ALPHA = math.tau / N
POINTS = st.lists(st.tuples(st.floats(-2, 2), st.floats(-2, 2)), max_size=40).map(
    lambda pairs: np.array(pairs, dtype=float).reshape(-1, 2)
)
FLAGS = st.lists(st.booleans(), min_size=8, max_size=72).map(np.array)


def wrapped(angle):
    return math.remainder(angle, math.tau)


def slow_cells(points, size, reach):
    returns = {}
    for x, y in points:
        if x * x + y * y <= reach * reach:
            cell = tuple(int(math.copysign(math.floor(abs(c) / size + 0.5), c)) for c in (x, y))
            returns.setdefault(cell, []).append((x, y))
    return [np.mean(returns[cell], axis=0) for cell in sorted(returns)]


def slow_density(cells, yaw, radius, reach, peak, n):
    """And whether a sector's centre lies on the very edge of a cell, where rounding decides."""
    density, tie = np.zeros(n), False
    for x, y in cells:
        d = math.hypot(x, y)
        gamma = math.asin(min(radius / d, 1.0)) if d > radius else math.pi / 2
        for k in range(n):
            beside = abs(wrapped(k * math.tau / n - math.atan2(y, x) - yaw)) - gamma
            tie |= abs(beside) < 1e-9
            if beside <= 0.0:
                density[k] += peak - (peak - 1) * (d / reach) ** 2
    return density, tie


def slow_candidates(blocked, target, wide):
    n = len(blocked)
    if not any(blocked):
        return [target % n]
    found = []
    for first in range(n):
        if blocked[first] or not blocked[first - 1]:
            continue
        width = next(w for w in range(1, n) if blocked[(first + w) % n])
        right, left = first + wide / 2, first + width - 1 - wide / 2
        if width < wide or right >= left:
            found.append(first + (width - 1) / 2)
            continue
        ahead = (target - first) % n + first
        found += [right, left] + ([ahead] if right < ahead < left else [])
    return sorted(f % n for f in found)


@given(POINTS, st.floats(0.05, 0.3), st.floats(0.3, 2.5))
def test_a_cell_counts_once_at_the_mean_of_its_returns(points, size, reach):
    cells = kernels.active_cells(points, size, reach)
    slow = slow_cells(points, size, reach)
    assert cells == pytest.approx(np.reshape(slow, (-1, 2)), abs=KERNEL)


def test_the_grid_is_no_larger_than_the_points_need():
    cells = kernels.active_cells(np.array([[1.0, 0.0], [0.0, -2.0]]), 0.05, 1e6)
    assert sorted(map(tuple, cells)) == [(0.0, -2.0), (1.0, 0.0)]


@settings(suppress_health_check=[HealthCheck.filter_too_much])
@given(POINTS, st.floats(-4, 4), st.floats(0.15, 0.5))
def test_density_is_that_of_every_cell_in_every_sector(points, yaw, radius):
    fast = kernels.polar_density(points, yaw, radius, 1.6, 10.0, N)
    slow, tie = slow_density(points, yaw, radius, 1.6, 10.0, N)
    assume(not tie)
    assert fast == pytest.approx(slow, abs=1e-7)


def test_a_cell_weighs_peak_near_and_one_at_the_edge():
    at = kernels.polar_density(np.array([[1.6, 0.0]]), 0.0, 0.3, 1.6, 10.0, N)
    near = kernels.polar_density(np.array([[1e-6, 0.0]]), 0.0, 0.3, 1.6, 10.0, N)
    # asin(0.3 / 1.6) = 10.8°: two sectors of 5° on either side.
    assert np.flatnonzero(at).tolist() == [0, 1, 2, 70, 71]
    assert at[0] == pytest.approx(1.0, abs=KERNEL)
    assert near.max() == pytest.approx(10.0, abs=KERNEL)
    assert (near > 0).sum() == 37  # half of the circle, both edges


def test_a_cell_narrower_than_a_sector_still_counts():
    # asin(0.01 / 1.5) = 0.4°, halfway between two sectors.
    point = 1.5 * np.array([[math.cos(0.4 * ALPHA), math.sin(0.4 * ALPHA)]])
    assert np.flatnonzero(kernels.polar_density(point, 0.0, 0.01, 1.6, 10.0, N)).tolist() == [0]


@given(POINTS, st.floats(0, 2), st.floats(0.1, 0.5))
def test_turning_limits_are_those_of_every_cell(points, turn, radius):
    right, left = -math.pi, math.pi
    for x, y in points:
        if y > 0 and math.hypot(x, y - turn) < turn + radius:
            left = min(left, math.atan2(y, x))
        if y < 0 and math.hypot(x, y + turn) < turn + radius:
            right = max(right, math.atan2(y, x))
    assert kernels.turning_limits(points, turn, radius) == pytest.approx((right, left), abs=1e-6)


def test_a_fast_robot_cannot_turn_behind_a_post_at_its_side():
    # Post 0.6 m to the left, a little ahead. On the spot it is out of reach; with a turn of 0.5 m it is hit.
    post = np.array([[0.1, 0.6]])
    assert kernels.turning_limits(post, 0.0, 0.3) == (-math.pi, math.pi)
    right, left = kernels.turning_limits(post, 0.5, 0.3)
    assert (right, left) == pytest.approx((-math.pi, math.atan2(0.6, 0.1)), abs=KERNEL)


@given(FLAGS, st.floats(-4, 4), st.floats(-3.1, 0), st.floats(0, 3.1))
def test_only_sectors_between_the_limits_stay_free(blocked, yaw, right, left):
    masked = kernels.masked(blocked, yaw, right, left)
    for k in range(len(blocked)):
        bearing = wrapped(k * math.tau / len(blocked) - yaw)
        if min(abs(bearing - right), abs(bearing - left)) > 1e-9:
            assert masked[k] == (blocked[k] or not right <= bearing <= left)


@given(FLAGS, st.floats(0, 72), st.floats(1, 30))
def test_candidates_are_those_of_every_valley(blocked, target, wide):
    n = len(blocked)
    fast = sorted(float(c) % n for c in kernels.candidate_directions(blocked, target, wide))
    slow = slow_candidates(blocked.tolist(), target, wide)
    assert len(fast) == len(slow)
    for a, b in zip(fast, slow, strict=True):
        assert math.remainder(a - b, n) == pytest.approx(0.0, abs=1e-6)


def test_narrow_valleys_offer_their_middle_and_wide_ones_their_edges_and_the_target():
    blocked = np.ones(N, dtype=bool)
    blocked[[0, 1, 2, 3, 71]] = False  # from −5° to 15°
    blocked[20:60] = False
    candidates = kernels.candidate_directions(blocked, 30.0, 16.0).tolist()
    assert sorted(c % N for c in candidates) == [1.0, 28.0, 30.0, 51.0]


@given(
    st.lists(st.floats(0, 72), min_size=1, max_size=9),
    st.tuples(*[st.floats(0, 72)] * 3),
    st.tuples(*[st.floats(0, 5)] * 3),
)
def test_the_cheapest_costs_no_more_than_any(candidates, towards, costs):
    def cost(c):
        return sum(m * abs(math.remainder(c - t, N)) for m, t in zip(costs, towards, strict=True))

    chosen = kernels.cheapest(np.array(candidates), costs, towards, N)
    assert cost(candidates[chosen]) <= min(map(cost, candidates)) + 1e-6
