"""Many robots, each in its own world and episode, moved by one compiled call: `sim=fast` in bulk.

It takes and returns arrays and does not need Gymnasium. To the last bit, each robot sees and does what
it would if it drove alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.gym.episodes import OUTCOMES, DrawRobot, Episodes, Result, Reward, distances
from lme.gym.kernels import RUNNING, TIMEOUT, Bodies, States, WorldArrays, advance, look
from lme.perception.raycast import beam_table
from lme.robots import Robot
from lme.simulation.disturbances import Disturbances
from lme.simulation.fast import FastConfig
from lme.types import Bools, Floats, Ints
from lme.worlds.world import MapSet, Task

_UNSUPPORTED = tuple(field.name for field in fields(Disturbances) if field.name != "goal_rate")
ONE_BY_ONE = 'use one environment per robot instead (gym.make_vec with vectorization_mode="sync")'


class Views(NamedTuple):
    """Observations of K robots.

    ranges (K, B) float32 [m], range_max without a return; targets (K, 2): goals in the robots' frames [m]; twists (K,
    2), which are also the last commands, as far as the robots could follow them [m/s, rad/s]; limits (K, 4): v_max,
    ω_max, α_v, α_ω; boxes (K, 3): half length, half width and rounding of the collision footprint [m].
    """

    ranges: NDArray[np.float32]
    targets: Floats
    twists: Floats
    limits: Floats
    boxes: Floats

    def of(self, chosen: Ints) -> Views:
        """Return the observations of some of the robots, in new arrays."""
        return Views._make(array[chosen] for array in self)

    def put(self, chosen: Ints, views: Views) -> None:
        """Replace the observations of some of the robots."""
        for name in self._fields:
            getattr(self, name)[chosen] = getattr(views, name)


class Transition(NamedTuple):
    """The result of a step of N robots.

    views: the next observations; a robot whose episode has ended is at the start of its next one. rewards (N,).
    terminated, truncated (N,): arrived or in contact; out of time. outcomes (N,): codes of `lme.gym.kernels`.
    ended (K,): the robots whose episode has ended, with their `last_views` and `results` (K).
    """

    views: Views
    rewards: Floats
    terminated: Bools
    truncated: Bools
    outcomes: Ints
    ended: Ints
    last_views: Views
    results: list[Result]


class Fleet:
    """N robots that drive side by side, each in its own world. Call `reset` first.

    Lidar and control rate are the same for all; the other values of a robot may be redrawn for each episode.
    """

    def __init__(
        self,
        map_set: MapSet,
        robot: Robot | DrawRobot,
        num_envs: int,
        config: FastConfig | None = None,
        reward: Reward | None = None,
    ) -> None:
        """Raises InputError for anything that the compiled step does not support."""
        self._episodes = Episodes(map_set, robot)
        self._config, self._reward = config or load_settings("sim/fast"), reward or Reward()
        self.robot, self.num_envs = self._episodes.robot, num_envs
        self._check()
        lidar = self.robot.lidar
        angles = (lidar.angle_min, lidar.angle_increment)
        self._lidar = tuple(map(float, (*lidar.mount, *angles, lidar.range_max)))
        self._table = beam_table(lidar.angle_increment, lidar.num_beams)
        self.tasks: list[Task] = []  # of the current episodes
        self._rngs: list[np.random.Generator] = [np.random.default_rng() for _ in range(num_envs)]
        self._places, self._bodies, self._states = _places(num_envs), _bodies(num_envs), _states(num_envs)
        self._steps, self._distances = np.zeros(num_envs, dtype=np.int64), np.zeros(num_envs)
        self._slowest = np.full(num_envs, -np.inf)  # v_min of each robot [m/s]

    def reset(self, seeds: Sequence[int | None] | None = None, world: int | None = None) -> Views:
        """Start an episode with every robot, in this world or in worlds drawn at random.

        seeds (N,): new random streams for the robots; None: continue the current ones.
        """
        if seeds is not None and len(seeds) != self.num_envs:
            raise InputError(f"seeds has {len(seeds)} numbers: must have {self.num_envs}, one for each robot")
        for i, seed in enumerate(seeds or []):
            if seed is not None:
                self._rngs[i] = np.random.default_rng(seed)
        self.tasks = [self._begin(i, world) for i in range(self.num_envs)]
        return self._views(np.arange(self.num_envs))

    def step(self, commands: Floats) -> Transition:
        """Drive every robot for one control period. commands (N, 2): v [m/s] and ω [rad/s].

        Raises InputError for commands that are not finite.
        """
        commands = self._checked(commands)
        config, states = self._config, self._states
        timing = (self.robot.dt, float(config.max_step), config.even_ramp)
        advance(states, self._bodies, self._places, commands, *timing)
        self._steps += 1
        previous, self._distances = self._distances, distances(self._places.goals, states.poses)
        outcomes = states.outcomes.copy()
        rewards = self._reward.of(previous, self._distances, outcomes)
        views, (ended,) = self._views(np.arange(self.num_envs)), np.nonzero(outcomes)
        last_views, results = views.of(ended), [self._result(int(i)) for i in ended]
        if len(ended):
            for i in ended:
                self.tasks[i] = self._begin(int(i))
            views.put(ended, self._views(ended))
        truncated = outcomes == TIMEOUT
        terminated = (outcomes != RUNNING) & ~truncated
        return Transition(views, rewards, terminated, truncated, outcomes, ended, last_views, results)

    def _begin(self, i: int, world: int | None = None) -> Task:
        """Put robot i at the start of its next episode."""
        task, robot = self._episodes.draw(self._rngs[i], world)
        self._copy_world(i, task)
        hull, bodies, states = robot.footprint, self._bodies, self._states
        bodies.limits[i], bodies.boxes[i] = robot.limits.bounds, hull.box
        bodies.reaches[i] = hull.circumscribed_radius
        self._slowest[i] = robot.limits.v_min
        states.poses[i], states.twists[i] = task.start, 0.0
        states.times[i] = states.lengths[i] = 0.0
        states.clocks[i] = np.nan if task.clock_distance > 0.0 else 0.0
        self._steps[i] = 0
        self._distances[i] = distances(self._places.goals[i : i + 1], states.poses[i : i + 1])[0]
        return task

    def _copy_world(self, i: int, task: Task) -> None:
        """Copy the world of robot i into the shared arrays, which grow if it has more obstacles than any before."""
        obstacles = (task.world.circles, task.world.edges)
        if task.world.movers:
            raise InputError(f"map {task.map_name}, world {task.number} has moving obstacles: {ONE_BY_ONE}")
        places = self._places
        for name, rows in zip(("circles", "edges"), obstacles, strict=True):
            array = getattr(places, name)
            if len(rows) > array.shape[1]:
                array = np.concatenate([array, np.zeros((len(array), len(rows), array.shape[2]))], axis=1)
                places = places._replace(**{name: array})
            array[i, : len(rows)] = rows
        self._places = places
        places.counts[i] = [len(rows) for rows in obstacles]
        places.starts[i], places.goals[i] = task.start[:2], task.goal
        places.rules[i] = task.goal_tolerance, task.time_limit, task.clock_distance

    def _views(self, robots: Ints) -> Views:
        """Return the current observations of the chosen robots (K,), in new arrays."""
        lidar, count = self.robot.lidar, len(robots)
        std, noise = float(lidar.noise_std), np.empty((0, 0), dtype=np.float32)
        if std > 0.0:
            noise = np.empty((count, lidar.num_beams), dtype=np.float32)
            for row, i in zip(noise, robots, strict=True):
                self._rngs[i].standard_normal(dtype=np.float32, out=row)
        ranges, targets = np.empty((count, lidar.num_beams), dtype=np.float32), np.empty((count, 2))
        look(robots, self._states, self._places, self._lidar, self._table, noise, std, ranges, targets)
        bodies = self._bodies
        return Views(
            ranges, targets, self._states.twists[robots], bodies.limits[robots], bodies.boxes[robots]
        )

    def _result(self, i: int) -> Result:
        task, states = self.tasks[i], self._states
        clock = 0.0 if np.isnan(states.clocks[i]) else states.clocks[i]
        time, length = min(float(states.times[i] - clock), task.time_limit), float(states.lengths[i])
        outcome = OUTCOMES[int(states.outcomes[i])]
        return Result(outcome, task.number, time, length, int(self._steps[i]), task.optimal_time)

    def _checked(self, commands: Floats) -> Floats:
        if not self.tasks:
            raise InputError("the robots have no episodes yet: call reset before step")
        commands = np.ascontiguousarray(commands, dtype=np.float64)
        if commands.shape != (self.num_envs, 2):
            raise InputError(f"the commands have shape {commands.shape}: must be {(self.num_envs, 2)}")
        wrong = np.flatnonzero(~np.isfinite(commands).all(axis=1))
        if len(wrong):
            raise InputError(
                f"the command of robot {wrong[0]} is {commands[wrong[0]].tolist()}: must be finite"
            )
        return np.column_stack((np.maximum(commands[:, 0], self._slowest), commands[:, 1]))

    def _check(self) -> None:
        """Raise InputError for what needs substeps, or for a sensor other than a planar lidar with its own noise."""
        if self.num_envs < 1:
            raise InputError(f"num_envs is {self.num_envs}: must be at least 1")
        config, lidar = self._config, self.robot.lidar
        values = {f"sim.{key}": getattr(config, key) or None for key in _UNSUPPORTED}
        values |= {"sim.goal_rate": config.goal_rate}
        values |= {"robot.lidar.native_beams": lidar.native_beams, "robot.lidar.cloud": lidar.cloud}
        for key, value in values.items():
            if value is not None:
                raise InputError(
                    f"{key} is {value}: the compiled step of many robots does not support it, {ONE_BY_ONE}"
                )


def _places(n: int) -> WorldArrays:
    return WorldArrays(
        circles=np.zeros((n, 0, 3)),
        edges=np.zeros((n, 0, 4)),
        counts=np.zeros((n, 2), dtype=np.int64),
        starts=np.zeros((n, 2)),
        goals=np.zeros((n, 2)),
        rules=np.zeros((n, 3)),
    )


def _bodies(n: int) -> Bodies:
    return Bodies(limits=np.zeros((n, 4)), boxes=np.zeros((n, 3)), reaches=np.zeros(n))


def _states(n: int) -> States:
    return States(
        poses=np.zeros((n, 3)),
        twists=np.zeros((n, 2)),
        times=np.zeros(n),
        clocks=np.zeros(n),
        lengths=np.zeros(n),
        outcomes=np.zeros(n, dtype=np.int64),
    )
