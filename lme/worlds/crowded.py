"""People in any map set: they walk about where a person has room, among whatever else the world holds."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from lme.errors import InputError, argument_error, config_key, require
from lme.inputs import plausibility
from lme.types import Floats
from lme.worlds.movers import MOTIONS, SCRIPTED, Mover
from lme.worlds.sampling import FreeSpace
from lme.worlds.world import FloorPlan, MapSet, Task

PLACES = 3  # number of places that a person walks to in turn
PLACES_TRIED = 200  # for the first place of a person, before the floor counts as full

_GRID = 0.1  # [m] between the points of the ways that people take
_MARGIN = 0.1  # [m] more than a person's radius: free space around the places that they walk to
_BORDER = 0.5  # [m] around start and goal where nothing stands: people do not plan to walk further out
_GAP = 0.1  # [m] between two people at first
_TASKS_KEPT = 64


@dataclass
class Walking:
    """Settings that people who react share, wherever they are. Without slots, so that it can be a second base."""

    motion: str
    sees_robot: float
    walking_speed: float
    speed_spread: float
    body_radius: float

    def check(self) -> None:
        """Raise InputError for a wrong value."""
        reactive = [motion for motion in MOTIONS if motion != SCRIPTED]
        if self.motion not in reactive:
            raise argument_error(f"motion is {self.motion!r}: must be {' or '.join(reactive)}")
        require("sees_robot", self.sees_robot, at_least=0.0, at_most=1.0)
        for key in ("walking_speed", "body_radius"):
            require(key, getattr(self, key), above=0.0)
        require("speed_spread", self.speed_spread, at_least=0.0, at_most=self.walking_speed / 3.0)
        for key in ("walking_speed", "body_radius"):
            plausibility.check(config_key(key), getattr(self, key))

    def person(
        self, rng: np.random.Generator, path: Floats, repeat: str, speed: float | None = None
    ) -> Mover:
        """Draw a person on a path (P, 2) [m]. speed: instead of a drawn one [m/s]."""
        pace = self.walking_speed + self.speed_spread * float(np.clip(rng.standard_normal(), -2.0, 2.0))
        return Mover(
            path=path,
            radius=self.body_radius,
            speed=pace if speed is None else speed,
            repeat=repeat,
            motion=self.motion,
            sees_robot=bool(rng.random() < self.sees_robot),
        )


@dataclass(slots=True)
class CrowdedConfig(Walking):
    """Keys of `conf/crowd/orca.yaml`."""

    density: float
    count: int | None
    crowd_seed: int
    clear: float
    walk: float

    def __post_init__(self) -> None:
        self.check()
        require("density", self.density, above=0.0, at_most=4.0)
        if self.count is not None:
            require("count", self.count, at_least=1, at_most=1000)
        for key in ("crowd_seed", "clear", "walk"):
            require(key, getattr(self, key), at_least=0.0)


class Crowded:
    """The worlds of another map set with people in them. Its other attributes are those of that map set.

    Each person walks to `PLACES` places in turn, again and again, on shortest ways. The people of world n do not
    depend on which other worlds are chosen.
    """

    Config = CrowdedConfig

    def __init__(self, config: CrowdedConfig, base: MapSet) -> None:
        self.config = config
        self._base = base
        # `isinstance` with a protocol, such as `Named`, does not ask `__getattr__` from Python 3.12 on.
        optional = {name: getattr(base, name) for name in ("name", "way", "drawn") if hasattr(base, name)}
        self.__dict__.update(optional)
        self._built = lru_cache(maxsize=_TASKS_KEPT)(self._task)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._base, name)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the chosen worlds."""
        return self._base.numbers

    def task(self, number: int) -> Task:
        """Build world `number` of the base with people. Raises InputError if they have no room in it."""
        return self._built(number)

    def _task(self, number: int) -> Task:
        task, config = self._base.task(number), self.config
        if any(mover.walks for mover in task.world.movers):
            raise InputError(f"map {task.map_name} has people of its own: must be crowd=none")
        # The density counts people on the floor that can be reached from the robot's start.
        space = FreeSpace(_floor(task), _GRID, config.body_radius, _MARGIN)
        area = space.area(task.start)
        count = config.count or max(1, round(config.density * area))
        rng = np.random.default_rng([config.crowd_seed, number])
        spots = self._spots(task, space, count, rng)
        people = tuple(config.person(rng, self._round(rng, space, spot), "cycle") for spot in spots)
        world = replace(task.world, movers=(*task.world.movers, *people))
        measures = {**task.measures, "people": float(count), "people_per_m2": count / area}
        return replace(task, world=world, measures=measures)

    def _spots(self, task: Task, space: FreeSpace, count: int, rng: np.random.Generator) -> list[Floats]:
        """Draw the first places (2,) of the people [m], apart from each other and from the robot's start."""
        start, config = np.array(task.start[:2]), self.config
        spots: list[Floats] = []
        spacing = 2 * config.body_radius + _GAP
        for _ in range(count * PLACES_TRIED):
            spot = self._partner(task, space, start, rng)
            if math.dist(spot, start) >= config.clear and all(
                math.dist(spot, earlier) >= spacing for earlier in spots
            ):
                spots.append(spot)
            if len(spots) == count:
                return spots
        raise self._full(task, count)

    def _partner(self, task: Task, space: FreeSpace, spot: Floats, rng: np.random.Generator) -> Floats:
        try:
            return space.draw_partner(rng, spot, 0.0)
        except InputError as error:
            raise self._full(task, self.config.count or 1) from error

    def _full(self, task: Task, count: int) -> InputError:
        config = self.config
        return InputError(
            f"map {task.map_name}, world {task.number} has no room for {count} people of radius "
            f"{config.body_radius:g} m: must be a lower density, count or clear, or another map"
        )

    def _round(self, rng: np.random.Generator, space: FreeSpace, spot: Floats) -> Floats:
        """Draw a round trip (P, 2) from a place to others [m], at least `walk` apart where there is room for that."""
        stops = [spot]
        for _ in range(PLACES - 1):
            draws = [space.draw_partner(rng, stops[-1], 0.0) for _ in range(PLACES_TRIED // 10)]
            distant = [stop for stop in draws if math.dist(stop, stops[-1]) >= self.config.walk]
            stops.append(distant[0] if distant else max(draws, key=lambda stop: math.dist(stop, stops[-1])))
        legs = [space.way(begin, end) for begin, end in zip(stops, [*stops[1:], spot], strict=True)]
        return np.vstack([leg[:-1] for leg in legs])


def _floor(task: Task) -> FloorPlan:
    """Floor plan of the world: the box around its static obstacles, its start and its goal."""
    circles, ends = task.world.circles, task.world.edges.reshape(-1, 2)
    centres, radii = circles[:, :2], circles[:, 2:]
    endpoints = np.array([task.start[:2], task.goal])
    points = np.vstack([centres - radii, centres + radii, ends, endpoints - _BORDER, endpoints + _BORDER])
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return FloorPlan(task.world, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]))
