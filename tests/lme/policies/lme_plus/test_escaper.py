"""Dead ends longer than the reach of the memory: what was learned of their places leads out of them."""

import numpy as np
import pytest

import lme
from lme.sim.fast import FastConfig, FastSimulator
from lme.types import Outcome, Pose
from lme.worlds.world import World
from tests.builders import shipped, task, without_errors

ROOM = [(0, 0, 60, 0), (60, 0, 60, 30), (60, 30, 0, 30), (0, 30, 0, 0)]
# A corridor of 38 m points at the goal and is closed there; the way leads back to its mouth and around it.
CORRIDOR = [(0, 9, 1, 9), (3.5, 9, 42, 9), (42, 9, 42, 12), (42, 12, 0, 12)]
# A corridor of 54 m that is closed at both ends; the only way out is a gap in its side away from the goal.
TWO = [(3, 9, 28, 9), (30, 9, 57, 9), (57, 9, 57, 12), (57, 12, 3, 12), (3, 12, 3, 9)]


@pytest.mark.parametrize(
    ("walls", "start", "goal"), [(CORRIDOR, (5.0, 10.5), (50.0, 10.5)), (TWO, (20.0, 10.5), (30.0, 25.0))]
)
@pytest.mark.parametrize("seed", range(3))
def test_lme_plus_leaves_dead_ends_that_are_longer_than_its_memory_reaches(walls, start, goal, seed):
    robot = without_errors(shipped("turtlebot2"))
    world = World(segments=np.array(ROOM + walls, dtype=float))
    there = task(world, Pose(*start, 0.0), goal, time_limit=900.0)
    navigator = lme.load_system("lme_plus", robot)
    episode = lme.run_episode(
        there, navigator, FastSimulator(FastConfig(), robot), np.random.default_rng(seed)
    )
    assert episode.outcome is Outcome.SUCCESS
