"""Braille pictures of worlds: the right way up, at one scale, and no wall lost."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.types import Pose
from lme.worlds.movers import Mover
from lme.worlds.world import World
from runners.reports.figures.layout import extent
from runners.reports.figures.terminal import GOAL, picture
from tests.builders import room, task

PLACES = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (3, 0), (3, 1)]  # (row, column) of Unicode's bits


def dots_of(text):
    """(rows, columns) which dots are set, the top row first; other characters count as empty."""
    lines = text.plain.split("\n")
    dots = np.zeros((4 * len(lines), 2 * len(lines[0])), dtype=bool)
    for y, line in enumerate(lines):
        for x, character in enumerate(line):
            code = ord(character) - 0x2800
            for bit, (row, column) in enumerate(PLACES):
                dots[4 * y + row, 2 * x + column] = 0 <= code < 256 and code >> bit & 1
    return dots


def place_of(text, glyph):
    """(line, column) of a character."""
    ((line, row),) = [(y, row) for y, row in enumerate(text.plain.split("\n")) if glyph in row]
    return line, row.index(glyph)


def in_room(*segments, circles=(), movers=(), start=Pose(-3.0, -3.0, 0.0), goal=(3.0, 3.0)):  # noqa: B008
    """A task in a room of 10 m with walls and discs in it."""
    walls = np.vstack([room().segments, *np.array(segments, dtype=float).reshape(-1, 4)])
    return task(World(np.array(circles, dtype=float).reshape(-1, 3), walls, (), tuple(movers)), start, goal)


def test_y_is_up_and_x_to_the_right():
    text = picture(in_room(circles=[(-4, -1, 0.8)], start=Pose(-3, -4, 0), goal=(4, 4)), 40, 20)
    inner = dots_of(text)[4:-4, 4:-4]
    rows, columns = np.nonzero(inner)
    assert rows.mean() > 0.5 * inner.shape[0]  # below the middle
    assert columns.mean() < 0.2 * inner.shape[1]
    (start_line, start_column), (goal_line, goal_column) = place_of(text, "→"), place_of(text, GOAL)
    assert start_line > goal_line
    assert start_column < goal_column


@pytest.mark.parametrize(("columns", "lines"), [(16, 6), (16, 40), (80, 32)])
def test_a_square_room_is_square_and_fits(columns, lines):
    dots = dots_of(picture(in_room(), columns, lines))
    assert dots.shape[0] <= 4 * lines
    assert dots.shape[1] <= 2 * columns
    rows, columns_set = np.flatnonzero(dots.any(axis=1)), np.flatnonzero(dots.any(axis=0))
    height, width = np.ptp(rows), np.ptp(columns_set)
    assert abs(height - width) <= 1
    assert max(height / (4 * lines), width / (2 * columns)) > 0.85  # and as large as it can be


@settings(max_examples=40)
@given(st.floats(-4.5, 4.5), st.floats(-4.5, 4.5), st.booleans())
def test_a_thin_wall_is_a_line_without_gaps(at, other, upright):
    wall = (at, -5, at, 5) if upright else (-5, at, 5, at)
    dots = dots_of(picture(in_room(wall, start=Pose(-4.8, -4.8, 0), goal=(4.8, 4.8)), 16, 8))
    plain = dots_of(picture(in_room(start=Pose(-4.8, -4.8, 0), goal=(4.8, 4.8)), 16, 8))
    added = dots & ~plain
    assert added.any() or abs(at) > 4.4
    lines = added if upright else added.T
    crossed = lines.any(axis=1)
    inside = np.flatnonzero(crossed)
    # The glyphs of start and goal, four dots high, may hide an end of it.
    assert len(inside) == 0 or crossed[inside[0] : inside[-1] + 1].all()
    assert len(inside) == 0 or len(inside) >= 0.6 * len(crossed)


@pytest.mark.parametrize(
    ("yaw", "arrow"), [(0, "→"), (math.pi / 2, "↑"), (-math.pi / 2, "↓"), (math.pi, "←"), (-2.4, "↙")]
)
def test_the_start_points_where_the_robot_looks(yaw, arrow):
    assert arrow in picture(in_room(start=Pose(-3, -3, yaw)), 16, 6).plain


def test_movers_are_hollow_and_obstacles_are_not():
    def middle(scene):
        dots = dots_of(picture(scene, 40, 20))
        size = dots.shape[0]
        return dots[size // 2 - 3 : size // 2 + 3, size // 2 - 3 : size // 2 + 3], dots.sum()

    path = np.array([[0.0, 0.0], [4.0, 0.0]])
    empty = middle(in_room())[1]
    solid, hollow = middle(in_room(circles=[(0, 0, 2)])), middle(in_room(movers=[Mover(path, radius=2.0)]))
    assert solid[0].all()
    assert not hollow[0].any()
    assert empty + 20 < hollow[1] < solid[1]


def test_a_path_is_drawn_in_its_own_colour():
    without = picture(in_room(), 40, 20)
    way = np.array([[-3.0, -3.0], [3.0, -3.0], [3.0, 3.0]])
    with_way = picture(in_room(), 40, 20, way)
    assert dots_of(with_way).sum() > dots_of(without).sum() + 60
    assert {str(span.style) for span in with_way.spans} - {str(span.style) for span in without.spans}


@pytest.mark.parametrize("world", [World(), World(circles=np.array([[2.0, 0.0, 0.01]]))])
def test_a_world_that_is_but_a_line_has_a_picture(world):
    lines = picture(task(world), 16, 6).plain.split("\n")
    assert len(lines) == 1
    assert {"→", GOAL} <= set(lines[0])


def test_the_picture_reaches_to_what_moves():
    movers = [
        Mover(np.array([[20.0, 0.0], [0.0, 0.0]]), radius=1.0),
        Mover(np.array([[0.0, -9.0, math.pi / 2]]), outline=np.array([[0.0, -1.0], [-3.0, 1.0], [0.0, 1.0]])),
    ]
    assert extent(in_room(movers=movers)) == pytest.approx((-5.0, -12.0, 21.0, 5.0))
