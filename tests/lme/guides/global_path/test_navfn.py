"""Navfn's own paths: shifted by half a cell, and none through obstacles."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.guides.global_path import Navfn
from lme.types import Pose, Twist
from lme.worlds.world import World
from tests.builders import challenge_jackal, room
from tests.lme.planners.test_ros_dwa import seen

JACKAL = challenge_jackal()


def guided(world=None, **changes):
    made = Navfn(load_settings("guide/navfn", **changes), JACKAL)
    made.reset(np.random.default_rng(0))
    return made.guide(seen(world, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), (5.0, 0.0), JACKAL))


def test_a_path_lies_half_a_cell_against_the_axes_of_the_map():
    """BARN's map has x to the right of the start and y ahead: the path lies half a cell back and to the left."""
    guidance = guided()
    assert not guidance.blocked
    np.testing.assert_allclose(guidance.path[1:-1, 1], 0.025, atol=1e-3)
    np.testing.assert_allclose(guided(map_yaw=0.0).path[1:-1, 1], -0.025, atol=1e-3)
    np.testing.assert_allclose(np.diff(guidance.path[2:-1, 0]), 0.025, atol=1e-6)
    assert guidance.path[-1] == pytest.approx((5.0, 0.0))


def test_there_is_no_path_out_of_a_closed_room():
    def known(world):
        made = Navfn(load_settings("guide/navfn", global_map="known"), JACKAL)
        made.reset(np.random.default_rng(0))
        made.read_map(world, Pose(0.0, 0.0, 0.0))
        return made.guide(seen(world, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), (5.0, 0.0), JACKAL))

    assert known(room(2.0)).blocked
    assert not known(World(segments=room(2.0).segments[:3])).blocked
