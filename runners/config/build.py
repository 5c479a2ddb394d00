"""Build the objects that a config describes."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import numpy as np

from lme.errors import InputError, building, require
from lme.guides.lme.weight_files import with_network
from lme.inputs.user_code import check_call
from lme.navigation.navigator import Navigator
from lme.perception.people.source import People, people_source
from lme.robots import Robot
from lme.simulation.simulator import Simulator
from lme.worlds.check import check_task
from lme.worlds.rules import LEAST_TIME, TIME_FACTOR, fair_limit, with_robot
from lme.worlds.world import DrawsRobots, MapSet, Task
from runners.config.instantiate import build, configured
from runners.config.schema import DriveConfig, EpisodesConfig, SystemConfig

if TYPE_CHECKING:
    import pandas as pd

C = TypeVar("C", bound=DriveConfig)

LARGEST_WORLD, LARGEST_SEED = 2**31 - 1, 2**63 - 1  # that records can hold
FEW_EPISODES = 2  # driven in the command's own process before workers would have started
_CHECKED_TASKS = (
    20  # before anything runs; the others when they are driven, since a task may be slow to build
)


def map_set(config: DriveConfig, worlds: Sequence[int] | None = None) -> MapSet:
    """Build the map set of a config, with these worlds if they are given, and with the people of `crowd`.

    A `radius` and a `v_max` of null become those of the robot. Raises InputError.
    """
    # Hydra does not check the map sets in a dictionary of several.
    if not isinstance(config.map, Mapping):
        raise InputError(f"map is {config.map!r}: must be a map set")
    node = config.map if worlds is None else {**config.map, "worlds": list(worlds)}
    maps = _checked("map", build(with_robot(node, config.robot), "map"), numbers=None, task=("number",))
    return cast(MapSet, build(config.crowd, "crowd", maps=maps) if config.crowd else maps)


def navigator(config: SystemConfig, robot: Robot | None = None) -> Navigator:
    """Build guide and planner of a config, with its filter, for its robot unless another is given."""
    robot = (robot or config.robot).capped(config.cap)
    methods = {"reset": ("rng",), "plan": ("observation", "guidance")}
    planner = _checked("planner", build(with_network(config.planner), "planner", robot=robot), **methods)
    if config.filter:
        planner = _checked("filter", build(config.filter, "filter", planner=planner, robot=robot), **methods)
    people = people_source(people_of(config), robot)
    guide = build(with_network(config.guide, "guide"), "guide", robot=robot)
    _checked("guide", guide, reset=("rng",), guide=("observation",))
    optional = {"read_map": ("world", "start"), "explanation": ()}
    _checked("guide", guide, **{name: optional[name] for name in optional if hasattr(guide, name)})
    return Navigator(guide, planner, people=people, feedback=config.feedback, dt=robot.dt, cap=config.cap)


def _checked(key: str, part: Any, **members: tuple[str, ...] | None) -> Any:
    """Return what the config made.

    members: by name, with the arguments of methods. Raises InputError if one is missing or takes other arguments, as in
    a user's own class.
    """
    missing = [name for name in members if not hasattr(part, name)]
    if missing:
        raise InputError(
            f"{key}._target_: {type(part).__name__} has no {missing[0]}; it must have {' and '.join(members)} "
            "(docs/howto/planner.md)"
        )
    for name, arguments in members.items():
        if arguments is not None:
            check_call(f"{key}._target_", getattr(part, name), *arguments)
    return part


def people_of(config: SystemConfig) -> People:
    """Return the source of people that the system sees; without the key `people`, the simulator's truth."""
    return People(getattr(config, "people", People.truth))


def refuse_truth(config: SystemConfig) -> None:
    """Raise InputError if people are to come from the simulator, for commands that have none."""
    if people_of(config) is People.truth:
        raise InputError(
            "people is truth: only a simulator knows where people truly are; must be tracked or none"
        )


def simulator(config: DriveConfig) -> Simulator:
    """Build the simulator of a config."""
    return cast(Simulator, build(config.sim, "sim", robot=config.robot))


class EpisodeSetting(NamedTuple):
    """Config and task of an episode.

    config: includes the robot and disturbances that the map set draws, if any. drawn: columns of the records.
    """

    config: DriveConfig
    task: Task
    drawn: Mapping[str, float | str]


def setting(config: DriveConfig, maps: MapSet, number: int) -> EpisodeSetting:
    """Return config and task of world `number` of `maps`, the map set of the config. Raises InputError."""
    if not isinstance(maps, DrawsRobots):
        with building("map"):
            return EpisodeSetting(config, maps.task(number), {})
    drawn = maps.drawn(number)
    drawn_config = replace(with_disturbances(config, drawn.disturbances), robot=drawn.robot)
    return EpisodeSetting(drawn_config, drawn.task, drawn.columns)


