"""A drawn world as a shape file, which `lme eval map=file map.path=FILE` drives."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import yaml

from lme.types import Floats
from runners.play.drawing import KINDS, Sketch

_BORDER = 0.5  # [m] around a world that has no outer wall
_SIDES = 4


def shape_file(drawing: Sketch, title: str) -> str:
    """Return the YAML of a drawing with its start and goal. A world without an outer wall gets one."""
    bounds, wall = _bounds(drawing)
    lines = [f"# {title}", f"bounds: {_flow(bounds)}"]
    drawn_items = [item for name, item in drawing.parts() if name not in wall]
    for kind in KINDS:
        entries = [item.entry for item in drawn_items if item.kind == kind]
        lines += [f"{kind}:"] if entries else []
        lines += [f"  - {_flow(entry)}" for entry in entries]
    lines += [
        f"start: {_flow(list(drawing.start))}  # x, y [m], yaw [rad]",
        f"goal: {_flow(list(drawing.goal))}  # [m]",
    ]
    return "\n".join(lines) + "\n"


def _bounds(drawing: Sketch) -> tuple[list[float], set[str]]:
    """Return the bounds, and the names of the walls along them, which every shape file has anyway."""
    # Use the outer wall of the base if all four sides are still there.
    segments = drawing.base.world.segments[:_SIDES]
    names = {f"s{i}" for i in range(_SIDES)}
    if len(segments) == _SIDES and not names & drawing.erased and _is_outline(segments):
        low, high = segments[:, :2].min(axis=0), segments[:, :2].max(axis=0)
        return [*low.tolist(), *high.tolist()], names
    # Else put bounds around everything, rounded outwards to whole metres.
    points = _extent(drawing)
    low, high = points.min(axis=0) - _BORDER, points.max(axis=0) + _BORDER
    return [*(math.floor(low) for low in low.tolist()), *(math.ceil(high) for high in high.tolist())], set()


def _is_outline(segments: Floats) -> bool:
    """Return whether four segments form the closed wall along their bounding box."""
    (x0, y0), (x1, y1) = segments[:, :2].min(axis=0), segments[:, :2].max(axis=0)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return bool(np.array_equal(segments, np.hstack([corners, np.roll(corners, -1, axis=0)])))


def _extent(drawing: Sketch) -> Floats:
    """Return points that span everything in the world."""
    world = drawing.world()
    centres, radii = world.circles[:, :2], world.circles[:, 2:]
    paths = [mover.path[:, :2] for mover in world.movers]
    ends = np.array([drawing.start[:2], drawing.goal])
    return np.vstack([centres - radii, centres + radii, world.edges.reshape(-1, 2), ends, *paths])


def _flow(value: Any) -> str:
    """Return a value on one line, with all its digits."""
    container = list(value) if isinstance(value, list) else dict(value)
    return yaml.safe_dump(container, default_flow_style=True, sort_keys=False, width=math.inf).strip()
