"""The user's drawing: a task of a map set without the erased parts and with the added items."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np

from lme.errors import InputError
from lme.types import Floats, Pose
from lme.worlds.movers import Mover, mover_of
from lme.worlds.shapes import SHAPES, floor_plan
from lme.worlds.world import Task, World

MOVERS = "movers"
KINDS = ("walls", "boxes", "circles", "polygons", MOVERS)  # lists of a shape file that the page draws in
MOST_ITEMS = 2000  # most drawn items
MOST_MOVERS = 200  # most movers among them
MOST_POINTS = 1000  # of an item: the check of self-crossing takes quadratic time
MOST_POINTS_IN_ALL = 5000
FARTHEST = 1000.0  # [m] from the origin

_ANYWHERE = [-FARTHEST, -FARTHEST, FARTHEST, FARTHEST]
_OUTLINE_SIDES = 4  # floor_plan's own wall along the bounds

Entry = Mapping[str, Any]  # of a shape file, such as {"centre": [1, 2], "radius": 0.3}


@dataclass(frozen=True, slots=True)
class Item:
    """A drawn item. kind: the list of a shape file that `entry` belongs to."""

    kind: str
    entry: Entry


@dataclass(frozen=True, slots=True)
class Sketch:
    """A world, a start and a goal.

    base: the task as opened; its parts are named c0, c1, … (circles), s0 (segments), p0 (polygons) and m0 (movers).
    erased: names of parts that were removed. items: what was added, by name. goal: x, y [m].
    """

    base: Task
    start: Pose
    goal: tuple[float, float]
    erased: frozenset[str] = frozenset()
    items: Mapping[str, Item] = field(default_factory=dict)

    @classmethod
    def of(cls, task: Task) -> Sketch:
        """Return the untouched sketch of a task."""
        return cls(task, Pose(*map(float, task.start)), _point(task.goal))

    def put(self, name: str, item: Item) -> Sketch:
        """Return a sketch with an item that replaces any item or part of the base of its name. Raises InputError."""
        if name not in self.items and len(self.items) >= MOST_ITEMS:
            raise InputError(f"the drawing has {MOST_ITEMS} items: must not be more; erase some first")
        other_items = [drawn_item for key, drawn_item in self.items.items() if key != name]
        if (
            item.kind == MOVERS
            and sum(drawn_item.kind == MOVERS for drawn_item in other_items) >= MOST_MOVERS
        ):
            raise InputError(f"the drawing has {MOST_MOVERS} movers: must not be more; erase some first")
        points = sum(map(_num_points, other_items)) + _num_points(item)
        if points > MOST_POINTS_IN_ALL:
            raise InputError(
                f"the drawing has {points} points: must be at most {MOST_POINTS_IN_ALL}; erase some items first"
            )
        _world_of({name: item})  # raises InputError for a wrong item
        erased = self.erased | {name} if name in set(self._base_parts()) else self.erased
        return replace(self, items={**self.items, name: item}, erased=erased)

    def erase(self, name: str) -> Sketch:
        """Return a sketch without an item or a part of the base. Raises InputError for an unknown name."""
        if name in self.items:
            return replace(self, items={key: item for key, item in self.items.items() if key != name})
        if name in self.erased or name not in set(self._base_parts()):
            raise InputError(f"{name}: there is nothing of this name in the world")
        return replace(self, erased=self.erased | {name})

    def clear(self) -> Sketch:
        """Return a sketch without any drawn items and with all erased parts restored; start and goal stay."""
        return replace(self, erased=frozenset(), items={})

    @property
    def touched(self) -> bool:
        """Return whether the sketch differs from its base."""
        return self.task() is not self.base

    def task(self) -> Task:
        """Return the sketch as a task; the base itself if it is untouched."""
        # The path length and the times of the base no longer hold once anything is changed.
        is_unmoved = self.start == Pose(*map(float, self.base.start)) and self.goal == _point(self.base.goal)
        if is_unmoved and not self.erased and not self.items:
            return self.base
        return replace(
            self.base,
            world=self.world() if self.erased or self.items else self.base.world,
            start=self.start,
            goal=np.array(self.goal),
            shortest_path_length=math.nan,
            optimal_time=math.nan,
            measures={},
        )

    def world(self) -> World:
        """Return the world of base and drawing together, the base's parts first."""
        base, drawn_world = self.base.world, _world_of(self.items)
        return World(
            circles=np.vstack([base.circles[self._unerased("c", len(base.circles))], drawn_world.circles]),
            segments=np.vstack(
                [base.segments[self._unerased("s", len(base.segments))], drawn_world.segments]
            ),
            polygons=(
                *(base.polygons[i] for i in self._unerased("p", len(base.polygons))),
                *drawn_world.polygons,
            ),
            movers=(*(base.movers[i] for i in self._unerased("m", len(base.movers))), *drawn_world.movers),
        )

    def parts(self) -> Iterator[tuple[str, Item]]:
        """Yield everything in the world by name: the base's parts as items of a shape file, then the drawn items."""
        base = self.base.world
        for i in self._unerased("c", len(base.circles)):
            x, y, radius = base.circles[i].tolist()
            yield f"c{i}", Item("circles", {"centre": [x, y], "radius": radius})
        for i in self._unerased("s", len(base.segments)):
            yield f"s{i}", Item("walls", {"points": base.segments[i].reshape(2, 2).tolist()})
        for i in self._unerased("p", len(base.polygons)):
            yield f"p{i}", Item("polygons", {"points": base.polygons[i].tolist()})
        for i in self._unerased("m", len(base.movers)):
            yield f"m{i}", Item(MOVERS, _entry_of(base.movers[i]))
        yield from self.items.items()

    def _base_parts(self) -> Iterator[str]:
        world = self.base.world
        counts = (len(world.circles), len(world.segments), len(world.polygons), len(world.movers))
        for letter, count in zip("cspm", counts, strict=True):
            yield from (f"{letter}{i}" for i in range(count))

    def _unerased(self, letter: str, count: int) -> list[int]:
        if not self.erased:
            return list(range(count))
        return [i for i in range(count) if f"{letter}{i}" not in self.erased]


