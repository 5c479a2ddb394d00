"""The side that touches."""

import math

import numpy as np
import pytest

from lme.simulation.contact_side import SIDES, contact_side
from lme.types import Pose

BOX = (0.25, 0.2, 0.05)
NO_CIRCLES, NO_EDGES = np.empty((0, 3)), np.empty((0, 4))
PLACES = {
    "front": (0.5, 0.0), "front left": (0.45, 0.4), "left": (0.0, 0.45), "rear left": (-0.45, 0.4),
    "rear": (-0.5, 0.05), "rear right": (-0.4, -0.4), "right": (0.05, -0.45), "front right": (0.4, -0.4),
}  # fmt: skip


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_a_disc_touches_the_side_where_it_is(side, yaw):
    x, y = PLACES[side]
    cos, sin = math.cos(yaw), math.sin(yaw)
    disc = [[3.0 + cos * x - sin * y, 1.0 + sin * x + cos * y, 0.2]]
    far = [[3.0, 9.0, 0.2]]
    assert contact_side(Pose(3.0, 1.0, yaw), BOX, np.array(far + disc), NO_EDGES) == side


@pytest.mark.parametrize(
    ("wall", "side"),
    [
        ((0.31, -4.0, 0.31, 6.0), "front"),  # across, wider than the robot
        ((0.29, -4.0, 0.29, 6.0), "front"),  # and inside its outline
        ((-5.0, 0.26, 9.0, 0.26), "left"),
        ((0.0, 0.6, 0.6, 0.0), "front left"),
        ((-0.31, 0.1, -2.0, 0.1), "rear"),  # its end
    ],
)
def test_a_wall_touches_where_it_is_nearest(wall, side):
    assert contact_side(Pose(0.0, 0.0, 0.0), BOX, NO_CIRCLES, np.array([wall])) == side


def test_nothing_touches_no_side():
    assert contact_side(Pose(0.0, 0.0, 0.0), BOX, NO_CIRCLES, NO_EDGES) == ""
