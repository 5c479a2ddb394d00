"""Drives LME+ among people and compares its tracks with where the people truly are."""

from __future__ import annotations

from collections.abc import Sequence
from time import thread_time_ns
from typing import Any

import numpy as np

from benchmarks.people.score import Score
from lme.geometry.frames import compose
from lme.navigation.episode import run_episode
from lme.perception.people.source import TrackedPeople
from lme.robots import Robot
from lme.simulation.crowd import discs_in_sight
from lme.simulation.simulator import Simulator, State
from lme.types import Floats, Guidance, Observation, Outcome, Twist
from lme.worlds.world import Task
from runners.config import build
from runners.config.command_line import compose_job
from runners.config.composer import Composer
from runners.workers.episodes import episode_rng

_SLACK = 0.1  # [m] as where the simulator gives people
WORDS = ("system=lme_plus", "tracking=none", "executor=serial", "runs=1")


def drive(words: Sequence[str], score: Score) -> tuple[int, int, Floats]:
    """Drive a map set with tracked people: successes, episodes, and the processor time of each update [µs]."""
    with Composer("eval") as composer:
        config = compose_job(composer, [*WORDS, "people=tracked", *words]).config
    maps, navigator, simulator = build.map_set(config), build.navigator(config), build.simulator(config)
    timer = navigator.people = _Timed(config.robot)
    successes = 0
    for number in maps.numbers:
        task = maps.task(number)
        score.begin()
        watcher = _Watcher(simulator, task, config.robot, timer, score)
        episode = run_episode(task, navigator, simulator, episode_rng(config.seed, number, 0), watcher)
        successes += episode.outcome is Outcome.SUCCESS
    return successes, len(maps.numbers), np.array(timer.times)


class _Timed(TrackedPeople):
    """Tracked people, with the processor time of each update [µs]."""

    def __init__(self, robot: Robot) -> None:
        self.times: list[float] = []
        super().__init__(robot)

    def seen(self, observation: Observation, time: float | None) -> Observation:
        """As of its class."""
        start_ns = thread_time_ns()
        tracks = super().seen(observation, time)
        self.times.append((thread_time_ns() - start_ns) / 1000.0)
        return tracks


class _Watcher:
    """Scores the tracks of every decision."""

    def __init__(self, simulator: Simulator, task: Task, robot: Robot, people: TrackedPeople, score: Score):
        self._simulator, self._mount, self._people, self._score = simulator, robot.lidar.mount, people, score
        self._static, self._dt = len(task.world.circles), robot.dt
        self._discs_before: Floats | None = None

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        """Score a decision's tracks."""
        discs = self._simulator.obstacles[0][self._static :]
        displacement = 0.0 if self._discs_before is None else (discs[:, :2] - self._discs_before) / self._dt
        velocities = np.zeros((len(discs), 2)) + displacement
        self._discs_before = discs[:, :2].copy()
        scan, lidar = observation.scan, compose(state.pose, self._mount)
        angles = (scan.angle_min, scan.angle_increment)
        limits = (scan.range_min, scan.range_max, _SLACK)
        poses = (*lidar,), (*state.pose,)
        visible_discs = [
            discs_in_sight(discs[k : k + 1], velocities[k : k + 1], scan.ranges, angles, limits, *poses)
            for k in range(len(discs))
        ]
        people = np.array([k for k, disc in enumerate(visible_discs) if len(disc)], dtype=np.int64)
        tracks = self._people.tracks
        assert tracks is not None
        self._score.add(people, np.vstack([np.empty((0, 4)), *visible_discs]), tracks)

    def ended(self, *end: Any) -> None:
        """There is no decision to score."""
