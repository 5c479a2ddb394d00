import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.errors import InputError
from lme.geometry.fan import BEARING_ERROR, bearing
from lme.perception.raycast import cast, cast_shapes
from lme.types import Pose
from tests import oracles
from tests.builders import stage
from tests.tolerances import RANGE

SEEDS = st.integers(0, 2**32 - 1)
NO_CIRCLES = np.empty((0, 3))
NO_EDGES = np.empty((0, 4))
FULL = (-math.pi, 2 * math.pi / 360, 360)  # beam 180 points ahead


def scene(seed):
    """A lidar anywhere among a few circles and edges: pose, angles, range_max, circles, edges."""
    rng = np.random.default_rng(seed)
    circles = np.column_stack([rng.uniform(-4, 4, (rng.integers(0, 8), 2))])
    circles = np.column_stack([circles, rng.uniform(0.01, 0.6, len(circles))])
    edges = rng.uniform(-4, 4, (rng.integers(0, 8), 4))
    num_beams = int(rng.integers(2, 300))
    fov = rng.choice([2 * math.pi, 1.5 * math.pi, 0.6])
    angles = (rng.uniform(-7, 7), fov / (num_beams - rng.integers(0, 2)), num_beams)
    return tuple(rng.uniform(-4, 4, 3)), angles, rng.uniform(0.5, 8), circles, edges


@settings(max_examples=150)
@given(SEEDS)
def test_equals_every_beam_against_every_obstacle(seed):
    arguments = scene(seed)
    ranges = cast_shapes(*arguments)
    assert ranges.dtype == np.float32
    assert ranges == pytest.approx(oracles.cast(*arguments), abs=RANGE)


@given(SEEDS, st.floats(-10, 10))
def test_turning_the_world_with_the_lidar_changes_nothing(seed, angle):
    (x, y, yaw), angles, range_max, circles, edges = scene(seed)
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    pose = (*(turn @ [x, y]), yaw + angle)
    turned_circles = np.column_stack([circles[:, :2] @ turn.T, circles[:, 2]])
    turned_edges = np.hstack([edges[:, :2] @ turn.T, edges[:, 2:] @ turn.T])
    assert cast_shapes(pose, angles, range_max, turned_circles, turned_edges) == pytest.approx(
        cast_shapes((x, y, yaw), angles, range_max, circles, edges), abs=RANGE
    )


@given(SEEDS)
def test_a_mirrored_world_reads_backwards(seed):
    (x, y, yaw), (angle_min, increment, num_beams), range_max, circles, edges = scene(seed)
    last = angle_min + increment * (num_beams - 1)
    mirrored = cast_shapes(
        (x, -y, -yaw), (-last, increment, num_beams), range_max, circles * [1, -1, 1], edges * [1, -1, 1, -1]
    )
    straight = cast_shapes((x, y, yaw), (angle_min, increment, num_beams), range_max, circles, edges)
    assert mirrored[::-1] == pytest.approx(straight, abs=RANGE)


@given(SEEDS)
def test_an_obstacle_more_never_lengthens_a_beam(seed):
    pose, angles, range_max, circles, edges = scene(seed)
    ranges = cast_shapes(pose, angles, range_max, circles, edges)
    assert (ranges <= cast_shapes(pose, angles, range_max, circles[1:], edges)).all()
    assert (ranges <= cast_shapes(pose, angles, range_max, circles, edges[1:])).all()


def test_the_order_of_obstacles_does_not_matter():
    pose, angles, range_max, circles, edges = scene(5)
    assert len(circles) > 1
    assert len(edges) > 1
    backwards = cast_shapes(pose, angles, range_max, circles[::-1].copy(), edges[::-1].copy())
    assert np.array_equal(backwards, cast_shapes(pose, angles, range_max, circles, edges))


def test_an_empty_world_reads_range_max():
    ranges = cast_shapes((0.0, 0.0, 0.0), FULL, 15.1, NO_CIRCLES, NO_EDGES)
    assert (ranges == np.float32(15.1)).all()


def test_a_disc_ahead_and_a_wall_behind():
    # Ahead: centre at 2 m, radius 0.5. Behind: a wall at 3 m. Sideways: nothing within 10 m.
    ranges = cast_shapes(
        (1.0, 1.0, math.pi / 2), FULL, 10.0, np.array([[1.0, 3.0, 0.5]]), np.array([[-1.0, -2.0, 3.0, -2.0]])
    )
    assert ranges[[180, 0, 90, 270]] == pytest.approx([1.5, 3.0, 10.0, 10.0], abs=RANGE)


def test_inside_a_disc_every_beam_reads_zero():
    assert (cast_shapes((0.1, 0.0, 0.0), FULL, 5.0, np.array([[0.0, 0.0, 0.3]]), NO_EDGES) == 0).all()


@given(SEEDS)
def test_no_beam_leaves_a_polygon_through_its_corners(seed):
    # Beams straight at the corners of a closed outline, turned and moved anywhere.
    rng = np.random.default_rng(seed)
    bearings = -math.pi + math.tau / 360 * np.sort(rng.choice(360, 12, replace=False))
    reach = rng.uniform(1, 4, 12)
    x, y, yaw = rng.uniform(-9, 9, 3)
    corners = np.column_stack([x + reach * np.cos(bearings + yaw), y + reach * np.sin(bearings + yaw)])
    edges = np.hstack([corners, np.roll(corners, -1, axis=0)])
    outline = cast_shapes((x, y, yaw), FULL, 1e4, NO_CIRCLES, edges)
    if np.diff(bearings, append=bearings[0] + math.tau).max() < 3.1:
        assert outline.max() <= 4 + RANGE


def test_a_square_room_with_beams_into_its_corners():
    # From the middle, beams at multiples of 1°: √2 at 45°, 1 straight ahead.
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    edges = np.hstack([corners, np.roll(corners, -1, axis=0)])
    ranges = cast_shapes((0.0, 0.0, 0.0), FULL, 9.0, NO_CIRCLES, edges)
    assert ranges[[180, 225, 315, 45, 135]] == pytest.approx([1.0] + 4 * [math.sqrt(2)], abs=RANGE)
    assert ranges.max() <= math.sqrt(2) + RANGE


def test_a_scan_that_repeats_its_first_direction_repeats_its_first_range():
    angles = (-math.pi, 2 * math.pi / 359, 360)
    for y in (-0.05, 0.0, 0.05):
        ranges = cast_shapes((0.0, y, 0.0), angles, 9.0, np.array([[-3.0, 0.0, 0.2]]), NO_EDGES)
        assert ranges[0] < 9.0
        assert ranges[-1] == pytest.approx(ranges[0], abs=RANGE)


def test_the_polynomial_bearing_is_off_by_less_than_it_is_widened():
    angle = np.linspace(0, 2 * math.pi, 20_001)[1:-1]
    off = [bearing(math.cos(a), math.sin(a)) - a for a in angle]
    assert np.abs(off).max() < BEARING_ERROR


@pytest.mark.parametrize(
    "wrong",
    [
        {"circles": [[1.5, math.nan, 0.3]]},
        {"circles": [[2.0, 0.0, 0.3], [1.5, 0.2, -0.3]]},
        {"segments": [[1.0, -1.0, 1.0, math.inf]]},
        {"pose": Pose(0.0, 0.0, math.nan)},
    ],
)
def test_an_obstacle_that_would_vanish_is_refused(wrong, says):
    with says.raises(InputError):
        cast(**{"lidar": stage().lidar, "pose": Pose(0.0, 0.0, 0.0), **wrong})
