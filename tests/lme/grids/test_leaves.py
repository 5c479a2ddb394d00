"""Leaves give what all their shapes give, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.geometry.collision import sweep
from lme.grids.leaves import LEAF, Leaves, leaves_of, near_discs
from lme.perception.raycast import cast_leaves, cast_shapes
from lme.worlds.world import World
from tests.lme.grids.test_edge_grid import pose_in, scattered, stairs

SEEDS = st.integers(0, 2**32 - 1)
NO_EDGES = np.empty((0, 4))


def discs_in(rng):
    """Discs, from none to many, of one size or of all."""
    count = rng.choice([0, 1, 15, 16, 17, 200, 1500])
    radii = rng.choice([0.02, 0.3, 0.0]) + rng.choice([0.0, 0.2, 2.0]) * rng.random(count)
    return np.column_stack([rng.uniform(-8, 8, (count, 2)), radii])


@settings(max_examples=200)
@given(SEEDS)
def test_a_scan_is_that_of_all_shapes(seed):
    rng = np.random.default_rng(seed)
    circles = discs_in(rng)
    edges = [NO_EDGES, scattered(rng), stairs(rng)][rng.integers(3)]
    num_beams = int(rng.integers(2, 400))
    fov = rng.choice([2 * math.pi, 1.5 * math.pi, 0.6, 3.9 * math.pi])
    angles = (rng.choice([-math.pi, rng.uniform(-7, 7)]), fov / num_beams, num_beams)
    scan = pose_in(rng), angles, rng.choice([0.5, 4.0, 30.0])
    expected = cast_shapes(*scan, circles, edges)
    np.testing.assert_array_equal(cast_leaves(*scan, leaves_of(circles), leaves_of(edges)), expected)


@settings(max_examples=200)
@given(SEEDS)
def test_a_collision_check_is_that_of_all_discs(seed):
    rng = np.random.default_rng(seed)
    circles = discs_in(rng)
    box = (*rng.uniform(0.0, 0.5, 2), rng.uniform(0.0, 0.3))
    poses = np.array(pose_in(rng)) + np.cumsum(rng.uniform(-0.1, 0.1, (rng.integers(1, 12), 3)), axis=0)
    near = near_discs(leaves_of(circles), poses, box)
    assert sweep(poses, box, near, NO_EDGES) == sweep(poses, box, circles, NO_EDGES)


@given(SEEDS)
def test_every_shape_is_in_a_leaf_within_its_bounds(seed):
    rng = np.random.default_rng(seed)
    shapes = discs_in(rng) if rng.random() < 0.5 else scattered(rng)
    leaves = leaves_of(shapes)
    rows = leaves.shapes.transpose(0, 2, 1).reshape(-1, shapes.shape[1])
    assert len(rows) - len(shapes) < LEAF
    held = rows[: len(shapes)]
    np.testing.assert_array_equal(held[np.lexsort(held.T)], shapes[np.lexsort(shapes.T)])
    for k, (x, y, reach) in enumerate(leaves.bounds.T):
        for row in rows[k * LEAF : min((k + 1) * LEAF, len(shapes))]:
            ends = [(row[:2], row[2])] if len(row) == 3 else [(row[:2], 0.0), (row[2:], 0.0)]
            assert all(math.dist((x, y), end) + radius <= reach for end, radius in ends)


def test_a_search_looks_at_few_discs():
    rng = np.random.default_rng(0)
    circles = np.column_stack([rng.uniform(-50, 50, (10_000, 2)), np.full(10_000, 0.1)])
    near = near_discs(leaves_of(circles), np.zeros((1, 3)), (0.2, 0.2, 0.0))
    assert 0 < len(near) < 30


@pytest.mark.parametrize("place", [(math.nan, 0.0), (0.0, math.inf), (1e300, -1e300)])
def test_it_ends_at_any_place(place):
    rng = np.random.default_rng(1)
    discs, edges = leaves_of(np.abs(rng.normal(size=(300, 3)))), leaves_of(stairs(rng))
    assert len(cast_leaves((*place, 0.0), (0.0, 0.1, 20), 5.0, discs, edges)) == 20
    assert len(near_discs(discs, np.array([[*place, 0.0]]), (0.1, 0.1, 0.0))) <= discs.shapes.size


def test_a_world_has_leaves_of_all_that_stands():
    rng = np.random.default_rng(2)
    world = World(circles=rng.random((40, 3)), segments=rng.random((20, 4)))
    for leaves, shapes in ((world.discs, world.circles), (world.walls, world.edges)):
        assert isinstance(leaves, Leaves)
        for mine, its in zip(leaves, leaves_of(shapes), strict=True):
            np.testing.assert_array_equal(mine, its)
