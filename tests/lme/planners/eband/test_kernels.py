"""Bubbles and the forces on them, against slow twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.planners.eband.kernels import bubble_radii, covered, hidden, mend, relax
from tests.tolerances import KERNEL

SEEDS = st.integers(0, 2**32 - 1)
SHAPE = (0.15, 1.0, 0.05)  # inner disc, ceiling, spacing
FORCES = (1.0, 2.0, 0.55, 0.15)
JOINT = (0.7, 0.1)
NOTHING = np.empty((0, 2))


def slow_radius(x, y, points):
    nearest = min((math.dist((x, y), point) for point in points), default=math.inf)
    return min(nearest - SHAPE[0], SHAPE[1])


def slow_force(before, bubble, after, points):
    """Quinlan & Khatib 1993: contraction and repulsion, without their part along the band; a vector."""
    centre, radius = np.array(bubble[:2]), bubble[2]
    along = after - before
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    internal, external, influence, _ = FORCES
    force = np.zeros(2)
    for neighbour in (before, after):
        force += internal * (neighbour - centre) / max(np.hypot(*(neighbour - centre)), 1e-9)
    if radius < influence:
        h = max(radius, SHAPE[2])
        slope = (
            slow_radius(*(centre + h * normal), points) - slow_radius(*(centre - h * normal), points)
        ) / (2 * h)
        force += external * (influence - radius) * slope * normal
    return force @ normal, normal


def slow_relax(centres, radii, points, iterations, recursion):
    centres, radii = centres.copy(), radii.copy()
    for _ in range(iterations):
        for i in range(1, len(centres) - 1):
            before, after = centres[i - 1].copy(), centres[i + 1].copy()
            if np.hypot(*(after - before)) < 1e-9:
                continue
            force, normal = slow_force(before, (*centres[i], radii[i]), after, points)
            if abs(force) < FORCES[3]:
                continue
            reach = max(radii[i], SHAPE[2])
            for halving in range(recursion + 1):
                moved = centres[i] + np.clip(reach * force / 2, -reach, reach) / 2**halving * normal
                bubble = (*moved, slow_radius(*moved, points))
                there, _ = slow_force(before, bubble, after, points)
                if there * force >= 0 or abs(there) <= 0.75 * abs(force):
                    break
            centres[i], radii[i] = moved, bubble[2]
    return centres, radii


def join(one, other):
    return min(one[2], other[2]) > JOINT[1] and math.dist(one[:2], other[:2]) <= JOINT[0] * (
        one[2] + other[2]
    )


def slow_mend(centres, radii, points):
    bubbles = [(*centre, radius) for centre, radius in zip(centres, radii, strict=True)]
    kept = [bubbles[0]]
    for bubble, following in zip(bubbles[1:], [*bubbles[2:], None], strict=True):
        if following is None or not join(kept[-1], following):
            kept.append(bubble)
    whole, joints = [kept[0]], []
    for bubble in kept[1:]:
        new, new_joints = between(whole[-1], bubble, points)
        whole += new
        joints += new_joints
    return np.array(whole), [*joints, False].index(False) + 1


def between(one, other, points):
    """Bubbles after `one` up to `other`, and whether each joins the one before it."""
    gap = math.dist(one[:2], other[:2])
    if join(one, other) or gap <= SHAPE[2]:
        return [other], [join(one, other) or min(one[2], other[2]) > JOINT[1]]
    middle = ((one[0] + other[0]) / 2, (one[1] + other[1]) / 2)
    middle = (*middle, slow_radius(*middle, points))
    first, second = between(one, middle, points), between(middle, other, points)
    return first[0] + second[0], first[1] + second[1]


def scene(seed):
    """A wavy band of a few bubbles, and points about it."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, rng.uniform(0.5, 3.0), int(rng.integers(2, 8)))
    centres = np.column_stack([x, rng.normal(0.0, 0.3, len(x))]).copy()  # by rows, as the planner's are
    points = rng.uniform((-1.0, -1.5), (4.0, 1.5), (int(rng.integers(0, 30)), 2))
    xs, ys = points.T.copy()
    return centres, points, xs, ys


