"""World geometry, floor plans, and the navigation task."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from lme.grids.edge_grid import NO_EDGES, EdgeGrid, edge_grid
from lme.grids.lattice import NO_LATTICE, Lattice, lattice_of
from lme.grids.leaves import Leaves, leaves_of
from lme.robots import Robot
from lme.types import Floats, Pose
from lme.worlds.movers import Mover

MANY = 512  # number of edges from which a grid pays off, and of discs from which a search by leaf does


@dataclass(frozen=True, slots=True)
class World:
    """Obstacles in the world frame.

    circles: (C, 3) solid discs [x, y, radius] [m]. segments: (S, 4) thin walls [x0, y0, x1, y1] [m].
    polygons: solid, each (V, 2) vertices in order [m], not repeated at the end.
    movers: pedestrians and doors; all other obstacles are static.
    """

    circles: Floats = field(default_factory=lambda: np.empty((0, 3)))
    segments: Floats = field(default_factory=lambda: np.empty((0, 4)))
    polygons: tuple[Floats, ...] = ()
    movers: tuple[Mover, ...] = ()
    edges: Floats = field(init=False, repr=False)  # (E, 4) segments and sides of polygons
    grid: EdgeGrid = field(init=False, repr=False)  # of the edges; empty if they are few
    lattice: Lattice = field(init=False, repr=False)  # the same; empty if they do not lie on one
    discs: Leaves = field(init=False, repr=False)  # the circles
    walls: Leaves = field(init=False, repr=False)  # the edges

    def __post_init__(self) -> None:
        sides = [np.hstack([polygon, np.roll(polygon, -1, axis=0)]) for polygon in self.polygons]
        edges = np.ascontiguousarray(np.vstack([self.segments, *sides]), dtype=np.float64)
        object.__setattr__(self, "edges", edges)
        are_many = len(edges) >= MANY
        object.__setattr__(self, "grid", edge_grid(edges) if are_many else NO_EDGES)
        object.__setattr__(self, "lattice", lattice_of(edges) if are_many else NO_LATTICE)
        object.__setattr__(self, "discs", leaves_of(np.asarray(self.circles, dtype=np.float64)))
        object.__setattr__(self, "walls", leaves_of(edges))

    @property
    def people(self) -> tuple[Mover, ...]:
        """The movers that are discs."""
        return tuple(mover for mover in self.movers if mover.radius is not None)


@dataclass(frozen=True, slots=True)
class Task:
    """One navigation problem: a world, a start, a goal, and the rules of success.

    measures: named properties of the world, such as difficulty, that are copied into the records. robot: the name of
    the only robot that the task is for; empty for any.
    """

    map_name: str  # map set, e.g. "barn"
    number: int  # of the world within its map set
    world: World
    start: Pose
    goal: Floats  # (2,) [m]
    goal_tolerance: float  # [m]
    time_limit: float  # [s]
    clock_distance: float  # [m] the clock starts once the robot has moved this far
    shortest_path_length: float  # [m] from start to goal
    optimal_time: float  # [s] the benchmark's own optimal traversal time OT
    measures: dict[str, float] = field(default_factory=dict)
    robot: str = ""


class MapSet(Protocol):
    """A numbered collection of tasks. Each has a class here and a YAML in `conf/map/`."""

    @property
    def numbers(self) -> tuple[int, ...]:
        """The numbers of the chosen worlds."""

    def task(self, number: int) -> Task:
        """Build the task in world `number`."""


@runtime_checkable
class Named(Protocol):
    """A map set with its own name, such as a file's; in the records, others have the name of their YAML."""

    @property
    def name(self) -> str:
        """Name of this map in the records."""


@runtime_checkable
class Surveyed(Protocol):
    """A map set that knows the way whose length the optimal time counts."""

    def way(self, number: int) -> Floats:
        """(P, 2) points at which the way of world `number` turns, start and goal included [m]."""


class DrawnTask(NamedTuple):
    """A task with the robot and the disturbances that were drawn for it.

    disturbances: values by key of the simulator's config. columns: what was drawn, by name in the records, which put
    `world_` before it.
    """

    task: Task
    robot: Robot
    disturbances: Mapping[str, float]
    columns: Mapping[str, float | str]


@runtime_checkable
class DrawsRobots(Protocol):
    """A map set with another robot and other disturbances in every world."""

    def drawn(self, number: int) -> DrawnTask:
        """Draw task, robot and disturbances of world `number`; always the same."""


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """Content of a map file.

    world: the obstacles, including the closed outer wall. outline: (4, 2) corners in order [m]. start, goal: as
    `map.start` and `map.goal` of `map=file`, if the file has them.
    """

    world: World
    outline: Floats
    start: tuple[float, ...] | None = None
    goal: tuple[float, ...] | None = None

    @property
    def region(self) -> str:
        """Region of the map in words: ranges of x and y, or its corners if its sides are not parallel to the axes."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        if (np.isclose(self.outline, low) | np.isclose(self.outline, high)).all():
            return f"in x {low[0]:g} to {high[0]:g} m, y {low[1]:g} to {high[1]:g} m"
        corners = ", ".join(f"({x:g}, {y:g})" for x, y in self.outline.round(6).tolist())
        return f"within the corners {corners} m"


def enclosed(outline: Floats, circles: Floats, segments: Floats, polygons: tuple[Floats, ...]) -> FloorPlan:
    """Return the plan with these obstacles and a thin wall along its outline (4, 2) [m]."""
    wall = np.hstack([outline, np.roll(outline, -1, axis=0)])
    return FloorPlan(World(circles, np.vstack([wall, segments]), polygons), outline)
