"""Where candidates may lie: about the base, in the sector that the lidar looks into and no further than it."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.guides.lme.candidates import sample
from lme.guides.lme.guide import LocalMinimumEscaper
from lme.robots import Lidar
from tests.builders import PUBLISHED, explained, observation, stage
from tests.tolerances import KERNEL

FOVS = st.one_of(st.floats(0.2, 6.2), st.just(2 * math.pi))
OFFSETS = st.floats(-0.3, 0.3)


def explain(robot, target=(4.0, 0.0), ranges=None, seed=0, **settings):
    made = LocalMinimumEscaper(robot, PUBLISHED, load_settings("guide/lme", candidates=settings))
    made.reset(np.random.default_rng(seed))
    return explained(made, observation(target, ranges, robot=robot))


def with_lidar(fov=2 * math.pi, num_beams=180, range_max=15.0, **mount):
    return stage(lidar=Lidar(num_beams=num_beams, fov=fov, range_min=0.02, range_max=range_max, **mount))


def polar(points):
    return np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])


def off_centre(points, lidar):
    """Bearing about the base from where the lidar looks, in [−π, π] [rad]."""
    return np.array([math.remainder(bearing - lidar.yaw, math.tau) for bearing in polar(points)[1]])


@given(FOVS, OFFSETS, OFFSETS, st.floats(-math.pi, math.pi), st.sampled_from(["polar", "area"]), OFFSETS)
def test_no_candidate_lies_outside_the_field_of_view(fov, x, y, yaw, distribution, target_y):
    robot = with_lidar(fov, x=x, y=y, yaw=yaw)
    seen = explain(robot, (3.0, target_y), distribution=distribution)
    assert len(seen.candidates) in (300, 301)
    assert polar(seen.candidates)[0].max() <= 5.0 + KERNEL
    assert np.abs(off_centre(seen.candidates, robot.lidar)).max() <= fov / 2 + KERNEL


def test_candidates_are_drawn_about_the_base_whichever_way_the_lidar_looks():
    # Lidar turned by 2 rad, field of view 1 rad: bearings from 1.5 to 2.5 rad about the base.
    robot = with_lidar(fov=1.0, x=0.3, y=-0.1, yaw=2.0)
    drawn = sample(
        np.random.default_rng(7),
        load_settings("guide/lme", candidates={"number": 50}).candidates,
        5.0,
        1.5,
        1.0,
    )
    assert explain(robot, seed=7, number=50).candidates == pytest.approx(drawn, abs=KERNEL)


@pytest.mark.parametrize(
    ("range_max", "max_range", "reach"), [(15.0, 5.0, 5.0), (2.0, 5.0, 2.0), (15.0, 1.0, 1.0)]
)
def test_candidates_reach_as_far_as_lidar_and_setting_allow(range_max, max_range, reach):
    robot = with_lidar(range_max=range_max)
    distance, _ = polar(explain(robot, (9.0, 0.0), number=2000, max_range=max_range).candidates)
    assert 0.99 * reach < distance.max() <= reach + KERNEL


@pytest.mark.parametrize("fov", [2 * math.pi, 1.5 * math.pi, 0.5])
def test_candidates_fill_the_whole_field_of_view(fov):
    # From the first beam to the last; on a full circle also between the last and the first.
    _, bearing = polar(explain(with_lidar(fov, num_beams=9), (9.0, 0.0), number=4000).candidates)
    counts, _ = np.histogram(bearing, bins=10, range=(-fov / 2, fov / 2))
    assert counts.sum() == 4000
    # 400 a bin, deviation 19: five of them either way.
    assert np.abs(counts - 400).max() < 95


@pytest.mark.parametrize(
    ("distribution", "mean", "inner"),
    # Uniform in range: mean 1/2, half of them in the inner half. Uniform per area: mean 2/3, a quarter.
    [("polar", 1 / 2, 1 / 2), ("area", 2 / 3, 1 / 4)],
)
def test_candidates_spread_over_range_as_the_distribution_says(distribution, mean, inner):
    config = load_settings("guide/lme", candidates={"number": 40000, "distribution": distribution}).candidates
    distance, bearing = polar(sample(np.random.default_rng(0), config, 4.0, -1.0, 2.0))
    # Deviations of a share or mean of 40,000 are below 0.0025.
    assert distance.mean() / 4.0 == pytest.approx(mean, abs=0.01)
    assert (distance < 2.0).mean() == pytest.approx(inner, abs=0.01)
    assert bearing.mean() == pytest.approx(0.0, abs=0.02)
    assert np.corrcoef(distance, bearing)[0, 1] == pytest.approx(0.0, abs=0.02)


def test_the_distribution_reaches_the_escaper():
    distance, _ = polar(explain(with_lidar(), (9.0, 0.0), number=4000, distribution="area").candidates)
    assert distance.mean() == pytest.approx(10 / 3, abs=0.1)


def test_the_same_seed_draws_the_same_candidates_and_each_step_new_ones():
    config = load_settings("guide/lme", candidates={"number": 20}).candidates
    rng, twin = np.random.default_rng(3), np.random.default_rng(3)
    first = sample(rng, config, 5.0, -1.0, 2.0)
    np.testing.assert_array_equal(first, sample(twin, config, 5.0, -1.0, 2.0))
    assert (first != sample(rng, config, 5.0, -1.0, 2.0)).all()


@pytest.mark.parametrize(
    ("yaw", "target", "candidate"),
    [
        (math.pi, (-3.0, 0.0), True),  # the lidar looks back
        (math.pi, (3.0, 0.0), False),
        (0.0, (3.0, 0.0), True),
        (0.0, (-3.0, 0.0), False),
        (0.0, (4.99, 0.0), True),  # 5 m about the base, wherever the lidar sits
        (0.0, (5.01, 0.0), False),
        (math.pi, (-4.99, 0.0), True),
        (math.pi, (-5.01, 0.0), False),
        (0.0, (3 * math.cos(0.99), 3 * math.sin(0.99)), True),  # the field of view ends at ±1 rad
        (0.0, (3 * math.cos(1.01), 3 * math.sin(1.01)), False),
        (0.5, (3 * math.cos(1.49), 3 * math.sin(1.49)), True),
        (0.5, (3 * math.cos(0.51), -3 * math.sin(0.51)), False),
    ],
)
def test_the_target_is_a_candidate_where_the_lidar_sees_it(yaw, target, candidate):
    seen = explain(with_lidar(fov=2.0, x=0.3, yaw=yaw), target)
    assert len(seen.candidates) == 300 + candidate
    assert (seen.candidates[-1].tolist() == list(target)) is candidate


def test_a_target_that_is_not_free_is_not_a_candidate():
    ranges = np.full(180, 15.0, dtype=np.float32)
    ranges[90] = 2.0
    assert len(explain(with_lidar(), (3.0, 0.0), ranges).candidates) == 300
    assert len(explain(with_lidar(), (1.0, 0.0), ranges).candidates) == 301


def test_the_target_may_be_left_out():
    config = load_settings("guide/lme", candidates={"number": 10, "target": False})
    seen = explained(LocalMinimumEscaper(stage(), PUBLISHED, config), observation(target=(3.0, 0.0)))
    assert len(seen.candidates) == 10
