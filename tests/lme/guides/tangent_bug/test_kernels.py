"""What a point robot sees among grown scan points: fast against slow, and scenes worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.guides.tangent_bug import kernels as tangents
from tests.tolerances import KERNEL

UNITS = tangents.directions(72)

coordinate = st.floats(-5.0, 5.0)
points = st.lists(st.tuples(coordinate, coordinate), max_size=12).map(
    lambda chosen: np.array(chosen, dtype=float).reshape(-1, 2)
)
shares = st.floats(0.01, 0.95)


def by_bearing(scan):
    return scan[np.argsort(np.arctan2(scan[:, 1], scan[:, 0]), kind="stable")]


def away(scan):
    """Without points so near that squares of their coordinates vanish."""
    return scan[np.hypot(*scan.T) > 1e-6]


def radii_of(scan, share):
    return np.minimum(0.3, share * np.hypot(*scan.T))


def slow_way(scan, radii, unit):
    """Along a unit vector to the first disc that it meets, and how near to missing it it comes."""
    best, miss = math.inf, math.inf
    for (x, y), radius in zip(scan, radii, strict=True):
        along, across = x * unit[0] + y * unit[1], abs(x * unit[1] - y * unit[0])
        miss = min(miss, abs(across - radius)) if along > 0.0 else miss
        if along > 0.0 and across <= radius:
            best = min(best, along - math.sqrt(radius * radius - across * across))
    return best, miss


@given(points, shares)
def test_free_ways_are_those_of_every_disc_in_turn(scan, share):
    scan = away(scan)
    radii = radii_of(scan, share)
    ways, owners = tangents.free_ways(scan, radii, UNITS)
    seen = {int((math.atan2(y, x) + math.pi) / math.tau * len(UNITS)) % len(UNITS) for x, y in scan}
    for k, unit in enumerate(UNITS):
        expected, miss = slow_way(scan, radii, unit)
        if k not in seen and miss > KERNEL:  # else a disc may count that is narrower than the step
            assert ways[k] == pytest.approx(expected, abs=1e-6)
            assert (owners[k] < 0) == math.isinf(expected)
        if owners[k] >= 0:
            x, y = ways[k] * unit - scan[owners[k]]
            assert math.hypot(x, y) >= radii[owners[k]] - 1e-6


@pytest.mark.parametrize("bearing", [-math.pi + 1e-9, -1.0, 0.001, 3.0, math.pi])
def test_a_point_thinner_than_a_step_is_not_overlooked(bearing):
    scan = 9.0 * np.array([[math.cos(bearing), math.sin(bearing)]])
    ways, owners = tangents.free_ways(scan, np.array([1e-3]), UNITS)
    assert (owners >= 0).sum() == 1
    assert ways.min() == pytest.approx(9.0, abs=0.05)


@given(points, shares, st.tuples(coordinate, coordinate))
def test_first_on_way_is_what_walking_the_way_meets_first(scan, share, end):
    scan, end = away(scan), np.array(end)
    radii = radii_of(scan, share)
    found = tangents.first_on_way(scan, radii, end)
    steps = np.linspace(0.0, 1.0, 2001)[:, None] * end
    inside = np.hypot(*(steps[:, None] - scan).T).T < radii
    if found < 0:
        assert not inside.any()
    elif inside.any():
        walked = np.hypot(*steps[int(np.argmax(inside.any(axis=1)))])
        entered, miss = slow_way(scan[[found]], radii[[found]], end / np.hypot(*end))
        assert entered <= walked + KERNEL or miss <= KERNEL  # discs narrower than a step are stepped over


@given(points, st.floats(0.1, 3.0), st.floats(0.0, 0.2))
def test_breaks_are_counted_pair_by_pair(scan, gap, slope):
    scan = by_bearing(scan)
    count = tangents.breaks_before(scan, gap, slope)
    assert len(count) == len(scan) + 1
    for i, here in enumerate(scan):
        after = scan[(i + 1) % len(scan)]
        limit = gap + slope * min(math.hypot(*here), math.hypot(*after))
        if abs(math.dist(here, after) - limit) > KERNEL:
            assert count[i + 1] - count[i] == (math.dist(here, after) > limit)


@given(points.filter(len), st.data())
def test_points_are_joined_where_the_shorter_way_round_has_no_break(scan, data):
    scan = by_bearing(scan)
    count = tangents.breaks_before(scan, 1.0, 0.0)
    number = st.integers(0, len(scan) - 1)
    i, j = data.draw(number), data.draw(number)
    jump = np.diff(count) > 0

    def unbroken(first, last):
        return not any(jump[k % len(scan)] for k in range(first, last + len(scan) * (last < first)))

    ahead, back = (j - i) % len(scan), (i - j) % len(scan)
    ways = [unbroken(i, j)] * (ahead <= back) + [unbroken(j, i)] * (back <= ahead)
    assert tangents.joined(i, j, count) == any(ways)
    assert not tangents.joined(-1, i, count)


@given(points, shares, st.integers(0, 71), st.floats(0.0, 0.1))
def test_a_mirrored_scan_is_swept_mirrored(scan, share, start, slope):
    scan = by_bearing(away(scan))
    other = by_bearing(scan * [1.0, -1.0])
    target = np.array([2.0, 0.7])
    results = []
    for seen, first, step, goal in ((scan, start, 1, target), (other, 71 - start, -1, target * [1, -1])):
        ways, owners = tangents.free_ways(seen, radii_of(seen, share), UNITS)
        breaks = tangents.breaks_before(seen, 0.6, slope)
        results.append((*tangents.sweep(ways, owners, breaks, slope, UNITS, first, step, goal), ways))
    (k, longer, least, ways), (j, longer2, least2, ways2) = results
    if ways2[::-1] == pytest.approx(ways, abs=KERNEL):  # but for discs that a direction grazes
        assert longer == longer2
        assert j == (71 - k if k >= 0 else -1)
        assert least2 == pytest.approx(least, abs=KERNEL)


def wall(x, low, high, step=0.1):
    return np.array([(x, y) for y in np.arange(low, high + step / 2, step)])


def profile(scan, radius=0.2):
    scan = by_bearing(scan)
    units = tangents.directions(720)
    ways, owners = tangents.free_ways(scan, np.full(len(scan), radius), units)
    return scan, units, (ways, owners, tangents.breaks_before(scan, 2 * radius, 0.05), 0.05)


def sweep_ahead(scan, step):
    scan, units, seen = profile(scan)
    k, longer, least = tangents.sweep(*seen, units, 360, step, np.array([4.0, 0.0]))
    return scan, seen, k, longer, least


def test_a_wall_ends_at_its_end():
    scan, seen, k, longer, least = sweep_ahead(wall(2.0, -1.0, 1.0), 1)
    assert longer
    assert scan[seen[1][k]].tolist() == pytest.approx([2.0, 1.0])
    # From (4, 0) to where the discs around (2, 0) and (2, 0.1) meet: (2 − √(0.2² − 0.05²), 0.05).
    assert least == pytest.approx(math.hypot(2 + math.sqrt(0.0375), 0.05), abs=2e-3)


def test_a_post_before_a_wall_hides_the_rest_of_the_wall():
    # A post at (1, 0.5) of radius 0.2, seen from 26.6° − 10.3° on.
    scan, seen, k, longer, _ = sweep_ahead(np.vstack((wall(2.0, -1.0, 3.0), [[1.0, 0.5]])), 1)
    assert not longer
    assert scan[seen[1][k]][0] == 2.0
    assert (k + 0.5) / 2 - 180 == pytest.approx(26.565 - 10.305, abs=0.5)


def test_a_ring_has_no_end():
    angles = np.arange(0.0, math.tau, 0.05)
    ring = 2.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    assert sweep_ahead(ring, 1)[2] == sweep_ahead(ring, -1)[2] == -1
    _, _, seen = profile(ring)
    assert len(tangents.all_ends(*seen)) == 0


def test_all_ends_holds_the_ends_that_sweeps_meet():
    _, units, seen = profile(np.vstack((wall(2.0, -1.0, 1.0), wall(-3.0, 0.5, 1.5))))
    ends = tangents.all_ends(*seen).tolist()
    assert len(ends) == 4
    for start in (360, 700):
        for step in (1, -1):
            k, longer, _ = tangents.sweep(*seen, units, start, step, np.zeros(2))
            assert longer
            assert [k, step] in ends


def test_the_first_direction_that_is_free_far_enough():
    _, _, (ways, *_) = profile(wall(2.0, -1.0, 1.0))
    k = tangents.first_longer(ways, 360, 1, 3.0)
    assert ways[k] >= 3.0 > ways[360:k].max()
    assert tangents.first_longer(np.full(8, 0.5), 3, -1, 1.0) == -1
    assert tangents.first_longer(np.array([2.0, 0.0, 0.0, 2.0]), 2, -1, 1.0) == 0
