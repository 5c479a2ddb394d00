"""Permitted velocities: against a search of all velocities, against RVO2, and by hand."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lme.geometry.orca import before_point, beside_disc, best_velocity
from lme.simulation.walkers import orca
from tests.tolerances import KERNEL

V_MAX = 1.3
NEAR = st.floats(-1.0, 1.0)
LINES = st.lists(st.tuples(NEAR, NEAR, st.floats(0.0, math.tau)), max_size=6)
# Places, velocities, wanted velocities of people of radius .25 m, and what RVO2 2.0.3 chooses (float32): time step
# .1 s, time horizon 3 s, greatest speed 1.3 m/s.
RVO2 = [
    (
        [[1.19, 0.83], [-0.82, -0.6], [1.12, -1.48], [0.96, 0.89], [-0.1, -0.59]],
        [[-0.44, -0.49], [-0.11, 0.01], [0.11, 0.99], [0.59, 0.24], [0.98, -0.57]],
        [[-0.68, 0.23], [-0.91, -0.93], [0.03, -0.07], [0.83, 0.26], [0.03, -0.01]],
        [[0.0922, -1.2967], [-0.9092, -0.9292], [0.41, 0.4061], [-0.1594, 1.2902], [0.336, -0.4877]],
    ),
    (
        [[-0.76, -1.46], [-0.92, 0.58], [-0.9, -0.39], [-1.49, 0.99]],
        [[-0.69, -0.46], [0.76, 0.02], [0.69, 0.28], [0.48, -0.82]],
        [[0.08, 0.02], [0.74, -0.28], [0.2, -0.88], [-0.22, -0.35]],
        [[-0.3373, -0.2007], [0.9273, -0.0927], [0.6226, -0.8528], [-0.22, -0.35]],
    ),
    (
        [[1.28, 0.16], [-0.96, 1.15], [0.42, 0.21], [-0.37, -0.27]],
        [[-0.52, -0.92], [0.75, -0.06], [0.1, -0.36], [0.5, -0.95]],
        [[-0.26, -0.94], [-0.75, 0.93], [0.32, -0.14], [0.05, 0.75]],
        [[-0.2593, -0.9244], [-0.75, 0.93], [0.3094, -0.175], [-0.0219, -0.9345]],
    ),
]


def half_planes(given):
    return np.array([(x, y, math.cos(turn), math.sin(turn)) for x, y, turn in given]).reshape(-1, 4)


def beyond(lines, velocity):
    """How far a velocity is on the wrong side of each border."""
    x, y = np.asarray(velocity)[..., 0, None], np.asarray(velocity)[..., 1, None]
    px, py, dx, dy = lines.T
    return dx * (py - y) - dy * (px - x)


def disc(step=0.02):
    axis = np.arange(-V_MAX, V_MAX + step, step)
    grid = np.array(np.meshgrid(axis, axis)).reshape(2, -1).T
    return grid[np.hypot(*grid.T) <= V_MAX]


EVERY = disc()


@pytest.mark.parametrize(("places", "velocities", "wanted", "chosen"), RVO2)
def test_people_choose_as_in_rvo2(places, velocities, wanted, chosen):
    traits = np.tile(
        [0.2, 1.0, V_MAX, 0.0, 0.0], (len(places), 1)
    )  # and .1 m between two, as RVO2's .25 m each
    far = np.array([[100.0, 0.0, 0.0, 0.0, 0.3]])
    arrays = (np.array(places), np.array(velocities), np.array(wanted), traits, far)
    found = orca(*arrays, np.empty((0, 3)), np.empty((0, 4)), 0.1)
    assert found == pytest.approx(np.array(chosen), abs=1e-4)  # float32, four digits


@settings(max_examples=200)
@given(LINES, NEAR, NEAR)
@example([(0.0, 0.0, 0.0), (-1.0, -4e-51, 2e-16)], 1.0, -1.0)  # one line but for rounding
def test_no_permitted_velocity_is_nearer_to_the_wanted_one(given_lines, x, y):
    lines = half_planes(given_lines)
    found = np.array(best_velocity(lines, 0, V_MAX, (x, y)))
    x, y = np.array([x, y]) * min(V_MAX / max(math.hypot(x, y), 1e-9), 1.0)
    assert np.hypot(*found) <= V_MAX + 1e-6
    left = beyond(lines, EVERY).max(axis=1, initial=-np.inf)
    ours = beyond(lines, found).max(initial=-np.inf)
    assert ours <= max(left.min(), 0.0) + 1e-6  # no velocity leaves the worst half-plane by less
    allowed = EVERY[
        left <= -1e-6
    ]  # clear of the borders: rounding decides whether a single point is permitted
    if len(allowed):
        nearest = np.hypot(*(allowed - (x, y)).T).min()
        assert np.hypot(*(found - (x, y))) <= nearest + 1e-6


@given(LINES, NEAR, NEAR, st.lists(st.floats(0.0, math.tau), min_size=1, max_size=3))
def test_walls_are_never_left_for_people(given_lines, x, y, bearings):
    walls = np.empty((len(bearings), 4))
    for wall, bearing in zip(walls, bearings, strict=True):
        before_point(0.4 * math.cos(bearing), 0.4 * math.sin(bearing), 0.3, 0.5, wall)
    lines = np.vstack([walls, half_planes(given_lines)])
    found = best_velocity(lines, len(walls), V_MAX, (x, y))
    assert beyond(walls, found).max() <= 1e-6


def test_a_point_bounds_the_speed_towards_it_by_the_clearance():
    line = np.empty(4)
    before_point(1.0, 0.0, 0.4, 0.5, line)
    assert best_velocity(line[None], 1, V_MAX, (1.3, 0.0)) == pytest.approx((1.2, 0.0), abs=KERNEL)
    assert best_velocity(line[None], 1, V_MAX, (-1.0, 0.3)) == pytest.approx((-1.0, 0.3), abs=KERNEL)
    before_point(0.2, 0.0, 0.4, 0.5, line)  # in contact: away, or along
    assert best_velocity(line[None], 1, V_MAX, (1.0, 0.5)) == pytest.approx((0.0, 0.5), abs=KERNEL)


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_two_who_do_their_shares_pass_each_other(share):
    """Head on, a little aside: with both shares adding up to 1 nobody is met within the horizon."""
    ours, theirs, horizon = np.array([1.0, 0.0]), np.array([-1.0, 0.0]), 3.0
    relative, line = np.array([4.0, 0.1]), np.empty(4)
    beside_disc(relative, ours, theirs, 0.6, horizon, 0.1, share, line)
    chosen = np.array(best_velocity(line[None], 0, V_MAX, (1.0, 0.0)))
    if share == 1.0:
        other = theirs
    else:
        beside_disc(-relative, theirs, ours, 0.6, horizon, 0.1, 1.0 - share, line)
        other = np.array(best_velocity(line[None], 0, V_MAX, (-1.0, 0.0)))
    times = np.linspace(0.0, horizon, 301)[:, None]
    assert np.hypot(*(relative + times * (other - chosen)).T).min() >= 0.6 - 1e-6


def test_who_overlaps_comes_apart_within_a_step():
    line = np.empty(4)
    beside_disc(np.array([0.4, 0.0]), np.zeros(2), np.zeros(2), 0.5, 3.0, 0.1, 0.5, line)
    assert best_velocity(line[None], 0, V_MAX, (0.0, 0.0)) == pytest.approx((-0.5, 0.0), abs=KERNEL)
