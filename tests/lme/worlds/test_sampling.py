"""Free space, start and goal, shortest paths."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.errors import InputError
from lme.geometry.frames import to_world
from lme.types import Pose
from lme.worlds.check import point_clearance
from lme.worlds.lattice import clearance_field
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import floor_plan
from lme.worlds.world import enclosed
from tests.tolerances import KERNEL

LONGEST_DETOUR = 1.0132  # of a path on 32 directions against the straight line: 1 / cos of half of 18.4°

inner = st.floats(1.0, 3.0)
size = st.floats(0.05, 1.5)
boxes = st.fixed_dictionaries(
    {
        "centre": st.tuples(inner, inner).map(list),
        "size": st.tuples(size, size).map(list),
        "yaw_deg": st.floats(0, 90),
    }
)
circles = st.fixed_dictionaries({"centre": st.tuples(inner, inner).map(list), "radius": st.floats(0.02, 0.9)})
walls = st.fixed_dictionaries(
    {"points": st.lists(st.tuples(inner, inner).map(list), min_size=2, max_size=4, unique_by=str)}
)
drawings = st.fixed_dictionaries(
    {
        "bounds": st.just([-0.5, -0.5, 4.5, 4.5]),
        "boxes": st.lists(boxes, max_size=3),
        "circles": st.lists(circles, max_size=3),
        "walls": st.lists(walls, max_size=2),
    }
)


def plan(**shapes):
    return floor_plan("test", {"bounds": [0, 0, 10, 10], **shapes})


@cache
def empty_room():
    return FreeSpace(plan(), step=0.1, radius=0.2, margin=0.1)


def rng(seed=0):
    return np.random.default_rng(seed)


@given(drawings)
def test_the_field_is_the_clearance_of_each_point(drawing):
    place = floor_plan("test", drawing)
    x, y = np.linspace(-0.4, 4.4, 13), np.linspace(-0.4, 4.4, 11)
    field = clearance_field(place, x, y, reach=0.7)
    twin = [[min(max(point_clearance(place.world, np.array([a, b])), 0.0), 0.7) for a in x] for b in y]
    assert field == pytest.approx(np.array(twin), abs=KERNEL)


@pytest.mark.parametrize("yaw", [0.0, math.pi / 2, math.pi / 4])
def test_a_place_outside_a_map_is_told_where_the_map_is(yaw, says):
    """A turned map is not the box around it: (3.5, 2.2) is in the box of the third."""
    corners = to_world(np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]]), Pose(1.0, 2.0, yaw))
    empty = np.empty((0, 3)), np.empty((0, 4)), ()
    space = FreeSpace(enclosed(corners, *empty), 0.1, 0.2, 0.0)
    with says.raises(InputError):
        space.check_free("map.start", (3.5, 2.2) if yaw == math.pi / 4 else (9.0, 9.0))


def test_nothing_outside_the_outline_is_free():
    place = floor_plan("test", {"bounds": [0, 0, 1, 1]})
    field = clearance_field(place, np.array([-0.5, 0.5, 1.5]), np.array([0.5]), reach=9.0)
    assert field.tolist() == [[0.0, 0.5, 0.0]]


def test_draws_keep_clear_and_apart():
    place = plan(boxes=[{"centre": [5, 5], "size": [3, 3]}], circles=[{"centre": [2, 2], "radius": 0.5}])
    space = FreeSpace(place, step=0.1, radius=0.3, margin=0.2)
    for seed in range(40):
        start, goal = space.draw(rng(seed), min_distance=4.0)
        assert point_clearance(place.world, np.array(start[:2])) >= 0.5 - KERNEL
        assert point_clearance(place.world, goal) >= 0.5 - KERNEL
        assert math.dist(start[:2], goal) >= 4.0 - KERNEL
        assert -math.pi <= start.yaw <= math.pi


def test_draws_come_from_all_over_and_look_every_way():
    drawn = [empty_room().draw(rng(seed), 1.0) for seed in range(200)]
    for values in (
        np.array([[start.x, start.y] for start, _ in drawn]),
        np.array([goal for _, goal in drawn]),
    ):
        assert (values.min(axis=0) < 1.5).all()
        assert (values.max(axis=0) > 8.5).all()
        assert np.abs(values.mean(axis=0) - 5.0).max() < 1.0
    assert np.ptp([start.yaw for start, _ in drawn]) > 5.5


@pytest.mark.parametrize(("gap", "joined"), [(0.55, False), (0.75, True)])
def test_goals_lie_where_the_robot_gets_to(gap, joined):
    """Two rooms and a door: the robot of radius 0.3 m fits through or it does not."""
    door = [{"points": [[5, 0], [5, 4]]}, {"points": [[5, 4 + gap], [5, 10]]}]
    space = FreeSpace(plan(walls=door), step=0.05, radius=0.3, margin=0.0)
    drawn = [space.draw(rng(seed), 1.0) for seed in range(40)]
    across = [(start.x < 5) != (goal[0] < 5) for start, goal in drawn]
    assert any(across) == joined
    assert all(math.isfinite(space.path_length(*pair)) for pair in drawn)
    there = space.path_length(Pose(1.025, 1.025, 0.0), np.array([9.025, 1.025]))
    assert math.isfinite(there) == joined


def test_a_robot_does_not_slip_between_corners_that_touch():
    corners = [{"centre": [2.5, 7.5], "size": [5, 5]}, {"centre": [7.5, 2.5], "size": [5, 5]}]
    space = FreeSpace(plan(boxes=corners), step=0.1, radius=0.01, margin=0.0)
    assert math.isinf(space.path_length(Pose(1.05, 1.05, 0.0), np.array([9.05, 9.05])))


@given(st.lists(st.integers(4, 95), min_size=4, max_size=4))
def test_in_an_empty_room_the_path_is_all_but_straight(cells):
    space = empty_room()
    x0, y0, x1, y1 = (0.05 + 0.1 * cell for cell in cells)
    length = space.path_length(Pose(x0, y0, 0.0), np.array([x1, y1]))
    straight = math.hypot(x1 - x0, y1 - y0)
    assert straight - KERNEL <= length <= LONGEST_DETOUR * straight + KERNEL


def test_the_path_around_a_wall_is_as_long_as_geometry_says():
    """Around the end of a wall at (5, 7): two tangents to the disc of the robot's radius, and its arc."""
    space = FreeSpace(plan(walls=[{"points": [[5, 0], [5, 7]]}]), step=0.025, radius=0.3, margin=0.0)
    half_width, below = 2.0125, 2.0125  # start and goal at (5 ∓ 2, 5), on the lattice
    start, goal = Pose(5 - half_width, 7 - below, 0.0), np.array([5 + half_width, 7 - below])
    away = math.hypot(half_width, below)
    tangent = math.sqrt(away**2 - 0.3**2)
    turn = 2 * math.pi - 2 * math.acos(0.3 / away) - 2 * math.atan2(half_width, below)
    assert space.path_length(start, goal) == pytest.approx(2 * tangent + 0.3 * turn, rel=0.015)


