"""What the keywords of an environment mean: map set, robot, simulator and reward, by name or as objects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from lme.envs.episodes import DrawRobot, Episodes
from lme.envs.reward import Reward
from lme.errors import InputError, nearest
from lme.presets import load_map_set, load_robot, load_simulator
from lme.robots import Robot
from lme.worlds.world import MapSet

Settings = Mapping[str, Any]


@dataclass(slots=True)
class Choices:
    """The objects that an environment is made of. simulator: a class, called with `config` and a robot."""

    map_set: MapSet
    robot: Robot | DrawRobot
    simulator: Any
    config: Any
    reward: Reward

    def episodes(self) -> Episodes:
        """The episodes to drive."""
        return Episodes(self.map_set, self.robot)


def choose(
    map: str | MapSet,
    robot: str | Robot | DrawRobot,
    sim: str,
    reward: Reward | Settings | None,
    map_config: Settings | None,
    sim_config: Settings | None,
) -> Choices:
    """The objects for these keywords. Raises InputError for an unknown name or key, or a wrong value.

    map, robot, sim: names in `conf/map/`, `conf/robot/` and `conf/sim/`, or objects. map_config, sim_config: values
    for some of the keys of a named one. reward: values for some of the fields of `Reward`.
    """
    chosen = load_robot(robot) if isinstance(robot, str) else robot
    fixed = chosen if isinstance(chosen, Robot) else None
    map_set = load_map_set(map, map_config, fixed) if isinstance(map, str) else map
    if map_set is map and map_config:
        raise InputError(
            "map_config is given with a map set, not with a name: must be given to the map set itself"
        )
    simulator, config = load_simulator(sim, sim_config)
    terms = reward if isinstance(reward, Reward) else _reward(reward or {})
    return Choices(map_set, chosen, simulator, config, terms)


def _reward(given: Settings) -> Reward:
    known = [field.name for field in fields(Reward)]
    for key in given:
        if key not in known:
            raise InputError(
                f"reward.{key} is unknown: {nearest(key, known)}must be one of {', '.join(known)}"
            )
    return Reward(**given)
