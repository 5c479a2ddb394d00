"""Drives of LME+: out of dead ends longer than its memory, through and past narrow doors, to a target behind."""

import numpy as np
import pytest

import lme
from lme.config.presets import load_settings
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Pose
from lme.worlds.world import World
from tests.builders import observation, shipped, task, without_errors

ROOM = [(0, 0, 60, 0), (60, 0, 60, 30), (60, 30, 0, 30), (0, 30, 0, 0)]
# A corridor of 38 m points at the goal and is closed there; the way leads back to its mouth and around it.
CORRIDOR = [(0, 9, 1, 9), (3.5, 9, 42, 9), (42, 9, 42, 12), (42, 12, 0, 12)]
# A corridor of 54 m that is closed at both ends; the only way out is a gap in its side away from the goal.
TWO = [(3, 9, 28, 9), (30, 9, 57, 9), (57, 9, 57, 12), (57, 12, 3, 12), (3, 12, 3, 9)]


@pytest.mark.parametrize(
    ("walls", "start", "goal"), [(CORRIDOR, (5.0, 10.5), (50.0, 10.5)), (TWO, (20.0, 10.5), (30.0, 25.0))]
)
@pytest.mark.parametrize("seed", range(2))
def test_lme_plus_leaves_dead_ends_that_are_longer_than_its_memory_reaches(walls, start, goal, seed):
    outcome, _ = driven("turtlebot2", ROOM + walls, Pose(*start, 0.0), goal, seed, time_limit=900.0)
    assert outcome is Outcome.SUCCESS


HALL = [(0, 0, 12, 0), (12, 0, 12, 10), (12, 10, 0, 10), (0, 10, 0, 0)]


def wall_with_door(half):
    """A room of 12 × 10 m with a wall at x = 6 whose door, at y = 5.05, leaves `half` on each side."""
    return [*HALL, (6, 0, 6, 5.05 - half), (6, 5.05 + half, 6, 10)]


def driven(name, walls, start, goal, seed=0, time_limit=60.0):
    """The outcome, and how far the robot has turned in all [rad]."""
    robot = without_errors(shipped(name))
    simulator, turned = FastSimulator(load_settings("sim/fast"), robot), []

    class Turns:
        def decided(self, observation, guidance, command, state):
            turned.append(abs(state.twist.omega) * robot.dt)

        def ended(self, observation, state):
            pass

    there = task(World(segments=np.array(walls, dtype=float)), start, goal, time_limit=time_limit)
    navigator, rng = lme.load_system("lme_plus", robot), np.random.default_rng(seed)
    episode = lme.run_episode(there, navigator, simulator, rng, Turns())
    return episode.outcome, sum(turned)


@pytest.mark.parametrize("name", ["jackal", "turtlebot2"])
def test_lme_plus_drives_through_a_door_that_leaves_less_than_its_margin(name):
    walls = wall_with_door(shipped(name).footprint.inscribed_radius + 0.07)
    there = Pose(2.0, 4.0, 0.0), (10.0, 6.0)
    outcomes = [driven(name, walls, *there, seed, time_limit=120.0)[0] for seed in range(2)]
    assert outcomes == [Outcome.SUCCESS] * 2


@pytest.mark.parametrize("turn", [0.2, 0.5])
def test_lme_plus_drives_through_a_narrow_door_in_a_slanted_wall(turn):
    """The cells of its grid lie across the wall, and the door leaves 5 cm on each side."""
    cos, sin = np.cos(turn), np.sin(turn)
    half = shipped("turtlebot2").footprint.inscribed_radius + 0.05
    sides = [(6 - away * sin, 5 + away * cos) for away in (-4.9, -half, half, 4.9)]
    walls = [*HALL, (*sides[0], *sides[1]), (*sides[2], *sides[3])]
    outcome, _ = driven("turtlebot2", walls, Pose(3.0, 3.0, 0.0), (9.0, 7.0), time_limit=120.0)
    assert outcome is Outcome.SUCCESS


@pytest.mark.parametrize("more", [0.01, 0.035])
def test_lme_plus_goes_round_where_it_cannot_pass_a_door(more):
    """The way round, by a wide door 18 m away, leaves the disc in which the target is."""
    half = shipped("jackal").footprint.inscribed_radius + more
    walls = [(-2, -16, 20, -16), (20, -16, 20, 26), (20, 26, -2, 26), (-2, 26, -2, -16)]
    walls += [(6, -13, 6, 5.075 - half), (6, 5.075 + half, 6, 26)]
    outcome, _ = driven("jackal", walls, Pose(2.0, 5.0, 0.0), (10.0, 6.0), time_limit=120.0)
    assert outcome is Outcome.SUCCESS


# A corridor of .8 m, in which a Go2 of .7 m cannot turn, closed at x = 11.
LANE = [(6, 5.4, 11, 5.4), (11, 5.4, 11, 4.6), (11, 4.6, 6, 4.6)]


@pytest.mark.parametrize("seed", range(2))
def test_lme_plus_leaves_a_dead_end_in_which_a_long_robot_cannot_turn(seed):
    there = Pose(10.4, 5.0, 0.0), (2.0, 6.0)
    outcome, _ = driven("go2", HALL + LANE, *there, seed, time_limit=90.0)
    assert outcome is Outcome.SUCCESS


def test_places_before_which_it_was_stuck_are_for_one_target():
    robot = without_errors(shipped("go2"))
    guide, seen = lme.load_system("lme_plus", robot).guide, observation((8.0, 0.0), robot=robot)
    guide.guide(seen)
    places = guide._stuck
    for _ in range(round(3.0 / robot.dt)):
        places.wait(np.array([1.0, 0.0]))
    guide.guide(seen._replace(target=np.array([8.5, 0.0])))
    assert len(places.rows) > 0
    guide.guide(seen._replace(target=np.array([13.0, 0.0])))
    assert len(places.rows) == 0


@pytest.mark.parametrize("name", ["jackal", "turtlebot2"])
def test_a_target_behind_costs_one_turn(name):
    outcome, turned = driven(name, ROOM, Pose(30.0, 15.0, np.pi), (34.5, 15.0))
    assert outcome is Outcome.SUCCESS
    assert np.pi - 0.1 < turned < np.pi + 0.5
