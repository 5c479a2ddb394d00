"""LiCS-KI: its speeds, what slows it down, its direction without a path, and a drive."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.navigation.episode import run_episode
from lme.planners.lics.planner import Lics
from lme.types import Guidance, Outcome
from runners.config import build
from tests.builders import observation, shipped
from tests.composing import jobs_of
from tests.lme.planners.drives import plan
from tests.tolerances import KERNEL

JACKAL = shipped("jackal")
JACKAL.control_rate = 20.0
AHEAD = np.array([[0.0, 0.0], [3.0, 0.0]])


def planner(robot=JACKAL, **changes):
    made = Lics(load_settings("planner/lics", **changes), robot)
    made.reset(np.random.default_rng(0))
    return made


def test_in_the_open_it_drives_ahead_fast_and_no_faster_than_its_own_limit():
    command = plan(planner(), observation(robot=JACKAL))
    assert 0.9 <= command.v <= 1.0 + KERNEL  # 20 m/s² from rest in 50 ms
    fast = observation(robot=JACKAL)._replace(twist=command._replace(v=1.4))
    assert 1.0 < plan(planner(), fast).v <= 1.5


def test_an_obstacle_ahead_slows_it_down_in_proportion():
    ranges = np.full(720, 30.0, np.float32)
    ranges[360] = 1.0
    view = observation(robot=JACKAL, ranges=ranges)
    view = view._replace(twist=view.twist._replace(v=0.7))
    fast, slow = (plan(planner(threshold_dist=far), view).v for far in (2.5, 5.0))
    assert 0.3 < slow < 1.0
    assert fast == pytest.approx(2.0 * slow)
    ranges[360], ranges[200] = 30.0, 1.0  # 60° to the right
    assert plan(planner(), view).v > fast


def test_without_a_path_it_keeps_its_direction():
    made = planner()
    view = observation(robot=JACKAL)
    first = made.plan(view, Guidance(AHEAD[-1], AHEAD))
    lost = made.plan(view, Guidance(np.zeros(2), np.zeros((2, 2)), blocked=True))
    assert lost == first
    aside = np.array([[0.0, 0.0], [0.0, 3.0]])
    assert made.plan(view, Guidance(aside[-1], aside)).omega > first.omega + 0.2


def test_the_entry_drives_to_the_goal():
    words = ("system=lics", "robot.control_rate=20", "map.subset=fresh", "map.count=1")
    with jobs_of("eval", *words) as job:
        config = job().config
        task = build.map_set(config).task(1000)
        navigator, simulator = build.navigator(config), build.simulator(config)
        episodes = [run_episode(task, navigator, simulator, np.random.default_rng(0)) for _ in range(2)]
    assert episodes[0].outcome is Outcome.SUCCESS
    assert episodes[0].trajectory[:, 4].max() <= 1.5 + KERNEL
    np.testing.assert_array_equal(*(episode.trajectory for episode in episodes))