@given(SEEDS)
def test_radii_equal_the_distance_to_the_nearest_point(seed):
    centres, points, xs, ys = scene(seed)
    expected = [slow_radius(*centre, points) for centre in centres]
    assert bubble_radii(centres, xs, ys, *SHAPE[:2]) == pytest.approx(expected, abs=KERNEL)


@given(SEEDS, st.integers(1, 3), st.integers(0, 4))
def test_relaxing_equals_the_forces_of_the_paper(seed, iterations, recursion):
    centres, points, xs, ys = scene(seed)
    radii = bubble_radii(centres, xs, ys, *SHAPE[:2])
    expected = slow_relax(centres, radii, points, iterations, recursion)
    relax(centres, radii, xs, ys, SHAPE, FORCES, (iterations, recursion))
    assert centres == pytest.approx(
        expected[0], abs=1e3 * KERNEL
    )  # a tie may fall either way: the force is steep
    assert radii == pytest.approx(expected[1], abs=1e3 * KERNEL)


@given(SEEDS)
def test_mending_equals_its_recursive_twin(seed):
    centres, points, xs, ys = scene(seed)
    radii = bubble_radii(centres, xs, ys, *SHAPE[:2])
    expected, chain = slow_mend(centres, radii, points)
    mended = mend(centres, radii, xs, ys, SHAPE, JOINT, 1024)
    assert np.column_stack(mended[:2]) == pytest.approx(expected, abs=KERNEL)
    assert mended[2] == chain


@given(SEEDS)
def test_the_disc_can_move_along_the_joined_part_of_a_band(seed):
    centres, points, xs, ys = scene(seed)
    for _ in range(3):
        radii = bubble_radii(centres, xs, ys, *SHAPE[:2])
        relax(centres, radii, xs, ys, SHAPE, FORCES, (3, 4))
        centres, radii, chain = mend(centres, radii, xs, ys, SHAPE, JOINT, 256)
    for i in range(chain - 1):
        for part in np.linspace(0, 1, 11):
            assert slow_radius(*(part * centres[i] + (1 - part) * centres[i + 1]), points) > 0


def test_there_are_no_more_bubbles_than_there_is_room_for():
    wall = np.column_stack([np.ones(50), np.linspace(-1, 1, 50)])
    ends = np.array([[0.0, 0.0], [2.0, 0.0]])
    xs, ys = wall.T.copy()
    radii = bubble_radii(ends, xs, ys, *SHAPE[:2])
    centres, radii, chain = mend(ends, radii, xs, ys, SHAPE, JOINT, 10)
    assert len(centres) == len(radii) <= 10
    assert chain < len(centres)


def test_covered_needs_every_point_in_a_bubble():
    centres, radii = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.5, -0.1])
    assert covered(np.array([[0.3, 0.3], [1.0, 0.04]]), centres, radii, 0.05)
    assert not covered(np.array([[0.3, 0.3], [1.0, 0.06]]), centres, radii, 0.05)
    assert covered(NOTHING, centres, radii, 0.05)


@settings(max_examples=200)
@given(SEEDS, st.booleans(), st.booleans())
def test_hidden_points_are_those_no_beam_reaches(seed, full, clockwise):
    rng = np.random.default_rng(seed)
    num_beams, increment = 36, math.radians(10.0) if full else math.radians(7.0)
    sign = -1 if clockwise else 1
    angle_min = -sign * increment * (num_beams - 1) / 2
    ranges = rng.uniform(0.0, 5.5, num_beams).astype(np.float32)
    ranges[rng.random(num_beams) < 0.1] = np.nan
    points = rng.uniform(-6, 6, (40, 2))
    found = hidden(points, ranges, (angle_min, sign * increment), (0.3, 5.0), 0.1)
    for (x, y), answer in zip(points, found, strict=True):
        bearings = angle_min + sign * increment * np.arange(num_beams)
        off = np.abs([math.remainder(math.atan2(y, x) - bearing, math.tau) for bearing in bearings])
        reading = ranges[off.argmin()]
        in_view = off.min() <= increment / 2 and reading >= 0.3
        assert answer == (not in_view or math.hypot(x, y) > min(reading + 0.1, 5.0))