@given(st.integers(0, 2**32 - 1), st.floats(0.0, 9.0))
def test_goals_are_all_reachable_points_far_enough_away(seed, min_distance):
    """Twin: plain numpy, in the order of the flat lattice."""
    space = FreeSpace(plan(walls=[{"points": [[5, 0], [5, 10]]}]), step=0.25, radius=0.3, margin=0.1)
    start, _ = space.draw(rng(seed), min_distance=0.0)
    middles = 0.125 + 0.25 * np.arange(40)
    x, y = np.meshgrid(middles, middles)
    roomy = space.clearance >= 0.4
    away = np.hypot(*np.round([(x - start.x) / 0.25, (y - start.y) / 0.25])) * 0.25
    goals = roomy & ((x < 5) == (start.x < 5)) & (away >= min_distance - 1e-9) & (away > 0.0)
    if not goals.any():
        with pytest.raises(InputError):
            space.draw_partner(rng(seed), np.array(start[:2]), min_distance)
        return
    chosen = rng(seed).integers(goals.sum())
    expected = [x[goals][chosen], y[goals][chosen]]
    assert space.draw_partner(rng(seed), np.array(start[:2]), min_distance) == pytest.approx(expected)


def test_a_hall_of_ten_million_points():
    space = FreeSpace(floor_plan("hall", {"bounds": [0, 0, 158, 158]}), step=0.05, radius=0.2, margin=0.1)
    start, goal = space.draw(rng(), 100.0)
    straight = math.dist(start[:2], goal)
    assert straight - 0.1 <= space.path_length(start, goal) <= LONGEST_DETOUR * straight + 0.1


def test_too_little_room_to_sample_is_an_error(says):
    with says.raises(InputError, match="min_distance.*20 m"):
        empty_room().draw(rng(), 20.0)
    with says.raises(InputError):
        FreeSpace(plan(), step=0.1, radius=6.0, margin=0.1).draw(rng(), 1.0)


def test_a_lattice_of_too_many_points_is_refused_before_it_is_made(says):
    huge = floor_plan("test", {"bounds": [0, 0, 1e7, 1e7]})
    with says.raises(InputError):
        FreeSpace(huge, step=0.05, radius=0.2, margin=0.1)
