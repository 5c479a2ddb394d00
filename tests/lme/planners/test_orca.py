"""ORCA as a planner: by hand, and what every planner must do. tests/lme/geometry/test_orca.py has its half-planes."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.planners.orca import Orca, permitted
from lme.types import Outcome, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import observation, room, stage
from tests.lme.planners import drives
from tests.lme.planners.drives import plan


def planner(robot=None, **settings):
    made = Orca(load_settings("planner/orca", **settings), robot or stage())
    made.reset(np.random.default_rng(0))
    return made


def view(*people, robot=None, twist=Twist(0.5, 0.0), target=(5.0, 0.0)):  # noqa: B008
    return observation(target=target, twist=twist, robot=robot or stage())._replace(
        pedestrians=np.array(people, dtype=float).reshape(-1, 4)
    )


def test_with_nobody_there_it_heads_for_the_subgoal():
    assert plan(planner(), view()) == pytest.approx((0.5, 0.0), abs=1e-6)
    assert plan(planner(), view(target=(3.0, 3.0))).omega > 0.1
    assert plan(planner(), view(target=(-3.0, -0.1))).v < 0.5  # turns first


@pytest.mark.parametrize("side", [1, -1])
def test_it_turns_away_from_who_comes_towards_it(side):
    command = plan(planner(), view([2.0, 0.2 * side, -1.0, 0.0]))
    assert math.copysign(1, command.omega) == -side


def test_who_walks_away_or_far_off_changes_nothing():
    free = plan(planner(), view())
    assert plan(planner(), view([2.0, 0.0, 1.0, 0.0])) == pytest.approx(free, abs=1e-6)
    assert plan(planner(), view([0.0, 5.0, 0.0, 1.0])) == pytest.approx(free, abs=1e-6)


def test_it_slows_for_who_crosses_close_ahead():
    """Someone steps in front from the left, so near that there is no way around."""
    assert plan(planner(), view([0.9, 0.6, 0.0, -1.3])).v < 0.4


def test_its_share_is_of_the_evasion():
    nothing, person = np.empty((0, 2)), np.array([[2.5, 0.3, -1.0, 0.0, 0.3]])

    def aside(share):
        return permitted((0.5, 0.0), (0.5, 0.0), nothing, person, (3.0, 0.5, 0.1), (0.3, 0.5, share))[1]

    assert aside(1.0) == pytest.approx(
        2 * aside(0.5), rel=0.02
    )  # the border is followed, which is not quite straight aside
    assert aside(0.5) < -0.05


def drive(robot, world=None, **changes):
    return drives.drive(Orca(load_settings("planner/orca"), robot), robot, world, **changes)


def test_it_drives_around_a_pillar_and_people():
    pillar = World(circles=np.array([[2.0, 0.05, 0.3]]), segments=room().segments)
    assert drive(stage(), pillar, goal=(4.0, 0.0)).outcome is Outcome.SUCCESS
    for motion in ("orca", "social_force"):
        people = tuple(
            Mover(path=np.array([[6.0, y], [-4.0, y]]), radius=0.25, speed=1.2, motion=motion)
            for y in (-0.4, 0.5)
        )
        assert drive(stage(), World(movers=people), goal=(6.0, 0.0)).outcome is Outcome.SUCCESS


def test_it_stops_before_a_wall():
    wall = World(segments=np.array([[2.0, -3.0, 2.0, 3.0]]))
    episode = drive(stage(), wall, goal=(4.0, 0.0), time_limit=20.0)
    assert episode.outcome is Outcome.TIMEOUT
    assert episode.min_clearance > 0.0
