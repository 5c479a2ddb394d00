"""The rules of the BARN Challenge's runner, and where ours differ from them.

The runner is run.py of github.com/Daffan/the-barn-challenge. Once the robot has moved 0.1 m, it reads clock, position
and contacts every 0.1 s until the robot is within 1 m, in contact or 100 s on its way.
"""

import csv
import math
from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_map_set, load_settings
from lme.guides.target import Target, TargetConfig
from lme.metrics import barn_metric
from lme.navigation.episode import Progress, run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.simulation.simulator import State
from lme.simulation.substeps import until_event
from lme.types import Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import shipped, task
from tests.places import SHARED
from tests.tolerances import KERNEL

LOG = SHARED / "facts/gazebo_eit.csv"
POLL = 0.1  # [s]
TWO_M_S = (0, 2, 3, 13, 16, 17, 96, 97, 98, 99)  # blocks of the log whose optimal times are those of 2 m/s


@pytest.fixture
def barn():
    """A task with the rules of map=barn, without its world."""
    return replace(load_map_set("barn").task(16), world=World())


def state(job, time, ahead, contact=False, arrived=False):
    """State of a robot that has come so far ahead of the start [m]."""
    pose = Pose(job.start.x, job.start.y + ahead, job.start.yaw)
    return State(pose, Twist(0.0, 0.0), time, np.array([pose]), 0.0 if contact else 1.0, contact, arrived)


def progress_after(job, *states):
    progress = Progress(job, state(job, 0.0, 0.0))
    for before, after in zip((state(job, 0.0, 0.0), *states), states, strict=False):
        progress.moved(before, after)
    return progress


def ended(job, *states):
    """Outcome and time of a drive that ends in the last state."""
    progress = progress_after(job, *states)
    return progress.outcome(states[-1]), progress.time(states[-1])


class TestClock:
    def test_it_starts_where_the_robot_is_a_tenth_of_a_metre_from_the_start(self, barn):
        start = (state(barn, 7.0, 0.0999), state(barn, 8.0, 0.1))
        outcome, time = ended(barn, *start, state(barn, 20.0, 9.0, arrived=True))
        assert (outcome, time) == (Outcome.SUCCESS, pytest.approx(12.0))

    def test_time_before_it_does_not_count_towards_the_time_limit(self, barn):
        start = (state(barn, 80.0, 0.05), state(barn, 81.0, 0.1))
        assert ended(barn, *start, state(barn, 180.9, 5.0)) == (None, pytest.approx(99.9))
        assert ended(barn, *start, state(barn, 181.0, 5.0)) == (Outcome.TIMEOUT, pytest.approx(100.0))

    def test_differs_a_robot_that_does_not_leave_the_start_is_out_of_time(self, barn):
        """The runner waits for it without a limit, and never writes a line."""
        assert ended(barn, state(barn, 100.0, 0.05)) == (Outcome.TIMEOUT, 100.0)


class TestArrival:
    @pytest.mark.parametrize(("ahead", "arrived"), [(9.0, True), (8.999, False)])
    def test_it_is_within_a_metre_of_the_goal(self, barn, ahead, arrived):
        travel = np.array([state(barn, 0.0, ahead).pose])
        *_, reached = until_event(travel, barn, (0.2, 0.2, 0.0), np.empty((0, 3)), np.empty((0, 4)))
        assert reached == arrived

    def test_after_the_time_limit_it_is_too_late(self, barn):
        start = state(barn, 1.0, 0.1)
        assert ended(barn, start, state(barn, 100.99, 9.0, arrived=True))[0] is Outcome.SUCCESS
        assert ended(barn, start, state(barn, 101.0, 9.0, arrived=True))[0] is Outcome.TIMEOUT

    def test_differs_it_is_timed_where_it_happens(self):
        """The runner's time is that of its next reading, up to 0.1 s later."""
        robot = shipped("jackal")
        job = replace(task(goal=(10.0, 0.0), goal_tolerance=1.0), clock_distance=0.1)
        navigator = Navigator(Target(TargetConfig(), robot), Simple(load_settings("planner/simple"), robot))
        episode = run_episode(
            job, navigator, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(0)
        )
        assert episode.time == pytest.approx((9.0 - 0.1) / 2.0, abs=0.03)


