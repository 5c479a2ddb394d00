import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.grids.obstacle_grid import inflate
from lme.mapping.costmap import inflation_stamp
from lme.planners.ros_eband.kernels import Rules, expansion, optimize, refine
from tests import oracles
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
GRID = (-40, -40, 0.05)
RULES = Rules(10.0, 0.7, 0.01, 0.01, 1.0, 2.0, 3, 4, 0.75, 0.15, 0.41)
FREE = math.log(252.0) / 10.0  # [m] 0.553
STAMP = inflation_stamp(0.05, 0.0, 0.265, 0.4, 10.0)


def inflated(cells=()):
    """Costs (81, 81) about the origin of obstacles in these cells of the lattice."""
    hits, costs = np.zeros((81, 81), np.int32), np.zeros((81, 81), np.uint8)
    for i, j in cells:
        hits[i + 40, j + 40] = 1
    inflate(hits, STAMP, costs)
    return costs


def straight(*xs, yaw=0.0):
    """Bubbles on the x axis of an empty map."""
    return np.array([[x, 0.0, yaw, FREE] for x in xs])


def test_a_radius_is_the_distance_that_the_cost_of_one_cell_stands_for():
    costs = inflated([(0, 0)])
    assert expansion(costs, GRID, 0.0, 0.0, 10.0) == 0.0  # lethal
    assert expansion(costs, GRID, 0.25, 0.0, 10.0) == 0.0  # inscribed
    cost = math.floor(252 * math.exp(-10.0 * (0.35 - 0.265)))
    # Anywhere in the cell.
    for x in (0.33, 0.35, 0.37):
        assert expansion(costs, GRID, x, 0.0, 10.0) == pytest.approx(math.log(252 / cost) / 10.0)
    assert expansion(costs, GRID, 0.45, 0.0, 10.0) == pytest.approx(FREE)
    assert expansion(costs, GRID, 9.0, 0.0, 10.0) == pytest.approx(FREE)  # beyond the map


def test_redundant_bubbles_go_and_gaps_are_halved():
    costs = inflated()
    # Two of 0.553 m overlap up to 0.774 m. Of seven 0.25 m apart the middle one stays, and between it and the ends...
    refined = refine(costs, GRID, straight(0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5), RULES)
    assert refined[:, 0].tolist() == [0.0, 0.75, 1.5]
    # A gap of 1.5 m gets its middle, one of 3 m also their middles.
    assert refine(costs, GRID, straight(0.0, 1.5), RULES)[:, 0].tolist() == [0.0, 0.75, 1.5]
    assert refine(costs, GRID, straight(-1.5, 1.5), RULES)[:, 0].tolist() == [-1.5, -0.75, 0.0, 0.75, 1.5]


def test_a_band_overlaps_through_a_thin_obstacle_but_is_not_filled_through_it():
    """The nearest free cells are 0.45 m from a post's centre: 0.9 m apart, farther than 0.774. Beside it, they join."""
    costs = inflated([(0, 0)])
    near, far = straight(-0.45, 0.45), straight(-0.45, 0.30)
    assert len(refine(costs, GRID, near, RULES)) == 0
    assert (
        len(refine(costs, GRID, far, RULES)) == 2
    )  # their stored radii overlap: no cell between them is looked at


def test_an_empty_map_leaves_a_straight_band_and_pulls_a_bent_one_straight():
    costs = inflated()
    band = optimize(costs, GRID, straight(0.0, 0.7, 1.4), RULES)
    np.testing.assert_allclose(band[:, 1], 0.0, atol=1e-12)
    bent = straight(0.0, 0.6, 1.2)
    bent[1, 1] = 0.4
    assert abs(optimize(costs, GRID, bent, RULES)[1, 1]) < 0.2


def test_another_heading_of_the_robot_moves_the_next_bubble_along_a_straight_band():
    """The difference of heading counts as a length, so a part of the pull along the band is not left out."""
    costs, band = inflated(), straight(0.0, 0.7, 1.4, yaw=-math.pi / 2)
    band[0, 2] = 0.0
    moved = optimize(costs, GRID, band, RULES)
    assert abs(moved[1, 0] - 0.7) > 0.05
    np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-12)


def test_a_forbidden_bubble_breaks_the_band():
    costs = inflated([(0, 4)])
    assert len(optimize(costs, GRID, straight(-1.0, 0.0, 1.0), RULES)) == 0


def scene(seed):
    rng = np.random.default_rng(seed)
    costs = inflated(rng.integers(-40, 41, (rng.integers(0, 25), 2)))
    corners = np.cumsum(rng.normal(0.0, 0.3, (rng.integers(2, 8), 2)), axis=0)
    band = np.column_stack(
        [corners, rng.uniform(-1.5, 1.5, len(corners)), rng.uniform(0.02, 0.6, len(corners))]
    )
    return costs, band


def same(found, expected):
    if expected is None:
        assert len(found) == 0
    else:
        np.testing.assert_allclose(found, np.array(expected), rtol=0.0, atol=1e3 * KERNEL)


@given(SEEDS)
def test_refinement_is_the_slow_twin(seed):
    costs, band = scene(seed)
    expected = oracles.RosBand(costs, GRID, RULES).refine([tuple(bubble) for bubble in band.tolist()])
    same(refine(costs, GRID, band, RULES), expected)


@given(SEEDS)
def test_optimization_is_the_slow_twin(seed):
    costs, band = scene(seed)
    same(optimize(costs, GRID, band, RULES), oracles.RosBand(costs, GRID, RULES).optimize(band.tolist()))
