"""Gymnasium vector environment of many robots: a thin wrapper around `Fleet`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from lme.errors import InputError
from lme.gym.episodes import DrawRobot, world_of
from lme.gym.fleet import ONE_BY_ONE, Fleet, Transition, Views
from lme.gym.reward import Reward
from lme.gym.spaces import Arrays, Settings, action_space, arrays, choose, commands, observation_space
from lme.perception.people.source import People
from lme.robots import Robot
from lme.simulation.fast import FastSimulator
from lme.types import Bools, Floats
from lme.worlds.world import MapSet


class NavigationVectorEnv(VectorEnv[Any, Any, Any]):
    """Many robots in `sim=fast`, moved by one compiled call.

    To the last bit, each robot does what it would do in `NavigationEnv`. A robot whose episode ends is put
    at the start of the next one in the same step; `infos["final_obs"]` and `infos["final_info"]` hold the end.
    """

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        map: str | MapSet = "barn",
        robot: str | Robot | DrawRobot = "jackal",
        sim: str = "fast",
        reward: Reward | Settings | None = None,
        map_config: Settings | None = None,
        sim_config: Settings | None = None,
        render_mode: str | None = None,
        people: str = "none",
    ) -> None:
        """See `lme.gym.spaces.choose` for the keywords. Raises InputError for what the compiled call lacks."""
        if render_mode is not None:
            raise InputError(f"render_mode is {render_mode!r}: cannot render many robots, {ONE_BY_ONE}")
        if people != People.none:
            raise InputError(f"people is {people!r}: nobody is in the worlds of many robots, {ONE_BY_ONE}")
        choices = choose(map, robot, sim, reward, map_config, sim_config)
        if choices.simulator is not FastSimulator:
            raise InputError(
                f"sim is {sim!r}: only sim=fast has a compiled step of many robots, {ONE_BY_ONE}"
            )
        self.fleet = Fleet(choices.map_set, choices.robot, num_envs, choices.config, choices.reward)
        self.num_envs, self._limits = num_envs, np.zeros((num_envs, 4))
        self.single_observation_space = observation_space(self.fleet.robot.lidar, people=False)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, Any]]:
        """Start an episode with every robot. seed: of the first robot, others count up; or one for each."""
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        views = self.fleet.reset(seeds, world_of(options))
        self._limits = views.limits
        infos: dict[str, Any] = {}
        for i in range(self.num_envs):
            infos = self._add_info(infos, self._start(i), i)
        return self._obs(views), infos

    def step(self, actions: Any) -> tuple[Arrays, Floats, Bools, Bools, dict[str, Any]]:
        """Drive every robot for one control period. Raises InputError for actions that are not numbers."""
        step = self.fleet.step(commands(actions, self._limits))
        self._limits = step.views.limits
        return self._obs(step.views), step.rewards, step.terminated, step.truncated, self._infos(step)

    def _infos(self, step: Transition) -> dict[str, Any]:
        """Return the ends of episodes and the starts of the next ones, as Gymnasium's infos."""
        infos: dict[str, Any] = {}
        final = self._obs(step.last_views)
        for k, i in enumerate(step.ended.tolist()):
            end = {"final_obs": {name: part[k].copy() for name, part in final.items()}}
            infos = self._add_info(infos, {**end, "final_info": step.results[k].info()}, i)
            infos = self._add_info(infos, self._start(i), i)
        return infos

    def _start(self, i: int) -> dict[str, Any]:
        task = self.fleet.tasks[i]
        return {"world": task.number, "optimal_time": task.optimal_time}

    def _obs(self, views: Views) -> Arrays:
        range_max = self.fleet.robot.lidar.range_max
        return arrays(views.ranges, views.targets, views.twists, views.limits, range_max)
