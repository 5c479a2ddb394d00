"""Whole drives of a simulated robot behind the live driver."""

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.config.presets import load_map_set, load_simulator
from lme.live.step import LiveState
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.types import Guidance, Outcome, Twist
from lme.worlds.world import World
from runners.workers.episodes import episode_rng
from tests import builders
from tests.live_loop import drive_live, drive_over_network

WORLDS = (30, 210, 240)


@pytest.mark.parametrize("world", WORLDS)
def test_the_driver_drives_a_barn_world_exactly_as_an_episode(world):
    """The same observations, decisions and commands, from messages; the soft stop does not intervene."""
    robot, task = builders.shipped("jackal"), load_map_set("barn", {"worlds": [world]}).task(world)
    simulator, config = load_simulator("fast")
    episode = run_episode(
        task, builders.navigator(robot), simulator(config, robot), episode_rng(0, 1, 0)
    )  # a driver's first goal has the random numbers of world 1
    driver, steps, outcome, time = drive_live(
        task, builders.navigator, robot, simulator(config, robot), episode_rng(0, 1, 0)
    )
    assert outcome is episode.outcome is Outcome.SUCCESS
    assert time == pytest.approx(episode.time)
    assert len(steps) == episode.steps
    assert sum(step.guidance.switched for step in steps) == episode.switches
    assert driver.soft_stops == 0
    assert {step.state for step in steps} == {LiveState.DRIVING}


class Ram:
    """Drives straight ahead, whatever is there."""

    def reset(self, rng):
        pass

    def guide(self, observation):
        return Guidance(observation.target)

    def plan(self, observation, guidance):
        return Twist(observation.limits.v_max, 0.0)


@pytest.mark.parametrize("name", ["jackal", "turtlebot2", "go2"])
@pytest.mark.parametrize("soft_stop", [True, False])
def test_the_soft_stop_keeps_a_reckless_planner_from_contact(name, soft_stop):
    robot, world = builders.shipped(name), World(circles=np.array([[4.0, 0.0, 0.3], [2.0, 3.0, 0.3]]))
    task = builders.task(world, goal=(8.0, 0.0), time_limit=20.0)
    simulator, config = load_simulator("fast")
    driver, steps, outcome, _ = drive_live(
        task, lambda robot: Navigator(Ram(), Ram()), robot, simulator(config, robot), soft_stop=soft_stop
    )
    assert outcome is (Outcome.TIMEOUT if soft_stop else Outcome.COLLISION)
    assert (driver.soft_stops > 0) is soft_stop
    if soft_stop:
        last = steps[-1]
        assert last.soft_stopped
        assert last.command == (0.0, 0.0)
        assert last.wanted.v == robot.v_max
        assert "soft stop" in last.reason
        ahead = 4.0 - 0.3 - robot.footprint.box[0] - robot.footprint.box[2] - last.observation.odometry.x
        assert 0.0 < ahead < 0.5
        np.testing.assert_allclose(last.observation.twist, 0.0, atol=1e-9)


@pytest.mark.parametrize("world", WORLDS)
def test_the_driver_arrives_where_messages_are_late_overtaken_and_lost(world):
    robot, task = builders.shipped("jackal"), load_map_set("barn", {"worlds": [world]}).task(world)
    simulator, config = load_simulator("fast")
    outcome, reasons = drive_over_network(
        task, builders.navigator, robot, lambda robot: simulator(config, robot), seed=world, scan_rate=40.0
    )
    assert outcome is Outcome.SUCCESS
    assert reasons[""] > 0.9 * reasons.total()


@pytest.mark.parametrize("soft_stop", [True, False])
def test_the_soft_stop_holds_where_messages_are_late_overtaken_and_lost(soft_stop):
    robot, world = builders.shipped("turtlebot2"), World(circles=np.array([[4.0, 0.0, 0.3], [2.0, 3.0, 0.3]]))
    task = builders.task(world, goal=(8.0, 0.0), time_limit=20.0)
    simulator, config = load_simulator("fast")
    for seed in range(3):
        outcome, _ = drive_over_network(
            task,
            lambda robot: Navigator(Ram(), Ram()),
            robot,
            lambda robot: simulator(config, robot),
            seed,
            delay=0.3,
            lost=0.3,
            soft_stop=soft_stop,
        )
        assert outcome is (Outcome.TIMEOUT if soft_stop else Outcome.COLLISION)
