"""Samples of a band: the slow twins, and what teb_local_planner does on bands worked out by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.collision import sweep
from lme.planners.teb.kernels import along, clearance, near_obstacles, resized
from lme.types import Pose
from tests import oracles
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
JACKAL, DISC = (0.21, 0.155, 0.0), (0.0, 0.0, 0.2)


def drawn(seed):
    """A generator and a band."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 20))
    poses = rng.uniform((-1.0, -1.0, -3.0), (1.0, 1.0, 3.0), (count, 3))
    return rng, poses, rng.uniform(0.01, 1.5, count - 1)


@given(SEEDS)
def test_samples_are_added_and_removed_as_by_the_slow_twin(seed):
    _, poses, times = drawn(seed)
    found = resized(poses, times, 0.3, 0.1, 3, 40)
    expected = oracles.teb_resized(poses, times, 0.3, 0.1, 3, 40)
    assert found[1] == pytest.approx(expected[1], abs=KERNEL)
    assert found[0][:, :2] == pytest.approx(expected[0][:, :2], abs=KERNEL)
    turned = found[0][:, 2] - expected[0][:, 2]
    assert np.cos(turned) == pytest.approx(1.0, abs=KERNEL)


def test_a_new_band_follows_the_path_as_fast_as_the_limits_allow():
    path = np.array([[1.0, 0.0], [1.0, 1.0]])
    poses, times = along(path, Pose(0.0, 0.0, 0.0), 0.5, 0.5, 1.0)
    np.testing.assert_allclose(poses, [[0, 0, 0], [1, 0, math.pi / 2], [1, 1, 0.5]])
    assert times == pytest.approx([2.0, 2.0])
    poses, times = along(path, Pose(0.0, 0.0, 0.0), 0.5, 4.0, 1.0)
    assert times == pytest.approx([math.pi / 2, math.pi / 2 - 0.5])


def test_a_path_of_one_point_gives_three_poses():
    poses, times = along(np.array([[1.0, 2.0]]), Pose(0.0, 0.0, 0.3), 0.5, 1.0, 1.0)
    assert poses[:, :2] == pytest.approx(np.array([[0.0, 0.0], [0.5, 1.0], [1.0, 2.0]]))
    assert poses[0, 2] == 0.3
    assert (times > 0.0).all()


@given(SEEDS, st.sampled_from([JACKAL, DISC]))
def test_the_obstacles_that_count_are_those_of_the_slow_twin(seed, box):
    rng, poses, _ = drawn(seed)
    points = rng.uniform(-2.0, 2.0, (40, 2))
    found = near_obstacles(poses, points, box, 0.2, 0.65)
    assert sorted(map(tuple, found)) == oracles.teb_near(poses, points, box, 0.2, 0.65)


@given(SEEDS, st.sampled_from([JACKAL, DISC]))
def test_the_clearance_and_its_gradient(seed, box):
    rng = np.random.default_rng(seed)
    pose, (x, y) = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 2)
    distance, gradient = clearance(pose, x, y, box)
    assert distance == pytest.approx(oracles.teb_clearance(pose, x, y, box), abs=KERNEL)
    swept = sweep(pose[None], box, np.array([[x, y, 0.0]]), np.empty((0, 4)))[0]
    assert max(distance, 0.0) == pytest.approx(swept, abs=KERNEL)
    for c in range(3):
        step = np.eye(3)[c] * 1e-6
        ahead, behind = (oracles.teb_clearance(pose + sign * step, x, y, box) for sign in (1, -1))
        assert gradient[c] == pytest.approx((ahead - behind) / 2e-6, abs=1e-4)
