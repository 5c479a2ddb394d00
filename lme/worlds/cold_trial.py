"""The cold trial as a map set: a robot, disturbances and a task for every number, fixed by the seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np

from lme.config.presets import load_settings
from lme.errors import InputError, argument_error, require
from lme.robots import Footprint, Lidar, Robot
from lme.worlds.barn import Barn
from lme.worlds.barn.map_set import FIRST_FRESH
from lme.worlds.building import Buildings
from lme.worlds.check import check_task
from lme.worlds.dynabarn import DIFFICULTIES, Dynabarn
from lme.worlds.indoor import Indoor
from lme.worlds.indoor.map_set import KINDS
from lme.worlds.rules import MOST_WORLDS, check_chosen, fair_limit
from lme.worlds.sampling import FreeSpace
from lme.worlds.traps import Traps
from lme.worlds.world import DrawnTask, FloorPlan, Task

BUILDINGS, STAND_IN = "buildings", "floor_plans"  # real maps; generated ones, where none are given
STATIC, DYNABARN = "static", "dynabarn"

_GRID_M = 0.05  # between the points at which a BARN world's passages are checked
_MIN_DISTANCE_M = 8.0  # least distance from start to goal in a building, as in conf/map/building.yaml
# Around a BARN world: the walls of its start area, its grid, and the open space at the goal
_BARN_OUTLINE = np.array([[-4.5, 0.0], [0.0, 0.0], [0.0, 14.0], [-4.5, 14.0]])
DISTURBANCES = ("latency", "slip", "scan_noise")  # keys of every simulator
_MAY_BE_ZERO = (*DISTURBANCES, "blind_arc", "range_min")
NAME = "cold_trial"
ROBOT = "drawn"  # the name of every robot
ATTEMPTS = 100  # robots drawn for a world, before it counts as too narrow for the ranges


def draw_task(
    family: str, *, seed: int, choice: int, radius: float, margin: float, paths: Sequence[str] = ()
) -> Task:
    """Build the task of a family.

    seed: seed of the world. choice: a number that selects a kind or a building. radius: radius of the disc that must
    have a path [m]. margin: additional free space around start and goal [m]. paths: ROS maps of buildings. Raises
    InputError if the world has no path for the disc.
    """
    room = {"radius": radius, "margin": margin}
    if family == "barn":  # the width of its passages is not chosen, so they may be too narrow
        number = FIRST_FRESH + choice
        barn = Barn(load_settings("map/barn", subset="fresh", fresh_seed=seed, worlds=[number]))
        task = barn.task(number)
        space = FreeSpace(FloorPlan(task.world, _BARN_OUTLINE), _GRID_M, radius, margin)
        length = space.checked_length(f"map barn, world {number}", task.start, task.goal)
        return replace(task, shortest_path_length=length)
    if family == "indoor":
        kind = list(KINDS)[choice % len(KINDS)]
        return Indoor(load_settings("map/indoor", kind=kind, building_seed=seed, **room)).task(0)
    if family == STAND_IN:
        plan = {"kind": "floor_plan", "building_seed": seed, "min_distance": _MIN_DISTANCE_M}
        return Indoor(load_settings("map/indoor", **plan, **room)).task(0)
    if family == BUILDINGS:
        drawn = {"configurations": 1, "sample_seed": seed, "min_distance": _MIN_DISTANCE_M}
        maps = Buildings(load_settings("map/building", paths=list(paths), **drawn, **room))
        return maps.task(choice % len(maps.numbers))
    if family == "traps":
        trap = load_settings("map/traps", kind="mixed", starts=1, start_seed=seed, radius=radius)
        return Traps(trap).task(0)
    difficulty = list(DIFFICULTIES)[choice % len(DIFFICULTIES)]  # the arena is wide enough for all footprints
    return Dynabarn(load_settings("map/dynabarn", difficulty=difficulty, motion_seed=seed)).task(0)


@dataclass(slots=True)
class TrialRanges:
    """[lowest, highest] of each value, drawn anew for every episode. The names of the robot's limits are `Robot`'s."""

    size: list[float]
    v_max: list[float]
    omega_max: list[float]
    alpha_v: list[float]
    alpha_omega: list[float]
    control_rate: list[float]
    num_beams: list[float]
    range_min: list[float]
    range_max: list[float]
    mount: list[float]
    blind_arc: list[float]
    latency: list[float]
    slip: list[float]
    scan_noise: list[float]

    def __post_init__(self) -> None:
        for entry in fields(self):
            self._check(entry.name, getattr(self, entry.name))
        require("num_beams[0]", self.num_beams[0], above=1)
        require("blind_arc[1]", self.blind_arc[1], at_most=1.9 * math.pi)
        require("range_max[0]", self.range_max[0], above=self.range_min[1])

    def _check(self, key: str, bounds: list[float]) -> None:
        if len(bounds) != 2 or not bounds[0] <= bounds[1]:
            raise argument_error(f"{key} is {list(bounds)}: must be [lowest, highest]")
        low, high = f"{key}[0]", f"{key}[1]"
        if key == "mount":  # inside the footprint
            require(low, bounds[0], at_least=-1.0)
            require(high, bounds[1], at_most=1.0)
        elif key in _MAY_BE_ZERO:
            require(low, bounds[0], at_least=0.0)
        else:
            require(low, bounds[0], above=0.0)
        require(high, bounds[1])


def drawn_robot(name: str, ranges: TrialRanges, rng: np.random.Generator) -> Robot:
    """Draw a robot with limits and a lidar: equally often a disc and a rectangle, which is no wider than long."""

    def draw(key: str) -> float:
        return float(rng.uniform(*getattr(ranges, key)))

    width, length = sorted((draw("size"), draw("size")))
    disc = rng.random() < 0.5
    footprint = Footprint(radius=length / 2) if disc else Footprint(length=length, width=width)
    return Robot(
        name=name,
        footprint=footprint,
        v_max=draw("v_max"),
        omega_max=draw("omega_max"),
        alpha_v=draw("alpha_v"),
        alpha_omega=draw("alpha_omega"),
        control_rate=draw("control_rate"),
        lidar=Lidar(
            num_beams=round(draw("num_beams")),
            fov=2 * math.pi - draw("blind_arc"),
            range_min=draw("range_min"),
            range_max=draw("range_max"),
            x=draw("mount") * length / 2,
            y=draw("mount") * (length if disc else width) / 2,
        ),
    )


def columns_of(robot: Robot, disturbances: dict[str, float]) -> dict[str, float | str]:
    """Return the drawn values by the names that they have in the records after `world_`."""
    shape, lidar = robot.footprint, robot.lidar
    disc = shape.radius is not None
    low, high = shape.outline().min(axis=0), shape.outline().max(axis=0)
    length, width = (high - low).tolist()
    return {
        "footprint": "disc" if disc else "rectangle",
        "length_m": length,
        "width_m": width,
        "v_max": robot.v_max,
        "omega_max": robot.omega_max,
        "alpha_v": robot.alpha_v,
        "alpha_omega": robot.alpha_omega,
        "control_rate_hz": robot.control_rate,
        "num_beams": float(lidar.num_beams),
        "range_min_m": lidar.range_min,
        "range_max_m": lidar.range_max,
        "blind_arc_rad": 2 * math.pi - lidar.fov,
        "lidar_x_m": lidar.x,
        "lidar_y_m": lidar.y,
        "latency_s": disturbances["latency"],
        "slip": disturbances["slip"],
        "scan_noise_m": disturbances["scan_noise"],
    }


@dataclass(slots=True)
class ColdTrialConfig:
    """Keys of `conf/map/_cold_trial.yaml`."""

    subset: str
    trial_seed: int
    count: int
    worlds: list[int] | None
    paths: list[str] | None
    passage_margin: float
    start_margin: float
    time_factor: float
    least_time: float
    ranges: TrialRanges

    def __post_init__(self) -> None:
        if self.subset not in (STATIC, DYNABARN):
            raise argument_error(f"subset is {self.subset!r}: must be {STATIC} or {DYNABARN}")
        require("trial_seed", self.trial_seed, at_least=0)
        require("count", self.count, at_least=1, at_most=MOST_WORLDS)
        require("passage_margin", self.passage_margin, at_least=0.0)
        require("start_margin", self.start_margin, at_least=0.0)
        require("time_factor", self.time_factor, at_least=1.0)
        require("least_time", self.least_time, above=0.0)
        worlds = self.worlds
        if worlds is not None and not (worlds and set(worlds) <= set(range(self.count))):
            raise argument_error(
                f"worlds is {list(worlds)}: must be numbers from 0 to {self.count - 1}, at least one, or null"
            )
        if self.paths is not None:  # they must exist
            Buildings(load_settings("map/building", paths=list(self.paths), configurations=1))


class ColdTrial:
    """Episodes by number. Number k does not depend on which others are chosen, nor on the system.

    The families take turns, so that consecutive numbers have about as many of each.
    """

    Config = ColdTrialConfig
    name = NAME

    def __init__(self, config: ColdTrialConfig) -> None:
        self.config = config
        buildings = BUILDINGS if config.paths else STAND_IN
        static = ("barn", "indoor", buildings, "traps")
        self._families = (DYNABARN,) if config.subset == DYNABARN else static
        self.numbers = tuple(range(config.count) if config.worlds is None else config.worlds)
        self._cached: Callable[[int], DrawnTask] = lru_cache(maxsize=8)(self._draw)

    def task(self, number: int) -> Task:
        """Build the task of episode `number`, for its own robot. Raises InputError as `drawn` does."""
        return self.drawn(number).task

    def drawn(self, number: int) -> DrawnTask:
        """Draw robot, disturbances and task of episode `number`.

        Raises InputError for a number that was not chosen, and if no robot of the ranges fits into the world.
        """
        check_chosen(number, self.numbers, "episode", NAME)
        return self._cached(number)

    def _draw(self, number: int) -> DrawnTask:
        """Draw the world and the disturbances first, then robots until one fits into the world."""
        config = self.config
        rng = np.random.default_rng([config.trial_seed, number])
        family = self._families[number % len(self._families)]
        seed, choice = rng.integers(2**31, size=2).tolist()
        disturbances = {key: float(rng.uniform(*getattr(config.ranges, key))) for key in DISTURBANCES}
        for redrawn in range(ATTEMPTS):
            robot = drawn_robot(ROBOT, config.ranges, rng)
            try:
                task = self._task(number, family, seed, choice, robot)
            except InputError as error:
                refusal = error
                continue
            columns = {
                "family": family,
                **columns_of(robot, disturbances),
                "robots_redrawn": float(redrawn),
            }
            return DrawnTask(task, robot, disturbances, columns)
        raise InputError(
            f"map {NAME}, episode {number} ({family}): none of {ATTEMPTS} robots of ranges fits ({refusal})"
        )

    def _task(self, number: int, family: str, seed: int, choice: int, robot: Robot) -> Task:
        """The family's task with the trial's rules. Raises InputError if the robot does not fit into the world."""
        config, shape = self.config, robot.footprint
        radius = shape.inscribed_radius + config.passage_margin
        margin = max(0.0, shape.circumscribed_radius + config.start_margin - radius)
        paths = config.paths or ()
        task = draw_task(family, seed=seed, choice=choice, radius=radius, margin=margin, paths=paths)
        check_task(task, robot)
        fastest = task.shortest_path_length / robot.v_max
        return replace(
            task,
            map_name=NAME,
            number=number,
            robot=ROBOT,
            time_limit=fair_limit(fastest, config.time_factor, config.least_time),
            optimal_time=fastest,
        )
