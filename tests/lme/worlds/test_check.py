"""Impossible tasks: a start in collision, a goal in an obstacle."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.robots import Footprint
from lme.types import Pose
from lme.worlds.barn.map_set import Barn
from lme.worlds.check import check_task, footprint_clearance, point_clearance
from lme.worlds.movers import ORCA, Mover
from lme.worlds.world import World
from tests.builders import stage, task
from tests.tolerances import KERNEL

SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
BOX = Footprint(length=0.42, width=0.31)
finite = st.floats(-5, 5)


def circles(*rows):
    return World(circles=np.array(rows, dtype=float))


def segments(*rows):
    return World(segments=np.array(rows, dtype=float))


@pytest.mark.parametrize(
    ("world", "pose", "expected"),
    [
        (circles((1.0, 0.0, 0.1)), Pose(0, 0, 0), 1.0 - 0.21 - 0.1),
        (circles((1.0, 0.0, 0.1)), Pose(0, 0, math.pi / 2), 1.0 - 0.155 - 0.1),
        (circles((0.51, 0.555, 0.1)), Pose(0, 0, 0), 0.5 - 0.1),  # from the corner (0.21, 0.155): 0.3, 0.4
        (circles((0.0, 0.0, 5.0)), Pose(0, 0, 0), 0.0),
        (segments((-1.0, 0.5, 1.0, 0.5)), Pose(0, 0, 0), 0.5 - 0.155),
        (segments((-1.0, 0.0, 1.0, 0.0)), Pose(0, 0, 0), 0.0),
        (segments((0.0, 0.0, 0.01, 0.01)), Pose(0, 0, 0), 0.0),
        (segments((0.51, 0.555, 3.0, 3.0)), Pose(0, 0, 0), 0.5),
        (World(polygons=(SQUARE,)), Pose(0, 0, 0), 0.0),
        (World(polygons=(SQUARE,)), Pose(2, 0, 0), 1.0 - 0.21),
        (World(), Pose(0, 0, 0), math.inf),
    ],
)
def test_clearance_of_a_rectangle(world, pose, expected):
    assert footprint_clearance(world, BOX, pose) == pytest.approx(expected, abs=KERNEL)


@given(finite, finite, finite, finite, st.floats(0.05, 1.0), finite)
def test_a_disc_has_the_clearance_of_its_centre_less_its_radius(x, y, x1, y1, radius, yaw):
    world = World(circles=np.array([[x, y, 0.3]]), segments=np.array([[x1, y1, x, y1]]))
    clearance = footprint_clearance(world, Footprint(radius=radius), Pose(0.5, -0.5, yaw))
    away = point_clearance(world, np.array([0.5, -0.5])) - radius
    assert clearance == pytest.approx(max(away, 0.0), abs=KERNEL)


@given(finite, finite, finite, finite, st.floats(-4, 4))
def test_a_rectangle_is_as_far_from_a_segment_as_the_nearest_of_many_points(x0, y0, x1, y1, yaw):
    """Twin: 400 points of the segment, each against the rectangle; off by half their spacing at most."""
    world, pose = segments((x0, y0, x1, y1)), Pose(0.3, 0.2, yaw)
    along = np.linspace(0, 1, 400)[:, None]
    points = np.array([x0, y0]) + along * np.array([x1 - x0, y1 - y0])
    twin = min(footprint_clearance(World(circles=np.array([[*point, 0.0]])), BOX, pose) for point in points)
    spacing = math.hypot(x1 - x0, y1 - y0) / 399
    clearance = footprint_clearance(world, BOX, pose)
    assert twin - spacing / 2 - KERNEL <= clearance <= twin + KERNEL


def test_a_free_task_passes():
    check_task(task(circles((2.0, 2.0, 0.3))), stage())
    check_task(task(), stage())


@pytest.mark.parametrize(
    "world", [circles((0.25, 0.0, 0.1)), segments((0.1, -1, 0.1, 1)), World(polygons=(SQUARE,))]
)
def test_a_start_in_collision(world, says):
    with says.raises(InputError):
        check_task(task(world), stage())


@pytest.mark.parametrize(
    "world", [circles((4.0, 0.05, 0.1)), World(polygons=(SQUARE + np.array([4.0, 0.5]),))]
)
def test_a_goal_inside_an_obstacle(world, says):
    with says.raises(InputError):
        check_task(task(world), stage())


def test_a_goal_too_close_to_an_obstacle(says):
    with says.raises(InputError):
        check_task(task(segments((3.0, 0.1, 5.0, 0.1))), stage())


def mover(*path, **settings):
    return World(movers=(Mover(path=np.array(path), **{"radius": 0.25, **settings}),))


@pytest.mark.parametrize(
    "world",
    [
        mover((0.3, 0.0), (4.0, 3.0)),
        mover((0.0, 0.0), radius=None, outline=SQUARE),
        mover((0.0, 0.0), (1.0, 0.0), times=np.array([0.0, 5.0])),
        mover((4.0, 0.2)),
    ],
)
def test_a_mover_on_the_start_or_for_ever_on_the_goal(world, says):
    with says.raises(InputError):
        check_task(task(world), stage())


@pytest.mark.parametrize(
    "world",
    [
        mover((4.0, 0.0), (4.0, 3.0)),
        mover((4.0, 3.0), (4.0, 0.0)),
        mover((4.0, 0.0), motion=ORCA),
        mover((0.0, 0.0), (1.0, 0.0), times=np.array([1.0, 5.0])),
    ],
)
def test_a_mover_that_is_not_there_yet_or_goes_away(world):
    check_task(task(world), stage())


def test_a_disc_with_a_negative_radius(says):
    with says.raises(InputError):
        check_task(task(circles((2.0, 2.0, -0.3))), stage())


def test_a_goal_in_a_concave_polygons_bay_is_outside():
    bay = np.array(
        [[2.0, -2.0], [6.0, -2.0], [6.0, 2.0], [5.5, 2.0], [5.5, -1.5], [2.5, -1.5], [2.5, 2.0], [2.0, 2.0]]
    )
    check_task(task(World(polygons=(bay,))), stage())
    with pytest.raises(InputError, match="inside"):
        check_task(task(World(polygons=(bay,)), goal=(4.0, -1.75)), stage())


def test_barn_tasks_are_possible_and_bad_ones_are_not():
    tasks = Barn(load_settings("map/barn", worlds=[0, 150, 299]))
    for number in tasks.numbers:
        check_task(tasks.task(number), stage())
    inside = dataclasses.replace(tasks.task(0), goal=np.array([-4.425, 7.0]))
    with pytest.raises(InputError, match="goal"):
        check_task(inside, stage())
    moved = Barn(load_settings("map/barn", worlds=[0], start=[-4.4, 3.0, 0.0])).task(0)
    with pytest.raises(InputError, match="start"):
        check_task(moved, stage())
