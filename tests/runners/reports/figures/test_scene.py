"""The start of an episode points along its heading, so that nobody has to guess."""

import math

import numpy as np
import pytest

from lme.types import Pose
from lme.worlds.world import Task, World
from runners.reports.figures.scene import draw_task, legend_keys, pointer
from runners.reports.figures.style import new_figure


def sides(corners):
    """Lengths of the sides of the outer triangle: the base between the tail's corners, then both legs."""
    tip, left, _, right, _ = corners
    return math.dist(left, right), math.dist(tip, left), math.dist(tip, right)


@pytest.mark.parametrize("yaw", [0.0, 0.54, math.pi / 2, -2.5])
def test_a_pointer_is_much_longer_than_wide_and_its_tip_is_ahead(yaw):
    corners = pointer(yaw).vertices
    base, *legs = sides(corners)
    assert legs == pytest.approx(legs[:1] * 2)
    assert min(legs) > 1.4 * base
    tip, tail = corners[0], corners[2]
    ahead = tip - tail
    assert math.atan2(ahead[1], ahead[0]) == pytest.approx(yaw)


def test_start_and_key_have_the_same_pointer():
    axes = new_figure(2.0, 2.0).add_axes((0, 0, 1, 1))
    start = Pose(0.0, 0.0, math.pi / 2)
    draw_task(axes, Task("hall", 0, World(), start, np.array([0.0, 4.0]), 0.5, 40.0, 0.0, 4.0, 4.0))
    drawn = [line for line in axes.lines if tuple(line.get_xydata()[0]) == (start.x, start.y)]
    (key,) = [key for key in legend_keys() if key.get_label() == "start"]
    assert [line.get_marker().vertices.tolist() for line in drawn] == [key.get_marker().vertices.tolist()]
