"""A scan over a lattice of edges is that of all edges, to the last bit."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings

from lme.grids.edge_grid import edge_grid
from lme.grids.lattice import NO_LATTICE, lattice_of
from lme.perception.raycast import cast_grid, cast_shapes
from lme.worlds.contours import outlines
from lme.worlds.world import World
from tests.lme.grids.test_edge_grid import CELL, NO_CIRCLES, SEEDS, pose_in, stairs


def building(rng):
    """Edges of a picture of walls with rough sides, somewhere, with a few walls that are thin or doubled."""
    solid = np.zeros((90, 120), dtype=bool)
    for _ in range(rng.integers(1, 12)):
        row, column, tall, wide = rng.integers(0, 90), rng.integers(0, 120), *rng.choice([1, 2, 25], 2)
        solid[row : row + tall, column : column + wide] = True
    solid |= (rng.random(solid.shape) < 0.3) & np.roll(solid, 1, 0)
    solid[0, 0] = solid[-1, -1] = True
    origin = rng.choice([0.0, -37.123, 512.7], 2)
    edges = np.vstack([np.hstack([each, np.roll(each, -1, axis=0)]) for each in outlines(solid)]).astype(
        float
    )
    extra = edges[rng.integers(0, len(edges), 5)][:, [2, 3, 0, 1]]
    return np.vstack([edges, extra]) * CELL + np.tile(origin, 2), np.array(origin)


def place_in(rng, edges, origin):
    """A pose anywhere, on a line or a node of the lattice, at the end of an edge, very near to one, or outside."""
    kind = rng.integers(5)
    place = origin + rng.uniform(-0.5, [6.5, 5.0])
    if kind == 1:
        place = origin + rng.integers(0, 90, 2) * CELL
    elif kind == 2:
        place[0] = origin[0] + rng.integers(0, 120) * CELL
    elif kind > 2:
        place = edges[rng.integers(len(edges)), :2] + (kind == 4) * rng.choice([0, 1e-12, 1e-7, 1e-3], 2)
    heading = rng.choice([rng.uniform(-7, 7), rng.integers(-8, 9) * math.pi / 4, 1e-5])
    return (*place.tolist(), float(heading))


@settings(max_examples=300)
@given(SEEDS)
@example(22732764)  # a beam runs along the line of an edge before the lidar
@example(362)  # a beam runs along the line of an edge behind the lidar
def test_a_scan_is_that_of_all_edges(seed):
    rng = np.random.default_rng(seed)
    edges, origin = building(rng)
    grid, lattice = edge_grid(edges), lattice_of(edges)
    assert len(lattice.edges) == len(edges)
    for _ in range(4):
        pose, num_beams = place_in(rng, edges, origin), int(rng.integers(1, 500))
        fov, first = rng.choice([2 * math.pi, 0.6]), rng.choice([-math.pi, 0.0, rng.uniform(-7, 7)])
        angles = (first, fov / num_beams, num_beams)
        range_max = rng.choice([0.5, 3.0, 30.0])
        expected = cast_shapes(pose, angles, range_max, NO_CIRCLES, edges)
        np.testing.assert_array_equal(cast_grid(pose, angles, range_max, grid, lattice), expected)


def test_beams_through_the_nodes_are_those_of_all_edges():
    rng = np.random.default_rng(0)
    edges, _ = building(rng)
    edges -= edges.min()
    grid, lattice = edge_grid(edges), lattice_of(edges)
    for _ in range(300):
        place = rng.integers(1, 90, 2) * CELL
        to = edges[rng.integers(len(edges)), :2] - place
        angles = (math.atan2(to[1], to[0]), 1e-9, 3)
        pose = (*place.tolist(), 0.0)
        expected = cast_shapes(pose, angles, 30.0, NO_CIRCLES, edges)
        np.testing.assert_array_equal(cast_grid(pose, angles, 30.0, grid, lattice), expected)


@pytest.mark.parametrize("place", [(math.nan, 0.0), (0.0, math.inf), (1e300, -1e300), (-50.0, 0.0)])
def test_any_place_gives_what_the_grid_gives(place):
    edges = stairs(np.random.default_rng(0))
    grid, scan = edge_grid(edges), ((*place, 0.3), (0.0, 0.1, 20), 5.0)
    np.testing.assert_array_equal(cast_grid(*scan, grid, lattice_of(edges)), cast_grid(*scan, grid))


@given(SEEDS)
def test_the_stairs_of_a_picture_are_on_a_lattice(seed):
    rng = np.random.default_rng(seed)
    edges, pose = stairs(rng), pose_in(rng)
    grid, angles = edge_grid(edges), (-math.pi, 0.05, 120)
    expected = cast_shapes(pose, angles, 4.0, NO_CIRCLES, edges)
    np.testing.assert_array_equal(cast_grid(pose, angles, 4.0, grid, lattice_of(edges)), expected)


@pytest.mark.parametrize(
    "change",
    [
        lambda edges: edges + np.array([0, 0, 1e-3, 0]),  # slanted
        lambda edges: np.vstack([edges, [[0.02, 0.0, 0.02, 0.05]]]),  # between the lines
        lambda edges: np.vstack([edges, [[0.0, 0.0, 0.0, 0.0]]]),  # a point
        lambda edges: np.vstack([edges, [[0.0, 0.0, 1e-6, 0.0]]]),  # too fine
        lambda edges: edges[edges[:, 1] == edges[:, 3]][:1],  # without height
    ],
)
def test_other_edges_are_not_on_a_lattice(change):
    edges = stairs(np.random.default_rng(0))
    assert len(lattice_of(edges).edges) > 0
    assert lattice_of(np.ascontiguousarray(change(edges))) is NO_LATTICE


def test_a_world_of_many_edges_has_a_lattice():
    solid = np.random.default_rng(0).random((40, 40)) < 0.3
    polygons = tuple(outline * CELL for outline in outlines(solid))
    assert len(World(polygons=polygons).lattice.edges) > 512
    assert World(polygons=polygons[:5]).lattice is NO_LATTICE
