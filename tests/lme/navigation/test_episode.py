"""Closed loop: scan, decision, control, motion, collision."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.lme.guide import Lme
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import RunningEpisode, run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import PUBLISHED, room, stage, task
from tests.tolerances import KERNEL


def drive(task, guide="lme", robot=None, seed=0):
    robot = robot or stage()
    guide = (
        Lme(load_settings("guide/lme", parameters=PUBLISHED), robot)
        if guide == "lme"
        else Target(TargetConfig(), robot)
    )
    navigator = Navigator(guide, Simple(load_settings("planner/simple"), robot))
    return run_episode(
        task, navigator, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(seed)
    )


def test_an_empty_room_is_crossed_200_times_of_200():
    rng = np.random.default_rng(1)
    outcomes = []
    for seed in range(200):
        x, y, goal_x, goal_y = rng.uniform(-4.5, 4.5, 4)
        start = Pose(x, y, rng.uniform(-math.pi, math.pi))
        crossing = task(room(), start, (goal_x, goal_y), time_limit=100.0)
        outcomes.append(drive(crossing, seed=seed).outcome)
    assert outcomes.count(Outcome.SUCCESS) == 200


def test_a_wall_traps_the_bare_planner_and_not_lme():
    wall = World(segments=np.array([[2.0, -1.5, 2.0, 1.5]]))
    assert drive(task(wall), guide="target").outcome is not Outcome.SUCCESS
    outcomes = [drive(task(wall, time_limit=120.0), seed=seed).outcome for seed in range(5)]
    assert outcomes == [Outcome.SUCCESS] * 5


def test_a_sealed_box_ends_in_time_out():
    # With r no larger than the robot, the 9° cone of the planner may graze a wall; 5 cm is margin enough.
    episode = drive(task(room(1.5), time_limit=20.0), robot=stage(collision_radius=0.25))
    assert episode.outcome is Outcome.TIMEOUT
    assert episode.time == pytest.approx(20.0)


def test_contact_is_a_collision_where_it_happens():
    disc = World(circles=np.array([[2.0, 0.0, 0.3]]))
    episode = drive(task(disc), guide="target")
    assert episode.outcome is Outcome.COLLISION
    assert episode.min_clearance == 0.0
    # Centre to centre 0.3 + 0.2 m, to one check step.
    assert episode.trajectory[-1, 1] == pytest.approx(1.5, abs=0.026)


def test_limits_hold_at_every_step():
    robot = stage()
    wall = World(segments=np.array([[2.0, -1.5, 2.0, 1.5]]))
    v, omega = drive(task(wall), robot=robot).trajectory[:-1, 4:6].T
    assert np.abs(v).max() <= robot.v_max + 1e-12
    assert np.abs(omega).max() <= robot.omega_max + 1e-12
    assert np.abs(np.diff(v)).max() <= robot.alpha_v * robot.dt + 1e-12
    assert np.abs(np.diff(omega)).max() <= robot.alpha_omega * robot.dt + 1e-12


def test_the_same_seed_gives_the_same_episode():
    wall = World(segments=np.array([[2.0, -1.5, 2.0, 1.5]]))
    one, two, other = drive(task(wall)), drive(task(wall)), drive(task(wall), seed=1)
    np.testing.assert_array_equal(one.trajectory, two.trajectory)
    assert (
        one.trajectory.shape != other.trajectory.shape or (one.trajectory != other.trajectory)[:, 1:3].any()
    )


def test_the_clock_starts_with_the_motion():
    still = task(goal=(-2.0, 0.0))  # behind: the robot turns first
    late = still.__class__(**{**{f: getattr(still, f) for f in still.__slots__}, "clock_distance": 0.1})
    assert drive(late).time < drive(still).time


@pytest.mark.parametrize("even", [False, True])
def test_velocity_reaches_the_command_at_alpha_or_evenly(even):
    # From rest to 0.2 m/s at 2 m/s², Δt 0.2 s. At α: 0.1 s to 0.2 m/s, then 0.1 s held: 0.01 + 0.02 = 0.03 m.
    # Evenly: 0.1 m/s on average, 0.02 m.
    simulator = FastSimulator(load_settings("sim/fast", even_ramp=even), stage())
    simulator.reset(task(), np.random.default_rng(0))
    simulator.step(Twist(0.2, 0.0))
    assert simulator.state.pose.x == pytest.approx(0.02 if even else 0.03, abs=KERNEL)
    assert simulator.state.twist.v == pytest.approx(0.2, abs=KERNEL)


def test_a_simulator_that_cannot_change_says_so(says):
    class Fixed(FastSimulator):
        change = None

    robot = stage()
    navigator = Navigator(Target(TargetConfig(), robot), Simple(load_settings("planner/simple"), robot))
    running = RunningEpisode(
        task(), navigator, Fixed(load_settings("sim/fast"), robot), np.random.default_rng(0)
    )
    with says.raises(InputError):
        running.change(task())