def item_of(kind: str, entry: Entry) -> Item:
    """Return a checked item. Raises InputError for one that a shape file could not hold."""
    if kind not in KINDS:
        raise InputError(f"kind is {kind!r:.40}: must be one of {', '.join(KINDS)}")
    item = Item(kind, entry)
    if _num_points(item) > MOST_POINTS:
        raise InputError(f"{kind}: has {_num_points(item)} points: must have at most {MOST_POINTS}")
    _world_of({"new": item})
    return item


def _num_points(item: Item) -> int:
    """Return the total length of the lists of points in an entry, valid or not."""
    lists = (item.entry.get(key) for key in ("points", "path", "outline"))
    return sum(len(points) for points in lists if isinstance(points, list))


def _world_of(items: Mapping[str, Item]) -> World:
    """Return a world that consists of the items alone."""
    movers = tuple(
        _mover(name, json.dumps(item.entry)) for name, item in items.items() if item.kind == MOVERS
    )
    shapes = {kind: [item.entry for item in items.values() if item.kind == kind] for kind in SHAPES}
    plan = floor_plan("the drawing", {"bounds": _ANYWHERE, **shapes})
    return replace(plan.world, segments=plan.world.segments[_OUTLINE_SIDES:], movers=movers)


@lru_cache(maxsize=500)
def _mover(name: str, entry: str) -> Mover:
    """Return the mover of an entry in JSON; the same object for the same name, so that simulators recognise it."""
    return mover_of("the drawing, movers", json.loads(entry))


def _entry_of(mover: Mover) -> Entry:
    """Return the entry of a scene file that describes a mover."""
    # Headings are written only if the mover has any.
    poses = [[x, y, math.degrees(yaw)] for x, y, yaw in mover.path.tolist()]
    turns = any(pose[2] for pose in poses)
    entry: dict[str, Any] = {"path": poses if turns else [pose[:2] for pose in poses]}
    if mover.outline is not None:
        entry["outline"] = mover.outline.tolist()
    entry["turn_rate_deg"] = math.degrees(mover.turn_rate)
    for key in (
        "radius",
        "speed",
        "start_after",
        "starts_within",
        "waits_within",
        "repeat",
        "motion",
        "sees_robot",
    ):
        value = getattr(mover, key)
        if value is not None:
            entry[key] = value
    if mover.trigger is not None:
        entry["trigger"] = list(mover.trigger)
    return entry


def _point(position: Floats) -> tuple[float, float]:
    return float(position[0]), float(position[1])
