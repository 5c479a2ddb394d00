import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.grids.obstacle_grid import observe
from lme.types import Pose

SEEDS = st.integers(0, 2**32 - 1)
NO_STAMP = np.zeros((0, 3), np.int64)
HERE = Pose(0.0, 0.0, 0.0)


def beams(
    ranges,
    hits=None,
    number=1,
    keep=0,
    bearing=0.0,
    pose=HERE,
    spans=(0.1, 10.0, 2.5, 3.0),
    inf_is_valid=True,
):
    """Hits after one scan, by lattice cell, on a 9 × 9 m grid of 0.1 m around the origin."""
    hits = np.zeros((91, 91), np.int32) if hits is None else hits
    observe(
        hits,
        np.zeros(hits.shape, np.uint8),
        (-45, -45, 0.1),
        NO_STAMP,
        number,
        keep,
        pose,
        np.array(ranges, dtype=np.float32),
        (bearing, math.pi / 3),
        spans,
        inf_is_valid,
    )
    return hits


def cells(hits):
    """Lattice cells that are occupied."""
    return {(int(i) - 45, int(j) - 45) for i, j in np.argwhere(hits)}


def test_the_cell_that_a_beam_hits_is_marked():
    assert cells(beams([1.02])) == {(10, 0)}
    assert cells(beams([1.02], bearing=math.pi / 2, pose=Pose(0.5, 0.3, math.pi / 2))) == {(-5, 3)}


@pytest.mark.parametrize("nothing", [0.0, 0.09, -1.0, math.nan, -math.inf, 10.0, math.inf, 2.6])
def test_beams_without_a_hit_or_with_one_too_far_mark_no_cell(nothing):
    assert cells(beams([nothing])) == set()


@pytest.mark.parametrize("through", [2.0, 9.0, 10.0, math.inf])
def test_a_beam_frees_what_it_passes(through):
    assert (10, 0) not in cells(beams([through], beams([1.0]), number=2))


@pytest.mark.parametrize("silent", [0.0, 0.05, math.nan, -math.inf])
def test_a_beam_that_says_nothing_frees_nothing(silent):
    assert cells(beams([silent], beams([1.0]), number=2)) == {(10, 0)}


def test_nothing_is_freed_beyond_raytrace_range_or_behind_the_hit():
    assert cells(beams([9.0], beams([2.0]), number=2, spans=(0.1, 10.0, 2.5, 1.5))) == {(20, 0)}
    assert cells(beams([1.0], beams([2.0]), number=2)) == {(20, 0), (10, 0)}


@pytest.mark.parametrize("nothing", [10.0, 20.0, math.inf])
def test_a_beam_without_a_return_frees_cells_only_if_it_is_valid(nothing):
    assert cells(beams([nothing], beams([1.0]), number=2)) == set()
    assert cells(beams([nothing], beams([1.0]), number=2, inf_is_valid=False)) == {(10, 0)}


def test_a_beam_without_a_return_frees_nothing_beyond_the_lidars_range():
    far = beams([2.0], spans=(0.1, 10.0, 5.0, 5.0))
    assert cells(beams([math.inf], far.copy(), number=2, spans=(0.1, 1.5, 5.0, 5.0))) == {(20, 0)}
    assert cells(beams([math.inf], far, number=2, spans=(0.1, 2.5, 5.0, 5.0))) == set()


def test_a_hit_beyond_obstacle_range_keeps_its_cell_if_hits_persist():
    marked = beams([2.7], spans=(0.1, 10.0, 5.0, 5.0))
    assert cells(beams([2.7], marked.copy(), number=2, keep=1)) == {(27, 0)}
    assert cells(beams([2.7], beams([2.7], marked, number=2, keep=1), number=4, keep=1)) == {(27, 0)}
    assert cells(beams([2.7], beams([2.7], spans=(0.1, 10.0, 5.0, 5.0)), number=2)) == set()


def test_a_beam_does_not_free_what_another_of_the_same_scan_hits():
    ranges, angles = np.array([1.02, 2.0], dtype=np.float32), (0.0, 0.01)  # 2 cm apart at the first cell
    hits = np.zeros((91, 91), np.int32)
    spans = (0.1, 10.0, 2.5, 3.0)
    observe(
        hits,
        np.zeros(hits.shape, np.uint8),
        (-45, -45, 0.1),
        NO_STAMP,
        1,
        0,
        HERE,
        ranges,
        angles,
        spans,
        True,
    )
    assert cells(hits) == {(10, 0), (20, 0)}


def test_a_hit_persists_for_as_many_scans_as_asked():
    hits = beams([1.0], number=5)
    for number in (6, 7):
        assert (10, 0) in cells(beams([2.0], hits, number=number, keep=2))
    assert (10, 0) not in cells(beams([2.0], hits, number=8, keep=2))


def test_outside_the_grid_there_is_nothing_to_mark_or_free():
    far = Pose(20.0, -30.0, 1.0)
    assert cells(beams([1.0, 2.0, 9.0], pose=far)) == set()


@given(SEEDS)
def test_a_beam_without_a_hit_frees_the_cells_that_its_segment_cuts(seed):
    rng = np.random.default_rng(seed)
    pose, length = Pose(*rng.uniform(-5, 5, 2), rng.uniform(-4, 4)), rng.uniform(0.1, 3)
    if seed % 4 == 0:
        pose = Pose(pose.x, pose.y, rng.integers(-2, 3) * math.pi / 2)
    hits = beams(
        [math.inf], np.ones((91, 91), np.int32), number=2, pose=pose, spans=(0.01, length, 0.02, 3.0)
    )
    length = float(np.float32(length))
    freed = np.argwhere(hits == 0) - 45
    inner, outer = (cut_cells(pose, length, slack) for slack in (-1e-6, 1e-6))
    assert inner <= {tuple(cell) for cell in freed.tolist()} <= outer


def cut_cells(pose, length, slack):
    """Cells of the grid, grown by `slack` [m], that the segment meets: clipped against each, one by one."""
    direction = np.array([math.cos(pose.yaw), math.sin(pose.yaw)])
    direction[direction == 0] = 1e-300
    i, j = np.mgrid[-45:46, -45:46]
    near, far = np.zeros(i.shape), np.full(i.shape, length)
    for centre, at, step in zip((i, j), pose[:2], direction, strict=True):
        a, b = sorted_pair(
            (0.1 * centre - 0.05 - slack - at) / step, (0.1 * centre + 0.05 + slack - at) / step
        )
        near, far = np.maximum(near, a), np.minimum(far, b)
    meets = near < far - max(-slack, 0.0)
    return {(int(a), int(b)) for a, b in zip(i[meets], j[meets], strict=True)}


def sorted_pair(a, b):
    return np.minimum(a, b), np.maximum(a, b)
