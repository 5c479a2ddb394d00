"""Gymnasium environments: of one robot in any simulator, and of many in one call, a thin wrapper around `Fleet`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from lme.errors import InputError
from lme.gym.episodes import CODES, DrawRobot, Episodes, Result, Reward, distances, world_of
from lme.gym.fleet import ONE_BY_ONE, Fleet, OneByOneError, Transition, Views
from lme.gym.frame import frame
from lme.gym.spaces import (
    Arrays,
    Settings,
    action_space,
    arrays,
    choose,
    commands,
    observation_space,
    people_rows,
)
from lme.navigation.episode import Progress
from lme.perception.people.source import People, people_source
from lme.robots import Robot
from lme.simulation.fast import FastSimulator
from lme.simulation.simulator import Simulator
from lme.simulation.skid import GazeboSimulator, SkidSimulator
from lme.types import Bools, Floats, Ints, Observation, Outcome, Twist
from lme.worlds.world import MapSet


class NavigationEnv(gym.Env[Any, Any]):
    """Drive a robot to its goal past obstacles that it sees with a lidar.

    See docs/howto/environments.md for observation, action, reward and info. Each episode takes place in a world drawn
    at random from the map set, or in the one that `reset(options={"world": 42})` chooses.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        map: str | MapSet = "barn",
        robot: str | Robot | DrawRobot = "jackal",
        sim: str = "fast",
        reward: Reward | Settings | None = None,
        map_config: Settings | None = None,
        sim_config: Settings | None = None,
        render_mode: str | None = None,
        people: str = "none",
    ) -> None:
        """See `lme.gym.spaces.choose` for the other keywords.

        people: the people in the observation, see `lme.perception.people.source.People`; "none": no such key.
        """
        if render_mode not in (None, "rgb_array"):
            raise InputError(f'render_mode is {render_mode!r}: must be None or "rgb_array"')
        self.render_mode = render_mode
        self._choices = choose(map, robot, sim, reward, map_config, sim_config)
        self._episodes = Episodes(self._choices.map_set, self._choices.robot)
        self._people = people_source(people, self._episodes.robot)
        self._shows_people = people != People.none
        self.observation_space = observation_space(self._episodes.robot.lidar, self._shows_people)
        self.action_space = action_space()
        self._simulator: Simulator | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, Any]]:
        """Start an episode, in the world `options["world"]` if there is one."""
        super().reset(seed=seed)
        self._task, self._robot = self._episodes.draw(self.np_random, world_of(options))
        self._simulator = self._choices.simulator(self._choices.config, self._robot)
        observation = self._simulator.reset(self._task, self.np_random)
        if self._people:
            self._people.reset()
        self._progress, self._steps = Progress(self._task, self._simulator.state), 0
        self._trail, self._distance = [self._simulator.state.pose], self._distance_left()
        return self._obs(observation), {"world": self._task.number, "optimal_time": self._task.optimal_time}

    def step(self, action: Any) -> tuple[Arrays, float, bool, bool, dict[str, Any]]:
        """Drive for one control period. Raises InputError for an action that is not two numbers."""
        if self._simulator is None:
            raise InputError("the robot has no episode yet: call reset before step")
        v, omega = commands(action, np.array(self._robot.limits.bounds)).tolist()
        previous = self._simulator.state
        observation = self._simulator.step(Twist(v, omega))
        state = self._simulator.state
        self._progress.moved(previous, state)
        self._steps += 1
        self._trail.append(state.pose)
        outcome = self._progress.outcome(state)
        truncated = outcome is Outcome.TIMEOUT
        terminated = outcome is not None and not truncated
        info = {} if outcome is None else self._result(outcome).info()
        return self._obs(observation), self._reward(outcome), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """Return the scene from above (H, W, 3), or None without a render mode."""
        if self.render_mode is None or self._simulator is None:
            return None
        return frame(self._task, self._robot, self._simulator, self._scan, self._trail)

    def _obs(self, observation: Observation) -> Arrays:
        self._scan = scan = observation.scan
        entries = arrays(
            scan.ranges, observation.target, observation.twist, observation.limits.bounds, scan.range_max
        )
        if self._shows_people:
            tracked = self._people.seen(observation, None) if self._people else observation
            entries["people"] = people_rows(tracked.pedestrians)
        return entries

    def _reward(self, outcome: Outcome | None) -> float:
        previous, self._distance = self._distance, self._distance_left()
        return float(self._choices.reward.of(previous, self._distance, np.array([CODES[outcome]]))[0])

    def _distance_left(self) -> Floats:
        """Distance from robot to goal: (1,) [m]."""
        assert self._simulator is not None
        return distances(np.array([self._task.goal]), np.array([self._simulator.state.pose]))

    def _result(self, outcome: Outcome) -> Result:
        assert self._simulator is not None
        time, length = self._progress.time(self._simulator.state), self._progress.path_length
        return Result(outcome, self._task.number, time, length, self._steps, self._task.optimal_time)


