"""Checks that a task is possible, before the first episode, so that a bad map is an error, not a result."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from lme.errors import InputError
from lme.geometry.collision import sweep
from lme.geometry.frames import to_world
from lme.inputs import plausibility
from lme.inputs.returned import checked_array
from lme.robots import Footprint, Robot
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import Task, World


def check_task(task: Task, robot: Robot) -> None:
    """Raise InputError if the robot is not the task's or collides at the start, or an obstacle is near the goal.

    Movers count at the start where they begin, and at the goal if they never leave it.
    """
    subject = _check_numbers(task)
    if task.robot and robot.name != task.robot:
        raise InputError(
            f"{subject}: the map set draws a robot for every world, and the robot is {robot.name}: "
            "must be driven with lme eval, or be another map"
        )
    present = [mover for mover in task.world.movers if mover.times is None or mover.times[0] == 0.0]
    worlds = task.world, *_at_their_start(present)
    if min(footprint_clearance(world, robot.footprint, task.start) for world in worlds) <= 0.0:
        raise InputError(
            f"{subject}: robot {robot.name} is in collision at the start {_coordinates(task.start)}: "
            "must be free (move the start, or choose another world)"
        )
    standing = [mover for mover in task.world.movers if len(mover.path) == 1 and not mover.walks]
    clearance = min(point_clearance(world, task.goal) for world in (task.world, *_at_their_start(standing)))
    if clearance <= 0.0:
        raise InputError(
            f"{subject}: the goal {_coordinates(task.goal)} lies inside an obstacle: "
            "must be free (move the goal, or choose another world)"
        )
    if clearance < robot.footprint.inscribed_radius:
        raise InputError(
            f"{subject}: the goal {_coordinates(task.goal)} is {clearance:.3g} m from an obstacle: must be at least "
            f"{robot.footprint.inscribed_radius:.3g} m, the inner radius of robot {robot.name}"
        )


def _check_numbers(task: Task) -> str:
    """Check type and numbers of a task, which a user's own map set may give, and name its map and world for messages.

    Raises InputError.
    """
    if not isinstance(task, Task):
        raise InputError(f"the map set gives {task!r:.80} for a world: must be a lme.worlds.world.Task")
    subject, world = f"map {task.map_name}, world {task.number}", task.world
    if not isinstance(task.start, Pose):
        raise InputError(f"{subject}: the start is {task.start!r:.80}: must be an lme.Pose")
    rules = task.goal_tolerance, task.time_limit, task.clock_distance
    checked_array(task.start, (3,), f"{subject}: has a start", "(x [m], y [m], yaw [rad])")
    checked_array(task.goal, (2,), f"{subject}: has a goal", "(x [m], y [m])")
    checked_array(
        rules, (3,), f"{subject}: has rules", "(goal_tolerance [m], time_limit [s], clock_distance [m])"
    )
    circles = checked_array(world.circles, (None, 3), f"{subject}: has circles", "rows of (x, y, radius) [m]")
    if (circles[:, 2] < 0.0).any():
        raise InputError(
            f"{subject}: has the circle {_coordinates(circles[circles[:, 2].argmin()])}: "
            "must have a radius of at least 0 m"
        )
    checked_array(world.edges, (None, 4), f"{subject}: has walls", "rows of (x0, y0, x1, y1) [m]")
    plausibility.check(f"{subject}: start.yaw", task.start.yaw)
    return subject


def point_clearance(world: World, point: Floats) -> float:
    """Distance from a point (2,) to the nearest static obstacle [m]; ≤ 0 inside one, inf if there is none."""
    if _inside_any(world.polygons, point):
        return 0.0
    to_circles = np.hypot(*(world.circles[:, :2] - point).T) - world.circles[:, 2]
    to_edges = _point_segments(point, world.edges)
    return float(min(to_circles.min(initial=math.inf), to_edges.min(initial=math.inf)))


def footprint_clearance(world: World, footprint: Footprint, pose: Pose) -> float:
    """Distance from a footprint at a pose to the nearest static obstacle [m]; 0 if they touch."""
    if _inside_any(world.polygons, np.array([pose.x, pose.y])):
        return 0.0
    circles = np.ascontiguousarray(world.circles, dtype=np.float64)
    return sweep(np.array([pose], dtype=np.float64), footprint.box, circles, world.edges)[0]


def _at_their_start(movers: Sequence[Mover]) -> tuple[World, ...]:
    """Return a world with movers as static obstacles where their paths begin; none without movers."""
    if not movers:
        return ()
    discs = [(*mover.path[0, :2], mover.radius) for mover in movers if mover.outline is None]
    outlines = [(mover.outline, Pose(*mover.path[0])) for mover in movers if mover.outline is not None]
    polygons = tuple(to_world(outline, pose) for outline, pose in outlines)
    return (World(np.reshape(np.array(discs, dtype=np.float64), (-1, 3)), polygons=polygons),)


def _coordinates(numbers: Iterable[float]) -> str:
    return "(" + ", ".join(f"{number:g}" for number in numbers) + ")"


def _point_segments(point: Floats, segments: Floats) -> Floats:
    """(S,) distances from a point (2,) to segments (S, 4)."""
    # Nearest point of a segment: start + part · along, with part = (point − start) · along / |along|² in [0, 1].
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    length2 = (along**2).sum(axis=1)
    dot = ((point - start) * along).sum(axis=1)
    part = np.clip(np.divide(dot, length2, out=np.zeros_like(dot), where=length2 > 0), 0.0, 1.0)
    return np.asarray(np.hypot(*(start + part[:, None] * along - point).T))


def _inside_any(polygons: Sequence[Floats], point: Floats) -> bool:
    """Return whether a point (2,) lies in a polygon; only those whose box contains it are examined."""
    if not polygons:
        return False
    corners = np.vstack(polygons)
    firsts = np.cumsum([0, *map(len, polygons[:-1])])
    low, high = np.minimum.reduceat(corners, firsts), np.maximum.reduceat(corners, firsts)
    candidates = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
    return any(_inside_polygon(polygons[i], point) for i in candidates.tolist())


def _inside_polygon(polygon: Floats, point: Floats) -> bool:
    """Return whether a point (2,) lies in a polygon (V, 2), by the even–odd rule."""
    # Count the sides that cross the horizontal line through the point to the right of it.
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    crosses = (y0 > point[1]) != (y1 > point[1])
    rise = np.where(crosses, y1 - y0, 1.0)
    crossing_x = x0 + (point[1] - y0) * (x1 - x0) / rise
    return bool((crosses & (point[0] < crossing_x)).sum() % 2)