class TestContact:
    BOX = (0.2, 0.2, 0.0)

    def event(self, job, *ahead, disc):
        """Contact and arrival of a drive past a disc of 0.1 m, which lies so far ahead of the start."""
        travel = np.array([state(job, 0.0, metres).pose for metres in ahead])
        x, y, _ = state(job, 0.0, disc).pose
        *_, contact, arrived = until_event(travel, job, self.BOX, np.array([[x, y, 0.1]]), np.empty((0, 4)))
        return contact, arrived

    def test_before_arrival_and_on_arrival_it_is_a_collision(self, barn):
        assert self.event(barn, 8.8, 8.9, 9.0, disc=9.1) == (True, False)
        assert self.event(barn, 8.8, 8.9, 9.0, disc=9.25) == (True, False)

    def test_differs_after_arrival_it_does_not_count(self, barn):
        """The runner counts it if it happens before its next reading."""
        assert self.event(barn, 8.8, 8.9, 9.0, 9.2, disc=9.4) == (False, True)

    def test_no_world_has_an_obstacle_that_the_robot_could_hit_within_a_period_of_its_arrival(self):
        worlds = load_map_set("barn", {"subset": "all"})
        reach = shipped("jackal").drivetrain.contact.circumscribed_radius + 2.0 * POLL
        for number in worlds.numbers[::25]:
            job = worlds.task(number)
            away = np.hypot(*(job.world.circles[:, :2] - job.goal).T) - job.world.circles[:, 2]
            assert away.min() > job.goal_tolerance + reach

    def test_before_the_clock_starts_it_is_a_collision(self, barn):
        """The runner writes it down once the robot has moved 0.1 m."""
        assert ended(barn, state(barn, 3.0, 0.05, contact=True))[0] is Outcome.COLLISION

    def test_at_the_time_limit_it_is_a_collision(self, barn):
        start = state(barn, 1.0, 0.1)
        assert ended(barn, start, state(barn, 101.0, 4.0, contact=True))[0] is Outcome.COLLISION

    def test_what_counts_in_gazebo_are_the_wheels_too(self):
        """Any contact of the robot but with the ground; the wheels are wider than the body."""
        footprint = shipped("jackal").drivetrain.contact
        assert (footprint.length, footprint.width) == (0.458, 0.416)


class TestMetric:
    @pytest.mark.parametrize(
        ("time", "metric"), [(1.0, 0.5), (12.0, 0.5), (24.0, 0.25), (48.0, 0.125), (99.0, 0.125)]
    )
    def test_the_time_is_clipped_to_two_and_eight_optimal_times(self, time, metric):
        assert barn_metric(True, time, 6.0) == pytest.approx(metric, abs=KERNEL)
        assert barn_metric(False, time, 6.0) == 0.0

    @pytest.mark.skipif(not LOG.is_file(), reason=f"needs {LOG}")
    def test_the_lab_s_optimal_times_are_those_from_two_metres(self):
        """Its run.py starts at (−2, 3); the organisers' has started at (−2.25, 3) since 2024."""
        logged = defaultdict(list)
        for row in csv.DictReader(LOG.read_text(encoding="utf-8").splitlines()):
            metric, time = float(row["metric"]), float(row["time_s"])
            if int(row["block"]) in TWO_M_S and 0.13 < metric < 0.49:  # not clipped
                logged[int(row["world"])].append(metric * time)
        worlds = load_map_set("barn", {"start": [-2.0, 3.0, math.pi / 2], "goal": [-2.0, 13.0]})
        assert len(logged) > 50
        for number, times in logged.items():
            assert np.median(times) == pytest.approx(worlds.task(number).optimal_time, abs=0.002)
