"""Checks that a task is possible, before the first episode, so that a bad map is an error, not a result."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from lme.errors import InputError
from lme.robots import Footprint, Robot
from lme.types import Floats, Pose
from lme.worlds.world import Task, World


def check_task(task: Task, robot: Robot) -> None:
    """Raise InputError if the robot collides at the start, or the goal is in an obstacle or too near one."""
    where = f"map {task.map_name}, world {task.number}"
    if footprint_clearance(task.world, robot.hull, task.start) <= 0.0:
        raise InputError(
            f"{where}: robot {robot.name} is in collision at the start {_place(task.start)}: "
            "must be free (move map.start, or choose another world)"
        )
    clearance = point_clearance(task.world, task.goal)
    if clearance <= 0.0:
        raise InputError(
            f"{where}: the goal {_place(task.goal)} lies inside an obstacle: "
            "must be free (move map.goal, or choose another world)"
        )
    if clearance < robot.hull.r_min:
        raise InputError(
            f"{where}: the goal {_place(task.goal)} is {clearance:.3g} m from an obstacle: must be at least "
            f"{robot.hull.r_min:.3g} m, the inner radius of robot {robot.name}"
        )


def point_clearance(world: World, point: Floats) -> float:
    """Distance from a point (2,) to the nearest static obstacle [m]; ≤ 0 inside one, inf if there is none."""
    if any(_inside_polygon(polygon, point) for polygon in world.polygons):
        return 0.0
    to_circles = np.hypot(*(world.circles[:, :2] - point).T) - world.circles[:, 2]
    to_edges = _point_segments(point, world.edges)
    return float(min(to_circles.min(initial=math.inf), to_edges.min(initial=math.inf)))


def footprint_clearance(world: World, footprint: Footprint, pose: Pose) -> float:
    """Distance from a footprint at a pose to the nearest static obstacle [m]; ≤ 0 if they touch."""
    half_length, half_width, rounding = footprint.box
    half = np.array([half_length, half_width])
    centre = np.array([pose.x, pose.y])
    if any(_inside_polygon(polygon, centre) for polygon in world.polygons):
        return 0.0
    circles = _to_frame(world.circles[:, :2], pose)
    edges = _to_frame(world.edges.reshape(-1, 2), pose).reshape(-1, 4)
    to_circles = _points_box(circles, half) - world.circles[:, 2]
    to_edges = np.array([_segment_box(edge, half) for edge in edges])
    return float(min(to_circles.min(initial=math.inf), to_edges.min(initial=math.inf))) - rounding


def _place(numbers: Iterable[float]) -> str:
    return "(" + ", ".join(f"{number:g}" for number in numbers) + ")"


def _to_frame(points: Floats, pose: Pose) -> Floats:
    """The points (P, 2) in the frame of a pose."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.asarray((points - np.array([pose.x, pose.y])) @ np.array([[cos, -sin], [sin, cos]]))


def _points_box(points: Floats, half: Floats) -> Floats:
    """(P,) distances to the box |x| ≤ half[0], |y| ≤ half[1]."""
    return np.asarray(np.hypot(*np.maximum(np.abs(points) - half, 0.0).T))


def _segment_box(edge: Floats, half: Floats) -> float:
    """Distance from a segment (4,) to the box: 0 if they meet, else that of an end or of a corner."""
    if _meets_box(edge, half):
        return 0.0
    to_ends = _points_box(edge.reshape(2, 2), half).min()
    corners = half * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    return float(min(to_ends, *(_point_segments(corner, edge[None])[0] for corner in corners)))


def _meets_box(edge: Floats, half: Floats) -> bool:
    """Whether a part of the segment is left after clipping it to the box's two slabs."""
    first, last = 0.0, 1.0
    for origin, step, bound in zip(edge[:2], edge[2:] - edge[:2], half, strict=True):
        if step == 0.0:
            if abs(origin) > bound:
                return False
            continue
        enter, leave = sorted(((-bound - origin) / step, (bound - origin) / step))
        first, last = max(first, enter), min(last, leave)
    return first <= last


def _point_segments(point: Floats, segments: Floats) -> Floats:
    """(S,) distances from a point (2,) to segments (S, 4)."""
    start, along = segments[:, :2], segments[:, 2:] - segments[:, :2]
    length2 = (along**2).sum(axis=1)
    dot = ((point - start) * along).sum(axis=1)
    share = np.clip(np.divide(dot, length2, out=np.zeros_like(dot), where=length2 > 0), 0.0, 1.0)
    return np.asarray(np.hypot(*(start + share[:, None] * along - point).T))


def _inside_polygon(polygon: Floats, point: Floats) -> bool:
    """Whether a point (2,) lies in a polygon (V, 2), by the even–odd rule."""
    (x0, y0), (x1, y1) = polygon.T, np.roll(polygon, -1, axis=0).T
    crosses = (y0 > point[1]) != (y1 > point[1])
    rise = np.where(crosses, y1 - y0, 1.0)
    at = x0 + (point[1] - y0) * (x1 - x0) / rise
    return bool((crosses & (point[0] < at)).sum() % 2)
