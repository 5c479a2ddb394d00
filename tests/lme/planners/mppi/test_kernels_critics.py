"""MPPI's critics: each against plain numpy, and where each is silent."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.planners.mppi import kernels as critics
from tests import oracles
from tests.builders import shipped
from tests.tolerances import FLOAT32_LAYER

SEEDS = st.integers(0, 2**32 - 1)
SHAPE, GRID = (85, 85), (-42, -42, 0.06)
OUTLINE = shipped("jackal").footprint.outline(0.01)
STEPS = 56
PATH = np.column_stack([np.arange(0.0, 1.7, 0.03), 0.1 * np.sin(np.arange(0.0, 1.7, 0.03) * 4.0)])
PRICES = (1e6, 300.0, 3.81)


def drawn(seed, samples=30):
    """A generator, and smooth random trajectories from the origin: speeds (N, T) and poses (N, T, 3)."""
    rng = np.random.default_rng(seed)
    speeds = rng.uniform(-0.4, 0.9, (samples, 1)) + rng.normal(0.0, 0.1, (samples, STEPS))
    yaw = (
        np.cumsum(rng.uniform(-1.5, 1.5, (samples, 1)) + rng.normal(0.0, 0.5, (samples, STEPS)), axis=1)
        * 0.05
    )
    way = np.cumsum(speeds[..., None] * np.stack([np.cos(yaw), np.sin(yaw)], axis=-1), axis=1) * 0.05
    poses = np.concatenate([way, yaw[..., None]], axis=2)
    return rng, speeds.astype(np.float32), poses.astype(np.float32)


def added(critic, poses, *words):
    """What a critic adds to costs of 1, and what it returns."""
    costs = np.ones(len(poses))
    answer = critic(costs, poses, *words)
    return costs - 1.0, answer


def angle_apart(one, other):
    return np.abs(np.angle(np.exp(1j * (one - other))))


@given(SEEDS)
def test_critics_of_the_speed_count_the_way_beyond_bounds_and_backwards(seed):
    _, speeds, _ = drawn(seed)
    beyond, _ = added(critics.constraint, speeds, (-0.35, 0.5), 0.05, 4.0)
    excess = np.maximum(speeds - 0.5, 0.0) + np.maximum(-0.35 - speeds, 0.0)
    assert beyond == pytest.approx(4.0 * excess.sum(axis=1) * 0.05, abs=FLOAT32_LAYER)
    back, _ = added(critics.prefer_forward, speeds, 0.05, 5.0)
    assert back == pytest.approx(5.0 * np.maximum(-speeds, 0.0).sum(axis=1) * 0.05, abs=FLOAT32_LAYER)


@given(SEEDS, st.booleans(), st.sampled_from([0.0, 120.0]))
def test_costs_of_the_map_are_the_slow_twin(seed, near_goal, possible):
    rng, _, poses = drawn(seed, samples=8)
    cells = rng.integers(0, 254, SHAPE).astype(np.uint8)
    cells[rng.random(SHAPE) < 0.3] = 0
    cells[rng.random(SHAPE) < rng.choice([0.0, 0.0005, 0.05])] = 254
    found, all_collide = added(critics.obstacles, poses, 2, cells, GRID, OUTLINE, possible, PRICES, near_goal)
    expected, collides = oracles.mppi_obstacles(poses, 2, cells, GRID, OUTLINE, possible, PRICES, near_goal)
    assert found == pytest.approx(expected, abs=FLOAT32_LAYER)
    assert all_collide == collides.all()


def test_beyond_the_map_is_a_collision():
    _, _, poses = drawn(1)
    poses[:, 20:, 0] = 9.0
    _, all_collide = added(
        critics.obstacles, poses, 2, np.zeros(SHAPE, np.uint8), GRID, OUTLINE, 50.0, PRICES, False
    )
    assert all_collide


@given(SEEDS)
def test_the_critic_of_the_target_is_the_mean_distance(seed):
    _, _, poses = drawn(seed)
    found, _ = added(critics.goal, poses, (1.0, 0.3), 5.0)
    away = np.hypot(poses[..., 0] - 1.0, poses[..., 1] - 0.3)
    assert found == pytest.approx(5.0 * away.mean(axis=1), abs=FLOAT32_LAYER)


@given(SEEDS)
def test_the_furthest_point_is_the_best_of_the_nearest_ones_beyond_the_one_before(seed):
    _, _, poses = drawn(seed)
    furthest = 0
    for away in np.linalg.norm(PATH - poses[:, -1, None, :2], axis=2):
        furthest += int(away[furthest:].argmin())
    assert critics.furthest_reached(poses, PATH) == furthest
    assert critics.furthest_reached(poses[:1], PATH) == np.hypot(*(PATH - poses[0, -1, :2]).T).argmin()


@given(SEEDS)
def test_alignment_is_the_slow_twin(seed):
    rng, _, poses = drawn(seed)
    free, furthest = rng.random(len(PATH) - 1) < 0.97, int(rng.integers(20, len(PATH)))
    found, _ = added(critics.path_align, poses, PATH, free, furthest, 4, 20, 1.0, 14.0)
    expected = oracles.mppi_path_align(poses, PATH, free, furthest, 4, 14.0)
    assert found == pytest.approx(expected, abs=1e2 * FLOAT32_LAYER)


def test_alignment_is_silent_near_the_path_s_begin_and_where_much_is_blocked():
    _, _, poses = drawn(2)
    free = np.ones(len(PATH) - 1, np.bool_)
    silent = [(free, 19), (free, 0)]
    blocked = free.copy()
    blocked[5:9] = False
    silent.append((blocked, 40))
    for points, furthest in silent:
        found, _ = added(critics.path_align, poses, PATH, points, furthest, 4, 20, 0.05, 14.0)
        np.testing.assert_array_equal(found, 0.0)
    few = free.copy()
    few[5:7] = False  # two never count as much
    found, _ = added(critics.path_align, poses, PATH, few, 25, 4, 20, 0.05, 14.0)
    assert (found > 0.0).all()


@given(SEEDS)
def test_the_end_is_drawn_to_the_first_free_point_beyond_the_furthest(seed):
    rng, _, poses = drawn(seed)
    free, furthest = rng.random(len(PATH) - 1) < 0.3, int(rng.integers(0, len(PATH)))
    found, _ = added(critics.path_follow, poses, PATH, free, furthest, 5, 5.0)
    last = len(PATH) - 1
    later = [j for j in range(min(furthest + 5, last), last) if free[j]]
    at = later[0] if later else last - 1
    at = last if furthest + 5 >= last else at
    away = np.hypot(*(poses[:, -1, :2] - PATH[at]).T)
    assert found == pytest.approx(5.0 * away, abs=FLOAT32_LAYER)


@given(SEEDS)
def test_the_last_heading_is_drawn_to_a_point_of_the_path_if_the_robot_is_turned_away(seed):
    rng, _, poses = drawn(seed)
    at, yaw = int(rng.integers(1, len(PATH))), float(rng.uniform(-3.1, 3.1))
    found, _ = added(critics.path_angle, poses, PATH, (0.0, 0.0, yaw), at, 1.0, 2.0)
    bearing = np.arctan2(*(PATH[at] - poses[:, -1, :2]).T[::-1])
    wanted = 2.0 * angle_apart(bearing, poses[:, -1, 2])
    silent = angle_apart(np.arctan2(PATH[at, 1], PATH[at, 0]), yaw) < 1.0
    assert found == pytest.approx(0.0 if silent else wanted, abs=1e1 * FLOAT32_LAYER)


def test_points_in_the_inscribed_radius_and_off_the_map_are_not_free():
    cells = np.zeros(SHAPE, np.uint8)
    cells[43, 42], cells[44, 42], cells[45, 42] = 252, 253, 254
    path = np.array([[0.0, 0.0], [0.06, 0.0], [0.12, 0.0], [0.18, 0.0], [9.0, 0.0], [0.3, 0.0]])
    assert critics.free_points(path, cells, GRID).tolist() == [True, True, False, False, False]
