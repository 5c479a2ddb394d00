"""Scenes: a map, its movers, a start and a goal, as readable YAML.

A scene file is a shape file (`lme.worlds.shapes`) with three more keys:

    start: [1, 3]  # x, y [m]; the robot faces the goal
    goal: [7, 3]
    movers:
      - {radius: 0.25, path: [[3, 5], [3, 3]], speed: 1.0, starts_within: 1.5, trigger: [3, 3]}

A mover has the keys of `lme.worlds.movers.Mover`; angles are in degrees: poses of `path` [x, y, yaw_deg],
`turn_rate_deg`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from lme.errors import InputError, argument_error
from lme.geometry.frames import to_world
from lme.inputs.guarded_file import read_yaml
from lme.inputs.resources import resource_dir
from lme.inputs.yaml_entry import Entry
from lme.types import Floats, Pose
from lme.worlds.check import point_clearance
from lme.worlds.movers import Mover, mover_of
from lme.worlds.rules import map_path
from lme.worlds.sampling import FreeSpace
from lme.worlds.shapes import SHAPES, floor_plan
from lme.worlds.starts import STAGE_RADIUS, Starts, StartsConfig
from lme.worlds.world import FloorPlan, Task, World

FOLDER = "scenes"  # of maps/


@dataclass(slots=True)
class SceneConfig(StartsConfig):
    """Keys of `conf/map/_scene.yaml`."""

    name: str | None
    path: str | None


@dataclass(frozen=True, slots=True)
class Drawing:
    """Content of a scene file. start, goal: (2,) [m]."""

    plan: FloorPlan
    start: Floats
    goal: Floats


class Scene(Starts):
    """One scene with a different start for every number."""

    Config = SceneConfig

    def __init__(self, config: SceneConfig) -> None:
        """Read the scene and its free space. Raises InputError for a missing or wrong file."""
        path = _path(config)
        self._radius = STAGE_RADIUS if config.radius is None else config.radius
        drawing, space = _surveyed(path, path.stat().st_mtime_ns, self._radius, config.grid)
        site = drawing.plan.world, space
        super().__init__(config.name or path.stem, config, lambda number: site, drawing.start, drawing.goal)

    @property
    def name(self) -> str:
        """Name of this scene in the records."""
        return self._name

    def task(self, number: int) -> Task:
        """Build the task as `Starts.task` does. Also raises InputError if a mover stands at the start."""
        task = super().task(number)
        for index, mover in enumerate(task.world.movers):
            if _distance(mover, task.start) <= self._radius:
                raise InputError(
                    f"map {task.map_name}, start {number}: movers[{index}] overlaps the disc around the robot, "
                    "of the map set's radius: must start further away"
                )
        return task


def read_scene(path: Path) -> Drawing:
    """Read a scene file. Raises InputError as `lme.worlds.shapes.floor_plan` does, and for invalid movers."""
    content = read_yaml(path)
    entry = Entry(str(path), content, ["bounds", "start", "goal"], [*SHAPES, "movers"])
    shapes = {key: entry.value(key) for key in ("bounds", *SHAPES) if entry.value(key) is not None}
    plan = floor_plan(str(path), shapes)
    movers = tuple(mover_of(*item) for item in entry.entries("movers"))
    start, goal = (np.array(entry.numbers(key, "x, y", 2)) for key in ("start", "goal"))
    return Drawing(replace(plan, world=replace(plan.world, movers=movers)), start, goal)


def _distance(mover: Mover, start: Pose) -> float:
    """Distance from a start to a mover that has not begun to move [m]; ≤ 0 inside it."""
    pose = Pose(*mover.path[0].tolist())
    if mover.outline is None:
        shape = World(circles=np.array([[pose.x, pose.y, mover.radius]]))
    else:
        shape = World(polygons=(to_world(mover.outline, pose),))
    return point_clearance(shape, np.array(start[:2]))


@lru_cache(maxsize=8)
def _surveyed(
    path: Path,
    _modified: int,  # part of the key, so that an edited file is read again
    radius: float,
    grid: float,
) -> tuple[Drawing, FreeSpace]:
    """The scene and its free space, computed once per process. Movers do not block the shortest path."""
    drawing = read_scene(path)
    return drawing, FreeSpace(drawing.plan, grid, radius, margin=0.0)


def _path(config: SceneConfig) -> Path:
    if config.path is not None:
        return map_path(config.path, "a scene file (maps/README.md)")
    shipped = {path.stem: path for path in sorted((resource_dir("maps") / FOLDER).glob("*.yaml"))}
    if config.name not in shipped:
        raise argument_error(f"name is {config.name!r}: must be one of {', '.join(shipped)}, or give path")
    return shipped[config.name]
