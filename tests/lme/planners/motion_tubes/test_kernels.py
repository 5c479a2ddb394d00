"""What tubes ask of the scan and which one is chosen, against slow twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.geometry.collision import sweep
from lme.geometry.frames import to_robot
from lme.planners.motion_tubes.kernels import (
    arc_pose,
    choose,
    free_ranges,
    free_tubes,
    known_free,
    out_of_sight,
    points_along,
    swept_ranges,
    whisker_free,
)
from lme.planners.motion_tubes.tubes import grown_outline
from lme.types import Pose
from tests.lme.planners.motion_tubes.scenes import NO_EDGES
from tests.tolerances import KERNEL, RANGE


@given(st.floats(-6.0, 6.0), st.floats(-2.0, 2.0))
def test_arc_pose_is_the_end_of_many_small_steps(curvature, way):
    x, y, yaw = 0.0, 0.0, 0.0
    for _ in range(400):
        yaw += curvature * way / 800
        x, y = x + way / 400 * math.cos(yaw), y + way / 400 * math.sin(yaw)
        yaw += curvature * way / 800
    assert arc_pose(curvature, way) == pytest.approx((x, y, yaw), abs=1e-3)


def slow_ranges(curvature, length, steps, outline, front, lidar, increment, num_beams):
    """Every beam with every side of every placement, as two linear equations."""
    needs = np.zeros(num_beams)
    side = np.sign(curvature)
    for k in range(1, steps + 1):
        x, y, yaw = arc_pose(curvature, length * k / steps)
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        corners = outline @ turn.T + (x, y)
        for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            for i in range(num_beams):
                beam = np.array([math.cos(lidar[2] + i * increment), math.sin(lidar[2] + i * increment)])
                system = np.column_stack((beam, a - b))
                if abs(np.linalg.det(system)) < 1e-12:
                    continue
                way, share = np.linalg.solve(system, a - lidar[:2])
                hit = np.array(lidar[:2]) + way * beam
                swept = hit[0] >= front or (hit[0] >= 0.0 and side * hit[1] > 0.0)
                if way > 0.0 and 0.0 <= share <= 1.0 and swept:
                    needs[i] = max(needs[i], way)
    return needs


@given(
    st.floats(-1.7, 1.7).filter(lambda heading: heading == 0.0 or abs(heading) > 1e-6),
    st.floats(0.2, 1.0),
    st.floats(-0.15, 0.15),
    st.floats(-3.0, 0.0),
    st.sampled_from([0.0, 0.1]),
)
def test_swept_ranges_are_those_of_every_beam_with_every_side(heading, length, lidar_x, first, rounding):
    outline = grown_outline((0.2013, 0.15 - rounding / 2, rounding), 0.1, 0.05)  # no side on the axle
    front, lidar, increment, count = 0.3013 + rounding, (lidar_x, 0.013, first), 0.0871, 60
    needs, _ = swept_ranges(np.array([heading / length]), length, 4, outline, front, lidar, increment, count)
    slow = slow_ranges(heading / length, length, 4, outline, front, lidar, increment, count)
    far = np.abs(needs[0] - slow) > RANGE
    assert far.sum() <= 1  # a beam through a corner may miss it
    assert needs.max() > 0.0


@given(st.integers(0, 10_000), st.integers(1, 30))
def test_free_tubes_and_whiskers_are_one_comparison_per_beam(seed, count):
    rng = np.random.default_rng(seed)
    needs = np.where(rng.random((count, 40)) < 0.3, rng.uniform(0, 1, (count, 40)), 0.0).astype(np.float32)
    seen = np.where(rng.random(40) < 0.5, np.inf, rng.uniform(0.3, 1.5, 40)).astype(np.float32)
    hidden = rng.random(count) < 0.2
    np.testing.assert_array_equal(
        free_tubes(seen, np.ascontiguousarray(needs.T), needs.max(axis=0), hidden),
        (seen >= needs).all(axis=1) & ~hidden,
    )
    beams, ranges = rng.integers(-1, 40, 3), rng.uniform(0.0, 1.0, 3).astype(np.float32)
    assert whisker_free(seen, beams, ranges) == all(
        b >= 0 and seen[b] >= r for b, r in zip(beams, ranges, strict=True)
    )


@given(st.lists(st.one_of(st.floats(-1.0, 20.0, width=32), st.sampled_from([math.nan, math.inf, 0.0]))))
def test_only_valid_returns_stop_a_beam(ranges):
    array = np.array(ranges, dtype=np.float32)
    expected = [r if 0.125 <= r < 15.0 else math.inf for r in ranges]
    np.testing.assert_array_equal(free_ranges(array, 0.125, 15.0), np.array(expected, dtype=np.float32))


def slow_choice(free, curvatures, reach, goal, bins, twist, seen, beams, ranges):
    keys = {}
    for n in np.flatnonzero(free):
        x, y, yaw = arc_pose(curvatures[n], reach)
        distance = math.dist((x, y), goal[:2])
        deviation = abs(math.remainder(yaw - goal[2], math.tau))
        if distance // bins[0] > bins[2] or deviation > math.pi / 2:
            continue
        closed = [not whisker_free(seen, beams[k, n], ranges[k, n]) for k in range(3)]
        change = abs(twist[0] * curvatures[n] - twist[1]) if twist[0] > 0 else 0.0
        keys[n] = (distance // bins[0], *closed, deviation // bins[1], change, distance, n)
    best = min(keys, key=keys.get, default=-1)
    return (best, keys[best][0]) if keys else (-1, -1)


@settings(max_examples=200)
@given(st.integers(0, 10**6), st.floats(0.05, 2.0), st.floats(-1.0, 2.0), st.floats(-2.0, 2.0))
def test_the_choice_is_the_first_by_the_rules_in_turn(seed, reach, v, omega):
    rng = np.random.default_rng(seed)
    curvatures, free = rng.uniform(-1.7, 1.7, 25), rng.random(25) < 0.7
    goal = (*rng.uniform(-1.5, 2.0, 2), rng.uniform(-math.pi, math.pi))
    seen = rng.uniform(0.5, 1.5, 10).astype(np.float32)
    beams, ranges = rng.integers(-1, 10, (3, 25, 2)), rng.uniform(0.2, 0.9, (3, 25, 2)).astype(np.float32)
    given_ = (free, curvatures, reach, goal, (0.2, 0.35, 6), (v, omega), seen, beams, ranges)
    assert choose(*given_) == slow_choice(*given_)


def polyline(seed, count):
    return np.cumsum(np.random.default_rng(seed).uniform(-0.2, 0.5, (count, 2)), axis=0) - 0.3


@given(st.integers(0, 10**6), st.integers(2, 12), st.lists(st.floats(0.0, 5.0), max_size=3))
def test_points_along_a_path_from_the_point_nearest_to_the_robot(seed, count, distances):
    path, distances = polyline(seed, count), np.sort(np.array(distances, dtype=float))
    got, left = points_along(path, distances, 100.0)
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))))
    ticks = np.linspace(0.0, along[-1], 4001)
    fine = np.column_stack([np.interp(ticks, along, path[:, k]) for k in (0, 1)])
    at = along[-1] - left
    here = [np.interp(at, along, path[:, k]) for k in (0, 1)]
    assert np.hypot(*here) == pytest.approx(np.hypot(*fine.T).min(), abs=2e-3)
    for point, distance in zip(got, distances, strict=True):
        place = min(at + distance, along[-1])
        np.testing.assert_allclose(point, [np.interp(place, along, path[:, k]) for k in (0, 1)], atol=KERNEL)


@given(st.integers(0, 10**6))
def test_known_free_is_stood_on_or_seen_past(seed):
    rng = np.random.default_rng(seed)
    bodies = np.column_stack((rng.uniform(-1, 1, (3, 2)), rng.uniform(-3, 3, 3)))
    lidars = bodies + np.array([0.05, 0.02, -2.0])
    ranges = rng.choice([0.3, 0.8, np.inf], (3, 41)).astype(np.float32)
    points = rng.uniform(-1.5, 1.5, (30, 2))
    box = (0.2, 0.1, 0.05)
    known = known_free(points, bodies, lidars, ranges, 0.1, box)
    for point, answer in zip(points, known, strict=True):
        stood = any(
            sweep(np.array([body]), box, np.array([[*point, 0.0]]), NO_EDGES)[0] <= 0.0 for body in bodies
        )
        seen = False
        for lidar, scan in zip(lidars, ranges, strict=True):
            dx, dy = point - lidar[:2]
            off = np.abs(np.angle(np.exp(1j * (lidar[2] + 0.1 * np.arange(41) - math.atan2(dy, dx)))))
            seen |= off.min() < 0.05 and scan[off.argmin()] > math.hypot(dx, dy)
        assert answer == (stood or seen)


@given(st.integers(0, 10**6), st.sampled_from([5, 30, 63]))
def test_out_of_sight_is_near_and_off_every_beam(seed, num_beams):
    rng = np.random.default_rng(seed)
    points, pose = rng.uniform(-2.0, 2.0, (40, 2)), Pose(*rng.uniform(-1.0, 1.0, 3))
    lidar, angles = (0.05, 0.02, -2.0), -2.0 + 0.1 * np.arange(num_beams)
    here = to_robot(points, pose)
    bearings = np.arctan2(here[:, 1] - lidar[1], here[:, 0] - lidar[0])
    off = np.abs(np.angle(np.exp(1j * (angles - bearings[:, None])))).min(axis=1)
    expected = here[(off > 0.05) & (np.hypot(*here.T) < 1.5)]
    found = out_of_sight(points, pose, lidar, 0.1, num_beams, 1.5)
    np.testing.assert_allclose(found, expected, atol=KERNEL)
