"""The grid over many edges gives what all edges give, to the last bit."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_robot, load_settings
from lme.geometry.collision import sweep
from lme.grids.edge_grid import NO_EDGES, edge_grid, near_edges, nearest
from lme.perception.raycast import cast_grid, cast_shapes
from lme.simulation.fast import FastSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.types import Pose, Twist
from lme.worlds.contours import outlines
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import task

SEEDS = st.integers(0, 2**32 - 1)
NO_CIRCLES = np.empty((0, 3))
CELL = 0.05


def scattered(rng):
    """Edges of all lengths and directions."""
    centres, lengths = rng.uniform(-8, 8, (rng.integers(1, 300), 2)), rng.choice([0.0, 0.05, 0.5, 12.0])
    bearings = rng.uniform(-math.pi, math.pi, len(centres))
    halves = np.column_stack([np.cos(bearings), np.sin(bearings)]) * lengths / 2
    return np.hstack([centres - halves, centres + halves])


def stairs(rng):
    """Outlines of cells of 5 cm, as of a picture."""
    occupied = rng.random((60, 80)) < rng.uniform(0.01, 0.3)
    return World(polygons=tuple((outline - [40, 30]) * CELL for outline in outlines(occupied))).edges


def pose_in(rng):
    """A pose anywhere, also outside, or on the corners of the cells and along their sides."""
    if rng.random() < 0.5:
        return (*rng.uniform(-9, 9, 2), rng.uniform(-4, 4))
    return (*(rng.integers(-40, 40, 2) * CELL), rng.integers(-2, 3) * math.pi / 2)


def drawn(seed):
    rng = np.random.default_rng(seed)
    edges = scattered(rng) if rng.random() < 0.5 else stairs(rng)
    return rng, edges, edge_grid(edges), pose_in(rng)


@settings(max_examples=200)
@given(SEEDS)
def test_a_scan_is_that_of_all_edges(seed):
    rng, edges, grid, pose = drawn(seed)
    num_beams = int(rng.integers(2, 400))
    fov = rng.choice([2 * math.pi, 1.5 * math.pi, 0.6])
    angles = (rng.choice([-math.pi, rng.uniform(-7, 7)]), fov / num_beams, num_beams)
    range_max = rng.choice([0.5, 4.0, 30.0])
    expected = cast_shapes(pose, angles, range_max, NO_CIRCLES, edges)
    np.testing.assert_array_equal(cast_grid(pose, angles, range_max, grid), expected)


@settings(max_examples=200)
@given(SEEDS)
def test_a_collision_check_is_that_of_all_edges(seed):
    rng, edges, grid, pose = drawn(seed)
    box = (*rng.uniform(0.0, 0.5, 2), rng.uniform(0.0, 0.3))
    steps = rng.uniform(-0.1, 0.1, (rng.integers(1, 12), 3))
    poses = np.array(pose) + np.cumsum(steps, axis=0)
    near = near_edges(grid, poses, box)
    assert sweep(poses, box, NO_CIRCLES, near) == sweep(poses, box, NO_CIRCLES, edges)


@given(SEEDS)
def test_the_nearest_edge_is_that_of_all(seed):
    _, edges, grid, pose = drawn(seed)
    clearance, _ = sweep(np.array([pose]), (0.0, 0.0, 0.0), NO_CIRCLES, edges)
    assert nearest(*pose[:2], *grid) == pytest.approx(clearance, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("place", [(math.nan, 0.0), (0.0, math.inf), (1e300, -1e300)])
def test_it_ends_at_any_place(place):
    grid = edge_grid(stairs(np.random.default_rng(0)))
    assert len(near_edges(grid, np.array([[*place, 0.0]]), (0.1, 0.1, 0.0))) <= len(grid.edges)
    assert len(cast_grid((*place, 0.0), (0.0, 0.1, 20), 5.0, grid)) == 20


def test_a_grid_looks_at_few_edges():
    edges = stairs(np.random.default_rng(0))
    near = near_edges(edge_grid(edges), np.zeros((1, 3)), (0.1, 0.1, 0.0))
    assert 0 < len(near) < len(edges) / 20


def test_only_a_world_of_many_edges_has_a_grid():
    edges = scattered(np.random.default_rng(3))
    assert len(World(segments=edges[:100]).grid.edges) == 0
    assert len(World(segments=np.vstack([edges] * 6)).grid.edges) >= 512


def hall(moving):
    """A task in a room of 16 × 12 m with rough walls and a pillar, and the same without a grid."""
    solid = np.zeros((240, 320), dtype=bool)
    solid[:6] = solid[-6:] = True
    solid[:, :6] = solid[:, -6:] = True
    solid[50:70, 100:110] = True
    solid |= (np.random.default_rng(0).random(solid.shape) < 0.3) & (
        np.roll(solid, 1, 0) | np.roll(solid, 1, 1)
    )
    disc, door = np.array([[2.0, 4.0, 0.0], [6.0, 4.0, 0.0]]), np.array([[6.0, 1.0, 0.0], [6.0, 1.0, 3.0]])
    leaf = np.array([[0.0, 0.0], [0.8, 0.0], [0.8, 0.05], [0.0, 0.05]])
    movers = (Mover(disc, radius=0.2), Mover(door, outline=leaf)) if moving else ()
    world = World(polygons=tuple(outline * CELL for outline in outlines(solid)), movers=movers)
    gridless = dataclasses.replace(world)
    object.__setattr__(gridless, "grid", NO_EDGES)
    assert len(world.grid.edges) > 0
    return [task(each, start=Pose(1.0, 3.0, 0.1), goal=np.array([7.0, 3.0])) for each in (world, gridless)]


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize(
    ("robot", "simulator", "config"),
    [
        ("stage", FastSimulator, load_settings("sim/fast")),
        ("stage", FastSimulator, load_settings("sim/fast", latency=0.1, slip=0.05)),
        ("go2", FastSimulator, load_settings("sim/fast")),
        ("jackal", SkidSimulator, load_settings("sim/skid")),
    ],
)
def test_an_episode_is_that_without_a_grid(robot, simulator, config, moving):
    driven = []
    for each in hall(moving):
        sim, seen = simulator(config, load_robot(robot)), []
        observation = sim.reset(each, np.random.default_rng(0))
        for step in range(40):
            observation = sim.step(Twist(0.4, 0.1 * math.sin(step)))
            seen.append(
                (sim.state.pose, sim.state.clearance, sim.state.contact, observation.scan.ranges.tolist())
            )
            if sim.state.contact:
                break
        driven.append(seen)
    assert driven[0] == driven[1]
    assert len(driven[0]) > 10
