"""Scenes with people, after Francis et al. 2025: crossing, overtaking, doorway, corridor, group and queue.

Francis et al., "Principles and Guidelines for Evaluating Social Robot Navigation Algorithms", DOI 10.1145/3700599, name
the situations; measures, numbers and speeds are ours. The robot always drives in the direction of x. A world is drawn
from its number: the robot's start, and where people are and how fast they walk.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lme.errors import InputError, argument_error, require
from lme.types import Floats, Pose
from lme.worlds.crowded import Walking
from lme.worlds.movers import Mover
from lme.worlds.rules import MOST_WORLDS, PacedRules, check_chosen
from lme.worlds.sampling import FreeSpace
from lme.worlds.starts import STAGE_RADIUS
from lme.worlds.world import FloorPlan, Task, World, enclosed

GAP = 0.2  # [m] least gap between two people at first
CLEAR = 1.5  # [m] least distance of people from the robot's start at first
TRIES = 200  # for the place of a person, before the scene counts as full

_GRID = 0.05  # [m] between the points of shortest paths
_ASIDE, _TURN = 0.3, 0.2  # [m], [rad] greatest offset and turn of the robot's start
_DOOR = 1.1  # [m] wide
_SLOW = (0.4, 0.7)  # [m/s] of people who are overtaken
_CIRCLE, _IN_GROUP = 0.75, 4  # [m] radius of a group that talks, and its number
_PITCH, _IN_QUEUE = 0.85, 6  # [m] from one to the next in a queue, and the greatest number in it


class Encounter(NamedTuple):
    """Composition of a kind of scene.

    size: size of the floor, from (0, 0) [m]. walls: segments (S, 4) on it [m]. ends: x of the robot's start and of
    its goal, in the middle of y [m]. people: their number if no density is given. paths: yields a path (P, 2) for one
    more person; a place that is not free is skipped. speeds: (least, greatest) [m/s] of people who do not walk as
    others do.
    """

    size: tuple[float, float]
    walls: Floats
    ends: tuple[float, float]
    people: int
    paths: Callable[[np.random.Generator], Iterator[Floats]]
    repeat: str
    speeds: tuple[float, float] | None = None


@dataclass(slots=True)
class SocialConfig(PacedRules, Walking):
    """Keys of `conf/map/social.yaml`."""

    kind: str
    count: int
    scene_seed: int
    density: float | None
    radius: float | None

    def __post_init__(self) -> None:
        PacedRules.__post_init__(self)  # super() fails in a dataclass with slots
        self.check()
        if self.kind not in SCENES:
            raise argument_error(f"kind is {self.kind!r}: must be one of {', '.join(SCENES)}")
        require("count", self.count, at_least=1, at_most=MOST_WORLDS)
        require("scene_seed", self.scene_seed, at_least=0)
        if self.density is not None:
            require("density", self.density, above=0.0, at_most=4.0)
        if self.radius is not None:
            require("radius", self.radius, above=0.0, at_most=0.5)


class Social:
    """Scenes of one kind by number. World n does not depend on which others are chosen."""

    Config = SocialConfig

    def __init__(self, config: SocialConfig) -> None:
        self.config = config
        self.name = f"social_{config.kind}"
        self.numbers = config.numbers(range(config.count))
        self._radius = STAGE_RADIUS if config.radius is None else config.radius

    def task(self, number: int) -> Task:
        """Build world `number`. Raises InputError for one that was not chosen, or if people have no room in it."""
        check_chosen(number, self.numbers, "world", self.name)
        config, scene = self.config, SCENES[self.config.kind]
        stream = [config.scene_seed, list(SCENES).index(config.kind), number]
        rng = np.random.default_rng(stream)
        middle = scene.size[1] / 2
        offset, turn = rng.uniform(-1.0, 1.0, 2).tolist()
        start, goal = (
            Pose(scene.ends[0], middle + offset * _ASIDE, turn * _TURN),
            np.array([scene.ends[1], middle]),
        )
        plan, space = _floor(config.kind, self._radius)
        people = self._people(rng, scene, start, number)
        subject = f"map {self.name}, world {number}"
        return config.task(
            self.name,
            number,
            World(segments=plan.world.segments, movers=people),
            start,
            goal,
            length=space.checked_length(subject, start, goal),
            speed=config.pace,
            measures={"people": float(len(people)), "people_per_m2": len(people) / math.prod(scene.size)},
        )

    def _people(
        self, rng: np.random.Generator, scene: Encounter, start: Pose, number: int
    ) -> tuple[Mover, ...]:
        density, area = self.config.density, math.prod(scene.size)
        count = scene.people if density is None else max(1, round(density * area))
        people: list[Mover] = []
        spacing = 2 * self.config.body_radius + GAP
        for path in itertools.islice(scene.paths(rng), count * TRIES):
            first_points = (person.path[0, :2] for person in people)
            is_clear = math.dist(path[0], start[:2]) >= CLEAR
            if is_clear and all(math.dist(path[0], point) >= spacing for point in first_points):
                speed = None if scene.speeds is None else rng.uniform(*scene.speeds)
                people.append(self.config.person(rng, path, scene.repeat, speed))
            if len(people) == count:
                return tuple(people)
        raise InputError(
            f"map {self.name}, world {number} has no room for {count} people: must be a lower density"
        )


@lru_cache(maxsize=32)
def _floor(kind: str, radius: float) -> tuple[FloorPlan, FreeSpace]:
    """The walls of a kind of scene and the free space in it, computed once per process."""
    scene = SCENES[kind]
    (x, y) = scene.size
    outline = np.array([[0.0, 0.0], [x, 0.0], [x, y], [0.0, y]])
    plan = enclosed(outline, np.empty((0, 3)), scene.walls, ())
    return plan, FreeSpace(plan, _GRID, radius, margin=0.0)


def _crosses(rng: np.random.Generator) -> Iterator[Floats]:
    """Yield paths to and fro across the robot's way."""
    while True:
        x, y, end = rng.uniform(3.0, 9.0), rng.uniform(0.6, 7.4), rng.choice([0.6, 7.4])
        yield np.array([[x, y], [x, end], [x, 8.0 - end]])