def vector_env(num_envs: int = 1, **keywords: Any) -> VectorEnv[Any, Any, Any]:
    """Return a `NavigationVectorEnv`, or a row of `NavigationEnv` where that cannot be, with a warning that says why.

    See both for the keywords. A row does not use `threads`.
    """
    try:
        return NavigationVectorEnv(num_envs, **keywords)
    except OneByOneError as error:
        reason = str(error).removesuffix(f", {ONE_BY_ONE}").removesuffix(f": {ONE_BY_ONE}")
    warnings.warn(
        f"{reason}; {num_envs} robots are therefore simulated one after another, which takes several times as long",
        stacklevel=2,
    )
    mode = AutoresetMode(keywords.pop("autoreset_mode", AutoresetMode.SAME_STEP))
    keywords.pop("threads", None)
    return SyncVectorEnv([partial(NavigationEnv, **keywords)] * num_envs, autoreset_mode=mode)


class NavigationVectorEnv(VectorEnv[Any, Any, Any]):
    """Many robots in `sim=fast`, `walking`, `skid` or `gazebo`, moved by one compiled call.

    To the last bit, each robot does what it would do in `NavigationEnv`. By default, a robot whose episode ends is
    put at the start of the next one in the same step; `infos["final_obs"]` and `infos["final_info"]` hold the end.
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
        autoreset_mode: str | AutoresetMode = AutoresetMode.SAME_STEP,
        threads: int | None = None,
        max_episode_steps: int | None = None,
    ) -> None:
        """See `lme.gym.spaces.choose` for the other keywords. Raises InputError for what the compiled call lacks.

        max_episode_steps: not supported, since the map set limits the time.
        autoreset_mode: Gymnasium's, "SameStep", "NextStep" or "Disabled". threads: see `lme.gym.threads.Threads`.
        """
        if max_episode_steps is not None:
            raise InputError(
                f"max_episode_steps is {max_episode_steps}: the map set limits the time of many robots; must be "
                'map_config={"time_limit": …} [s], which is the steps times the control period'
            )
        if render_mode is not None:
            raise OneByOneError(f"render_mode is {render_mode!r}: cannot render many robots, {ONE_BY_ONE}")
        if people == People.tracked:
            raise OneByOneError(
                f"people is {people!r}: the compiled step of many robots does not track people, {ONE_BY_ONE}"
            )
        choices = choose(map, robot, sim, reward, map_config, sim_config)
        if choices.simulator not in (FastSimulator, SkidSimulator, GazeboSimulator):
            raise OneByOneError(
                f"sim is {sim!r}: only fast, walking, skid and gazebo have a compiled step of many robots, {ONE_BY_ONE}"
            )
        mode = AutoresetMode(autoreset_mode)
        self._shows_people = people == People.truth
        how = choices.config, choices.reward, str(mode.value), threads, self._shows_people
        self.fleet = Fleet(choices.map_set, choices.robot, num_envs, *how)
        people_source(people, self.fleet.robot)  # checks the name
        self.metadata = {**self.metadata, "autoreset_mode": mode}
        self.num_envs, self._limits = num_envs, np.zeros((num_envs, 4))
        self.single_observation_space = observation_space(self.fleet.robot.lidar, self._shows_people)
        self.single_action_space = action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Arrays, dict[str, Any]]:
        """Start an episode with every robot. seed: of the first robot, others count up; or one for each.

        options: "world", the number of a world; without autoreset also "reset_mask" (N,), the robots that start.
        """
        options = dict(options or {})
        mask = self._mask(options.pop("reset_mask")) if self._is_manual and "reset_mask" in options else None
        seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, int) else seed
        views = self.fleet.reset(seeds, world_of(options), mask)
        self._limits = views.limits
        robots = np.arange(self.num_envs) if mask is None else np.flatnonzero(mask)
        return self._obs(views), self._columns({}, self.fleet.begun(robots), robots)

    def step(self, actions: Any) -> tuple[Arrays, Floats, Bools, Bools, dict[str, Any]]:
        """Drive every robot for one control period. Raises InputError for actions that are not numbers."""
        step = self.fleet.step(commands(actions, self._limits))
        self._limits = step.views.limits
        return self._obs(step.views), step.rewards, step.terminated, step.truncated, self._infos(step)

    @property
    def _is_manual(self) -> bool:
        return self.metadata["autoreset_mode"] is AutoresetMode.DISABLED

    def _mask(self, mask: Any) -> Bools:
        """Return `reset_mask` (N,). Raises InputError for anything else."""
        chosen = np.asarray(mask)
        if chosen.shape != (self.num_envs,) or chosen.dtype != np.bool_ or not chosen.any():
            raise InputError(
                f"reset_mask is {mask!r:.80}: must be {self.num_envs} booleans, of which at least one is true"
            )
        return chosen

    def _infos(self, step: Transition) -> dict[str, Any]:
        """Return the ends of episodes and the starts of the next ones, as Gymnasium's infos."""
        infos: dict[str, Any] = {}
        ended = step.ended
        if len(ended) and self.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP:
            final_obs, final = np.full(self.num_envs, None, dtype=object), self._obs(step.last_views)
            for k, i in enumerate(ended.tolist()):
                final_obs[i] = {name: part[k] for name, part in final.items()}
            infos["final_obs"], infos["final_info"] = (
                final_obs,
                self._columns({}, step.results.infos(), ended),
            )
            mask = np.zeros(self.num_envs, dtype=np.bool_)
            mask[ended] = True
            infos["_final_obs"], infos["_final_info"] = mask, mask.copy()
        elif len(ended):
            self._columns(infos, step.results.infos(), ended)
        return self._columns(infos, self.fleet.begun(step.begun), step.begun) if len(step.begun) else infos

    def _columns(
        self, infos: dict[str, Any], values: dict[str, NDArray[Any]], robots: Ints
    ) -> dict[str, Any]:
        """Add values (K,) of robots (K,) to arrays (N,), each with the mask of the robots that have one."""
        for name, column in values.items():
            empty = None if column.dtype == object else 0
            infos.setdefault(name, np.full(self.num_envs, empty, column.dtype))[robots] = column
            infos.setdefault(f"_{name}", np.zeros(self.num_envs, dtype=np.bool_))[robots] = True
        return infos

    def _obs(self, views: Views) -> Arrays:
        """Return the observations; the scan is the fleet's own array."""
        parts = {"target": views.targets, "twist": views.twists, "limits": views.limits}
        observation = {
            "scan": views.ranges,
            **{name: part.astype(np.float32) for name, part in parts.items()},
        }
        return {**observation, "people": views.people} if self._shows_people else observation