def with_disturbances(config: C, values: Mapping[str, float]) -> C:
    """Return the config with other values of its simulator.

    A planner or filter whose `latency` equals the simulator's gets the new one.
    """
    sim = {**config.sim, **values}

    def with_latency(part: Mapping[str, Any]) -> dict[str, Any]:
        follows = "latency" in part and part["latency"] == config.sim["latency"]
        return {**part, **({"latency": sim["latency"]} if follows else {})}

    return replace(config, sim=sim, planner=with_latency(config.planner), filter=with_latency(config.filter))


def check_drive(
    config: EpisodesConfig, num_tasks: int | None = _CHECKED_TASKS, maps: MapSet | None = None
) -> None:
    """Check a system and its first `num_tasks` tasks, or all of them for None. Raises InputError.

    maps: the map set of the config, if it is built already.
    """
    check_episodes(config, num_tasks, maps)
    navigator(config)


def check_episodes(
    config: EpisodesConfig, num_tasks: int | None = _CHECKED_TASKS, maps: MapSet | None = None
) -> None:
    """Check everything but the navigator. Raises InputError."""
    require("runs", config.runs, at_least=1)
    require("seed", config.seed, at_least=0)
    if config.seed > LARGEST_SEED:
        raise InputError(f"seed is {config.seed}: must be at most {LARGEST_SEED}")
    configured(config.executor, "executor")
    maps = map_set(config) if maps is None else maps
    _check_numbers(maps.numbers)
    settings = [setting(config, maps, number) for number in maps.numbers[:num_tasks]]
    for episode_setting in settings:
        check_task(episode_setting.task, episode_setting.config.robot)
    _warn_of_short_limits(settings, len(maps.numbers))
    simulator(config)


def _check_numbers(numbers: Sequence[int]) -> None:
    """Raise InputError unless records can hold the numbers of the worlds, which a user's own map set may choose."""
    array = np.asarray(numbers)
    is_whole = array.ndim == 1 and array.size > 0 and array.dtype.kind in "iu"
    if not (
        is_whole and 0 <= array.min() <= array.max() <= LARGEST_WORLD and np.unique(array).size == array.size
    ):
        raise InputError(
            f"map: its worlds have the numbers {list(numbers)!r:.80}: must be different whole numbers from 0 to "
            f"{LARGEST_WORLD}, at least one"
        )


def _warn_of_short_limits(settings: Sequence[EpisodeSetting], count: int) -> None:
    """Warn of goals that the robot cannot reach in time. count: number of all tasks; these may be only the first."""
    late = [episode for episode in settings if _fastest(episode) > episode.task.time_limit]
    if late:
        fastest = sorted(map(_fastest, late))
        limits = sorted(episode.task.time_limit for episode in late)
        of = f"the first {len(settings)} of {count}" if len(settings) < count else f"{count}"
        warnings.warn(
            f"map.time_limit is {limits[0]:g} s, and in {len(late)} of {of} worlds the map's shortest path takes "
            f"{_span(fastest[0], fastest[-1])} s at the highest speed of {_v_max(late[0].config):g} m/s: "
            "the robot can hardly arrive there in time",
            stacklevel=2,
        )


def _fastest(episode_setting: EpisodeSetting) -> float:
    """Return the time [s] of the map's path to within the goal's tolerance at full speed.

    That of BARN may be longer than the way that a robot finds.
    """
    return (episode_setting.task.shortest_path_length - episode_setting.task.goal_tolerance) / _v_max(
        episode_setting.config
    )


def _v_max(config: DriveConfig) -> float:
    """Return the highest speed that the system may command [m/s]."""
    return config.robot.capped(config.cap).v_max


def describe_limits(config: DriveConfig, frame: pd.DataFrame) -> str:
    """Describe a run's time limit, and the number of worlds where it is too short; empty for other rules."""
    if "time_limit" not in config.map:
        return ""
    time_limit = config.map["time_limit"]
    lengths = frame.groupby("world")["shortest_path_length_m"].first()
    if time_limit is None:
        limits = [fair_limit(length / (config.map.get("v_max") or config.robot.v_max)) for length in lengths]
        rule = f"{TIME_FACTOR:g} × shortest path / v_max, at least {LEAST_TIME:g} s"
        return f"Time limit: {rule}: {_span(min(limits), max(limits))} s"
    fastest = (lengths - frame.groupby("world")["goal_tolerance_m"].first()) / _v_max(config)
    late = fastest[fastest > time_limit]
    beyond = (
        f"; the map's shortest path takes {_span(late.min(), late.max())} s at v_max in {len(late)} of {len(lengths)} "
        "worlds"
        if len(late)
        else ""
    )
    return f"Time limit: {time_limit:g} s{beyond}"


def _span(low: float, high: float) -> str:
    """Return "60 to 1,420", or "60"."""
    first, last = (f"{time:.3g}" if time < 1000 else f"{time:,.0f}" for time in (low, high))
    return first if first == last else f"{first} to {last}"