def _goes_ahead(rng: np.random.Generator) -> Iterator[Floats]:
    """Yield paths that lead the same way as the robot's, and past its goal."""
    while True:
        x, y = rng.uniform(2.5, 12.0), rng.uniform(0.5, 2.5)
        yield np.array([[x, y], [21.4, y]])


def _comes_through(rng: np.random.Generator) -> Iterator[Floats]:
    """Yield paths to and fro between the rooms; every second person is in the goal's room at first."""
    for direction in itertools.cycle((-1, 1)):
        a, b = np.column_stack([rng.uniform([0.6, 7.4], [4.6, 11.4]), rng.uniform(0.6, 5.4, 2)])
        path = np.array([a, [5.4, 3.0], [6.6, 3.0], b, [6.6, 3.0], [5.4, 3.0]])
        yield path if direction == 1 else np.roll(path, -3, axis=0)


def _meets(rng: np.random.Generator) -> Iterator[Floats]:
    """Yield paths to and fro along the corridor, towards the robot at first."""
    while True:
        x, y = rng.uniform(5.0, 17.0), rng.uniform(0.5, 2.0)
        yield np.array([[x, y], [0.8, y], [17.2, y]])


def _talks(rng: np.random.Generator) -> Iterator[Floats]:
    """Yield places in circles of people who stand face to face."""
    while True:
        middle, first = rng.uniform([3.5, 2.5], [8.5, 5.5]), rng.uniform(0.0, 2 * math.pi)
        for angle in first + np.arange(_IN_GROUP) * (2 * math.pi / _IN_GROUP):
            yield np.array([middle + _CIRCLE * np.array([math.cos(angle), math.sin(angle)])])


def _queues(rng: np.random.Generator) -> Iterator[Floats]:
    """Yield places in a queue across the robot's way from one wall, then in further queues from either wall."""
    for x, from_above in ((6.0, True), (4.5, False), (7.5, False), (3.0, True), (9.0, True)):
        for rank in range(_IN_QUEUE):
            y = 0.6 + rank * _PITCH
            yield np.array([[x, 8.0 - y if from_above else y]]) + rng.uniform(-0.05, 0.05, 2)


_OPEN = np.empty((0, 4))
_DOORWAY = np.array([[6.0, 0.0, 6.0, 3.0 - _DOOR / 2], [6.0, 3.0 + _DOOR / 2, 6.0, 6.0]])

SCENES = {
    "crossing": Encounter((12.0, 8.0), _OPEN, (1.0, 11.0), 4, _crosses, "cycle"),
    "overtaking": Encounter((22.0, 3.0), _OPEN, (1.0, 15.0), 3, _goes_ahead, "once", _SLOW),
    "doorway": Encounter((12.0, 6.0), _DOORWAY, (1.0, 11.0), 2, _comes_through, "cycle"),
    "corridor": Encounter((18.0, 2.5), _OPEN, (1.0, 17.0), 4, _meets, "cycle"),
    "group": Encounter((12.0, 8.0), _OPEN, (1.0, 11.0), 4, _talks, "once"),
    "queue": Encounter((12.0, 8.0), _OPEN, (1.0, 11.0), 6, _queues, "once"),
}
