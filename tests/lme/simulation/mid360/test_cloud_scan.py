import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from lme.geometry.fan import direction
from lme.grids.edge_grid import NO_EDGES, edge_grid, first_hit
from lme.simulation.mid360.cloud_scan import cloud_scan
from lme.simulation.mid360.pattern import (
    beam_noise,
    beam_pattern,
    beam_table,
    noise_of,
    rise_share,
    turn_share,
)
from lme.simulation.mid360.raycast3d import to_circle, to_edge
from lme.types import Pose
from tests import oracles
from tests.tolerances import RANGE

SEEDS = st.integers(0, 2**32 - 1)


def scattered(rng):
    """A pose, and a few obstacles of which none holds it."""
    bearings, away = rng.uniform(-4, 4, 6), rng.uniform(1.0, 8.0, 6)
    centres = np.column_stack([away * np.cos(bearings), away * np.sin(bearings)])
    circles = np.column_stack([centres, rng.uniform(0.05, 0.7, 6)])[: rng.integers(0, 7)]
    edges = rng.uniform(-6.0, 6.0, (rng.integers(0, 7), 4))
    return Pose(*rng.uniform(-0.2, 0.2, 2), rng.uniform(-4, 4)), circles, edges


@given(SEEDS)
def test_the_scan_is_that_of_the_whole_cloud(seed):
    rng = np.random.default_rng(seed)
    pose, circles, edges = scattered(rng)
    first, number, phase, key = (
        int(rng.integers(0, 10**6)),
        400,
        tuple(rng.random(2)),
        int(rng.integers(2**63)),
    )
    std, height = rng.choice([0.0, 0.02, 0.3]), rng.uniform(0.1, 0.8)
    elevations, limits = (rng.uniform(-1.0, -0.1), rng.uniform(0.0, 1.0)), (0.1, rng.uniform(3.0, 40.0))
    heights = np.sort(
        rng.uniform(-0.2, 1.0, 2)
    )  # below, around or above the sensor, with and without the ground
    spans, bins = (0.1, rng.uniform(4.0, 20.0)), int(rng.integers(4, 400))
    scan = cloud_scan(
        pose, (first, number, *phase), tuple(beam_table(number)), (key, float(std)),
        (height, *elevations, *limits), tuple(heights), spans,
        bins, circles, edges, tuple(NO_EDGES),
    )  # fmt: skip
    beams, noise = beam_pattern(first, number, phase, elevations), std * beam_noise(first, number, key)
    expected = oracles.cloud_scan(pose, beams, noise, height, limits, heights, spans, bins, circles, edges)
    assert scan.dtype == np.float32
    np.testing.assert_allclose(scan, expected, rtol=0, atol=2 * RANGE)


@given(SEEDS)
def test_what_is_hidden_does_not_change_the_scan(seed):
    rng = np.random.default_rng(seed)
    pose, circles, edges = scattered(rng)
    wall = np.array([[7.0, 7.0], [-7.0, 7.0], [-7.0, -7.0], [7.0, -7.0]])
    room, outer = (np.hstack([side * wall, side * np.roll(wall, 1, axis=0)]) for side in (1.0, 1.2))

    def scan(edges):
        return cloud_scan(
            pose, (0, 5000, 0.1, 0.2), tuple(beam_table(5000)), (1, 0.02),
            (0.4, -0.12, 0.9, 0.1, 40.0), (0.05, 0.5), (0.1, 20.0),
            360, circles, edges, tuple(NO_EDGES),
        )  # fmt: skip

    np.testing.assert_array_equal(scan(np.vstack([edges, room, outer])), scan(np.vstack([edges, room])))


def test_the_ground_counts_if_its_height_does():
    def returns(lowest):
        scan = cloud_scan(
            Pose(0.0, 0.0, 0.0), (0, 5000, 0.1, 0.2), tuple(beam_table(5000)), (1, 0.0),
            (0.4, -0.5, 0.1, 0.1, 40.0), (lowest, 0.5), (0.1, 20.0),
            90, np.empty((0, 3)), np.empty((0, 4)), tuple(NO_EDGES),
        )  # fmt: skip
        return np.isfinite(scan).sum()

    assert returns(-0.05) == 90
    assert returns(0.05) == 0


