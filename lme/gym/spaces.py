"""Observations and actions as Gymnasium's spaces describe them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lme.config.presets import load_map_set, load_robot, load_simulator
from lme.errors import InputError, building, nearest, require
from lme.gym.crowds import MOST_PEOPLE
from lme.gym.episodes import DrawRobot, Reward
from lme.perception.resampling import nearest_by_sector
from lme.robots import Lidar, Robot
from lme.types import Floats
from lme.worlds.world import MapSet

Arrays = dict[str, NDArray[np.float32]]

Settings = Mapping[str, Any]
TARGET_CLIPS = 2.0  # distance at which the target is 1, in clips of the scan


def observation_space(lidar: Lidar, people: bool) -> spaces.Dict[Any]:
    """Space of scan, target [m], twist [m/s, rad/s], limits (v_max, ω_max, α_v, α_ω), float32; and `people_rows`."""
    space = spaces.Dict(
        scan=spaces.Box(0.0, lidar.range_max, (lidar.num_beams,), np.float32),
        target=spaces.Box(-np.inf, np.inf, (2,), np.float32),
        twist=spaces.Box(-np.inf, np.inf, (2,), np.float32),
        limits=spaces.Box(0.0, np.inf, (4,), np.float32),
    )
    if people:
        space["people"] = spaces.Box(-np.inf, np.inf, (MOST_PEOPLE, 5), np.float32)
    return space


def action_space() -> spaces.Box[Any]:
    """Space of v and ω, each as a share of the robot's limit."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def arrays(ranges: NDArray[np.float32], target: Any, twist: Any, limits: Any, range_max: float) -> Arrays:
    """Return new arrays as in the space, for one robot or many. A beam without a return gets range_max."""
    return {
        "scan": np.minimum(ranges, np.float32(range_max)),
        "target": np.array(target, dtype=np.float32),
        "twist": np.array(twist, dtype=np.float32),
        "limits": np.array(limits, dtype=np.float32),
    }


def people_rows(pedestrians: Floats) -> NDArray[np.float32]:
    """Rows (MOST_PEOPLE, 5): the nearest of the people (P, 4) in the robot frame [m, m/s], and 1; then zeros."""
    rows = np.zeros((MOST_PEOPLE, 5), np.float32)
    nearest = np.argsort(np.hypot(pedestrians[:, 0], pedestrians[:, 1]), kind="stable")[:MOST_PEOPLE]
    rows[: len(nearest), :4] = pedestrians[nearest]
    rows[: len(nearest), 4] = 1.0
    return rows


def commands(actions: Any, limits: Floats) -> Floats:
    """Return the velocity commands (..., 2) [m/s, rad/s] of actions (..., 2) clipped to ±1. limits (..., 4).

    Raises InputError for actions of another shape and for NaN.
    """
    requested = np.asarray(actions, dtype=np.float64)
    shape = (*limits.shape[:-1], 2)
    if requested.shape != shape or np.isnan(requested).any():
        raise InputError(f"the action is {requested.tolist()}: must be numbers in [-1, 1], of shape {shape}")
    return np.asarray(np.clip(requested, -1.0, 1.0) * limits[..., :2])


@dataclass(slots=True)
class Choices:
    """Parts of an environment. simulator: a class, called with `config` and a robot."""

    map_set: MapSet
    robot: Robot | DrawRobot
    simulator: Any
    config: Any
    reward: Reward


def choose(
    map: str | MapSet,
    robot: str | Robot | DrawRobot,
    sim: str,
    reward: Reward | Settings | None,
    map_config: Settings | None,
    sim_config: Settings | None,
) -> Choices:
    """Return the objects for these keywords. Raises InputError for an unknown name or key, or a wrong value.

    map, robot, sim: names in `conf/map/`, `conf/robot/` and `conf/sim/`, or objects. map_config, sim_config: values
    for some of the keys of a named one. reward: values for some of the fields of `Reward`.
    """
    chosen_robot = load_robot(robot) if isinstance(robot, str) else robot
    fixed = chosen_robot if isinstance(chosen_robot, Robot) else None
    map_set = load_map_set(map, map_config, fixed) if isinstance(map, str) else map
    if map_set is map and map_config:
        raise InputError(
            "map_config is given with a map set, not with a name: must be given to the map set itself"
        )
    simulator, config = load_simulator(sim, sim_config)
    terms = reward if isinstance(reward, Reward) else _reward(reward or {})
    return Choices(map_set, chosen_robot, simulator, config, terms)


def _reward(settings: Settings) -> Reward:
    names = [field.name for field in fields(Reward)]
    for key in settings:
        if key not in names:
            raise InputError(
                f"reward.{key} is unknown: {nearest(key, names)}must be one of {', '.join(names)}"
            )
    with building("reward"):
        return Reward(**settings)


class FlatObservation(gym.Wrapper[Any, Any, Any, Any], gym.utils.RecordConstructorArgs):
    """Observation as one vector (beams + 4,), float32: scan clipped at `clip` [m], target, and last action.

    beams: number of ranges, each the nearest return of a sector of neighbouring beams of the lidar; sectors differ by
    one beam if it does not divide the lidar's. None: all beams.
    A target farther away than twice the clip is moved to that distance. At the start the last action is 0.
    Source: Daffan/ros_jackal, where the robot learns to drive in the BARN worlds.
    """

    def __init__(self, env: gym.Env[Any, Any], clip: float = 5.0, beams: int | None = None) -> None:
        """Raises InputError unless `beams` is from 1 to those of the lidar."""
        gym.utils.RecordConstructorArgs.__init__(self, clip=clip, beams=beams)
        gym.Wrapper.__init__(self, env)
        require("clip", clip, above=0.0)
        scan = env.observation_space["scan"]  # type: ignore[index]
        (num_beams,) = scan.shape
        self._clip, self._beams = clip, num_beams if beams is None else beams
        if not 1 <= self._beams <= num_beams:
            raise InputError(f"beams is {beams}: must be from 1 to the lidar's {num_beams}")
        self.observation_space = spaces.Box(-1.0, 1.0, (self._beams + 4,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """See the environment."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._flat(observation, np.zeros(2)), info

    def step(self, action: Any) -> tuple[NDArray[np.float32], Any, bool, bool, dict[str, Any]]:
        """See the environment."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._flat(observation, np.clip(action, -1.0, 1.0)), reward, terminated, truncated, info

    def _flat(self, observation: Arrays, action: Any) -> NDArray[np.float32]:
        return flattened(observation, np.asarray(action), self._beams, self._clip)


def flattened(
    observation: Arrays, action: NDArray[Any], beams: int, clip: float = 5.0
) -> NDArray[np.float32]:
    """Return the vectors (..., beams + 4) of `FlatObservation` for observations of one robot or of many.

    action (..., 2): the last one, in [−1, 1]; beams: at most the lidar's; clip [m].
    """
    scan, target = observation["scan"], observation["target"]
    nearest = nearest_by_sector(scan, beams)
    distance = np.hypot(target[..., :1], target[..., 1:])
    parts = (
        np.minimum(nearest, clip) / clip * 2.0 - 1.0,
        target / np.maximum(TARGET_CLIPS * clip, distance),
        action,
    )
    return np.concatenate(parts, axis=-1).astype(np.float32)
