"""The search of strokes against scenes with known answers, and against what it promises."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.frames import to_robot
from lme.planners.min_time.multi_point_turn import STROKE, TURN, keeps_on_stroke, poses_after, way_out
from lme.robots import Footprint
from lme.types import Pose
from tests.tolerances import KERNEL

LONG = Footprint(length=0.7, width=0.31)
MARGIN, ROOM = 0.02, LONG.circumscribed_radius + 0.1
NOWHERE = np.full(2, np.inf)
HALF = LONG.length / 2


def line(a, b):
    """Points every centimetre from a to b."""
    a, b = np.array(a), np.array(b)
    return a + np.linspace(0.0, 1.0, int(np.hypot(*(b - a)) / 0.01) + 2)[:, None] * (b - a)


def pocket(half, depth):
    """A corridor along −y, `half` wide on each side of the origin, and closed `depth` in front of it."""
    corners = [(-half, -0.8), (-half, depth), (half, depth), (half, -0.8)]
    return np.concatenate([line(a, b) for a, b in itertools.pairwise(corners)])


def outlines(points, pose=(0.0, 0.0, 0.0)):
    """Distance of each point from the long footprint at a pose, negative inside [m]."""
    beyond = np.abs(to_robot(points, Pose(*pose))) - LONG.box[:2]
    outside = np.hypot(*np.maximum(beyond, 0.0).T)
    return np.where(outside > 0.0, outside, beyond.max(axis=1)) - LONG.box[2]


def out(points, place=NOWHERE, backwards=True):
    return way_out(points, LONG.box, MARGIN, ROOM, place, backwards)


def check(points, steps):
    """No point comes nearer than the margin, or than it is."""
    least = np.minimum(MARGIN, outlines(points))
    for pose in poses_after(steps):
        assert (outlines(points, pose) >= least - 1e-5).all()


@pytest.mark.parametrize(
    ("half", "depth", "aside"), [(0.43, 0.35, 0.02), (0.46, 0.35, 0.0), (0.46, 0.3, 0.02)]
)
def test_a_robot_across_a_pocket_in_which_it_cannot_turn_gets_out_by_strokes(half, depth, aside):
    points = np.add(pocket(half, depth), [aside, 0.0])
    assert depth < LONG.circumscribed_radius  # so that it cannot turn where it is
    steps, room = out(points)
    check(points, steps)
    last = poses_after(steps)[-1]
    assert room
    assert np.hypot(*(points - last[:2]).T).min() >= ROOM
    assert last[1] < -0.8
    assert (np.diff(steps, axis=0) != 0).any(axis=1).sum() >= 5


def dead_end(length):
    """A corridor that leaves 5 cm on each side, is closed 10 cm ahead, and opens `length` behind the origin."""
    side, front = LONG.width / 2 + 0.05, HALF + 0.1
    return np.concatenate(
        [line((-length, y), (front, y)) for y in (-side, side)] + [line((front, -side), (front, side))]
    )


def test_the_fewest_steps_lead_straight_back_out_of_a_corridor():
    steps, room = out(dead_end(0.5))
    side = LONG.width / 2 + 0.05
    needed = 0.5 + math.sqrt(ROOM**2 - side**2)
    assert room
    assert (steps == [-1, 0]).all()
    assert len(steps) == math.ceil(needed / STROKE - KERNEL)


def test_without_room_nearby_the_steps_lead_along_the_way():
    steps, room = out(dead_end(4.0), place=np.array([-1.0, 0.0]))
    assert not room
    assert (steps == [-1, 0]).all()
    assert len(steps) in (32, 33)
    steps, room = out(dead_end(4.0))
    assert not room
    assert len(steps) == 0


@pytest.mark.parametrize("turned", np.linspace(0.0, math.pi / 2, 7))
def test_a_corridor_without_room_has_none_whatever_its_direction(turned):
    along = np.arange(-4.0, 4.0, 0.02)
    walls = np.concatenate([np.column_stack((along, np.full(len(along), y))) for y in (-0.45, 0.45)])
    points = to_robot(walls, Pose(0.0, 0.0, turned))
    steps, room = out(points)
    assert not room
    assert len(steps) == 0


def test_a_robot_that_cannot_back_up_stays_in_a_dead_end():
    steps, room = out(dead_end(0.5), place=np.array([-1.0, 0.0]), backwards=False)
    assert not room
    assert len(steps) == 0


def test_where_the_robot_has_room_no_step_is_needed():
    ring = np.array([(math.cos(a), math.sin(a)) for a in np.linspace(0.0, 2.0 * math.pi, 400)])
    for points in (np.empty((0, 2)), (ROOM + 0.001) * ring):
        steps, room = out(points)
        assert room
        assert len(steps) == 0
    steps, room = out((ROOM - 0.001) * ring)
    assert not room
    assert len(steps) == 0


def test_a_point_inside_the_footprint_does_not_come_further_in():
    """Noise of a scan puts points of a wall in front of the robot into its body."""
    wall = np.column_stack((np.full(9, HALF - 0.01), np.linspace(-0.16, 0.16, 9)))
    steps, room = out(wall)
    check(wall, steps)
    assert room
    assert (steps == [-1, 0]).all()


@given(st.integers(0, 10**6))
def test_no_point_comes_nearer_than_the_margin_or_than_it_is(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.7, 0.7, (rng.integers(1, 25), 2))
    points = np.concatenate((points, rng.uniform(-2.2, 2.2, (rng.integers(0, 150), 2))))
    steps, room = out(points)
    check(points, steps)
    if room:
        last = poses_after(steps)[-1] if len(steps) else np.zeros(3)
        assert np.hypot(*(points - last[:2]).T).min() >= ROOM - KERNEL


@given(st.integers(0, 10**6))
def test_a_stroke_is_free_as_far_as_small_steps_on_it_are(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.7, 0.7, (rng.integers(1, 9), 2))
    ahead, turn = rng.uniform(-0.5, 0.5), rng.uniform(-1.0, 1.0)
    least = np.minimum(MARGIN, outlines(points))
    for stroke in ((ahead, 0.0), (0.0, turn)):
        slack = min(
            (outlines(points, (share * stroke[0], 0.0, share * stroke[1])) - least).min()
            for share in np.linspace(0.0, 1.0, 400)[1:]
        )
        free = keeps_on_stroke(points, LONG.box, MARGIN, *stroke)
        if slack > 1e-5 or slack < -0.5 * STROKE - 0.5 * TURN * LONG.circumscribed_radius:
            assert free == (slack > 0.0)