@given(st.floats(-3.0, 3.0))
def test_directions_are_exact(turn):
    expected = math.cos(math.tau * turn), math.sin(math.tau * turn)
    assert direction(turn) == pytest.approx(expected, abs=1e-14)


@njit(error_model="numpy")
def scan_by_all_beams(pose, beams, noise, sensor, heights, spans, num_bins, circles, edges, grid):
    """The arithmetic of `cloud_scan` for every beam of the cloud and every obstacle."""
    ranges = np.full(num_bins, np.float32(np.inf))
    for beam in range(beams[0], beams[0] + beams[1]):
        turn, heading = turn_share(beam, beams[2]), pose[2] / (2.0 * math.pi)
        bearing = turn + heading
        ray = direction(bearing - np.floor(bearing))
        elevation = sensor[1] + (sensor[2] - sensor[1]) * rise_share(beam, beams[3])
        cos, sin = direction(elevation / (2.0 * math.pi))
        reach = np.inf
        for x, y, r in circles:
            centre = (x - pose[0], y - pose[1], r)
            reach = min(reach, to_circle((ray[0], ray[1], 0.0), centre, -np.inf, np.inf))
        for ax, ay, bx, by in edges:
            ends = (ax - pose[0], ay - pose[1], bx - pose[0], by - pose[1])
            reach = min(reach, to_edge((ray[0], ray[1], 0.0), ends, -np.inf, np.inf))
        if len(grid[2]):
            reach = first_hit(pose[0], pose[1], (1.0, 0.0), ray, reach, grid[0], grid[1], grid[2])
        if sensor[0] * cos + reach * sin < 0.0:
            reach = -sensor[0] * cos / sin
        distance = reach / cos
        if distance > sensor[4]:
            continue
        distance += noise[1] * noise_of(beam, np.uint64(noise[0]))
        z, flat = sensor[0] + distance * sin, distance * cos
        if distance >= sensor[3] and heights[0] <= z <= heights[1] and spans[0] <= flat <= spans[1]:
            k = int((turn + 0.5 - np.floor(turn + 0.5)) * num_bins + 0.5) % num_bins
            ranges[k] = min(ranges[k], np.float32(flat))
    return ranges


@given(SEEDS)
def test_beams_that_are_not_cast_do_not_change_a_bit_of_the_scan(seed):
    rng = np.random.default_rng(seed)
    pose, circles, edges = scattered(rng)
    # Small boxes in a room, sometimes by a wall or on it, and sometimes a wall behind it or through it.
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    boxes = [
        rng.uniform(-5, 5, 2) + rng.uniform(0.02, 0.6) * corners for _ in range(int(rng.integers(0, 40)))
    ]
    boxes += [size * corners for size in rng.choice([5.0, 5.0000001, 6.0], rng.integers(0, 3))]
    sides = [np.hstack([box, np.roll(box, 1, axis=0)]) for box in boxes]
    edges = np.vstack([edges[: rng.integers(0, len(edges) + 1)], *sides])
    if rng.random() < 0.3:  # right on an obstacle, or in one
        pose = Pose(
            *(edges[0, :2] if len(edges) else circles[0, :2] if len(circles) else (0.0, 0.0)), pose.yaw
        )
    grid = edge_grid(np.vstack(sides)) if sides and rng.random() < 0.3 else NO_EDGES
    if len(grid.edges):
        edges = edges[: len(edges) - 4 * len(sides)]
    first, number = int(10 ** rng.uniform(0, 8)), int(rng.integers(1, 20_001))
    beams, noise = (
        (first, number, *rng.random(2).tolist()),
        (int(rng.integers(2**63)), float(rng.choice([0.0, 0.02, 0.3]))),
    )
    sensor = (
        rng.uniform(0.1, 0.8),
        rng.uniform(-1.0, 0.1),
        rng.uniform(0.2, 1.0),
        0.1,
        rng.uniform(3.0, 40.0),
    )
    heights = tuple(np.sort(rng.choice([rng.uniform(-0.2, 1.0), 0.05, 0.5], 2, replace=False)).tolist())
    rest = (heights, (0.1, rng.uniform(4.0, 20.0)), int(rng.integers(4, 721)), circles, edges, tuple(grid))
    scan = cloud_scan(pose, beams, tuple(beam_table(number)), noise, sensor, *rest)
    np.testing.assert_array_equal(scan, scan_by_all_beams(pose, beams, noise, sensor, *rest))
