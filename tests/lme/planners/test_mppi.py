"""MPPI: it follows paths, keeps limits, never samples alike with another seed, starts anew, and drives."""

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.grids.obstacle_grid import TOUCHING
from lme.planners.mppi.planner import Mppi
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import observation, shipped, task
from tests.lme.planners.drives import drive, plan
from tests.tolerances import KERNEL

JACKAL = shipped("jackal")
JACKAL.control_rate = 20.0
POST = World(circles=np.array([[2.0, 0.05, 0.2]]))


def planner(robot=JACKAL, seed=0, **changes):
    made = Mppi(load_settings("planner/mppi", **changes), robot)
    made.reset(np.random.default_rng(seed))
    return made


def test_it_drives_to_the_target_at_its_own_speed_and_stops():
    episode = drive(planner(), JACKAL, goal=(6.0, 1.0), goal_tolerance=0.3)
    assert episode.outcome is Outcome.SUCCESS
    speeds = episode.trajectory[:, 4]
    assert speeds.max() <= 0.5 + KERNEL
    assert np.median(speeds) > 0.4


def test_it_drives_around_a_post_beside_the_line():
    world = World(circles=np.array([[2.0, 0.3, 0.2]]))
    episode = drive(planner(), JACKAL, world, goal_tolerance=0.3)
    assert episode.outcome is Outcome.SUCCESS
    assert episode.trajectory[:, 2].min() < -0.02


def test_a_seed_decides_a_drive_to_the_last_bit():
    def commands(seed):
        made, simulator = planner(seed=seed), FastSimulator(load_settings("sim/fast"), JACKAL)
        view, given = simulator.reset(task(POST), np.random.default_rng(0)), []
        for _ in range(15):
            given.append(plan(made, view))
            view = simulator.step(given[-1])
        return given

    assert commands(3) == commands(3)
    assert commands(3) != commands(4)


def test_it_follows_a_path_that_begins_behind():
    made = planner()
    path = np.column_stack([-np.arange(0.0, 3.0, 0.05), np.zeros(60)])
    command = None
    for _ in range(10):
        command = made.plan(observation(target=(-4.0, 0.0), robot=JACKAL), Guidance(path[-1], path))
    assert abs(command.omega) > 0.3  # it turns round


def test_slow_control_holds_the_mean_of_several_steps_of_the_model():
    slow = shipped("jackal")
    slow.control_rate = 5.0
    made = planner(slow)
    made.sequence = np.column_stack([np.linspace(0.0, 0.5, 56), np.zeros(56)])
    before = made.sequence.copy()
    v, omega = made._command(made._limits(slow.limits))
    assert v == pytest.approx(before[1:5, 0].mean(), abs=0.01)
    assert omega == 0.0
    assert made.sequence[0, 0] == pytest.approx(before[4, 0], abs=0.01)


def test_with_no_free_sample_it_begins_anew_and_stops(monkeypatch):
    made = planner()
    monkeypatch.setattr(made.costmap, "update", lambda _: made.costmap.costs.fill(TOUCHING))
    made.sequence[:] = 0.4
    assert plan(made, observation(twist=Twist(0.4, 0.0), robot=JACKAL)) == Twist(0.0, 0.0)
    np.testing.assert_array_equal(made.sequence, 0.0)


def test_near_the_target_it_stops():
    made = planner()
    view = observation(target=(0.12, 0.0), twist=Twist(0.3, 0.1), odometry=Pose(1.0, 2.0, 0.3), robot=JACKAL)
    assert plan(made, view) == Twist(0.0, 0.0)
