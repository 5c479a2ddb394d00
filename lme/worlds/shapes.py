"""Shape files: a map written by hand as readable YAML, in metres.

    bounds: [0, 0, 10, 10]  # x_min, y_min, x_max, y_max: a closed, thin outer wall
    boxes:
      - {centre: [2, 3], size: [0.4, 0.2], yaw_deg: 30}
    polygons:
      - {points: [[5, 5], [5.5, 5], [5.2, 5.6]]}
    circles:
      - {centre: [7, 2], radius: 0.1}
    ellipses:
      - {centre: [7, 4], size: [0.3, 0.5], yaw_deg: 0}
    walls:
      - {points: [[0, 7], [3, 7], [3, 8]], thickness: 0.03}  # without thickness: a thin line
    movers:
      - {radius: 0.25, path: [[3, 5], [3, 3]], speed: 1.0}  # as in a scene file
    start: [1, 1, 0.5]  # x, y [m] and optionally yaw [rad]
    goal: [9, 7]

Only `bounds` is required. Sizes are full lengths along x and y before the rotation by `yaw_deg`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lme.errors import InputError
from lme.inputs.yaml_entry import Entry
from lme.types import Floats
from lme.worlds.movers import mover_of
from lme.worlds.world import FloorPlan, enclosed

ELLIPSE_SIDES = 32  # an ellipse becomes a polygon, which deviates by at most 1.5 mm for a diameter of 0.6 m

MAX_SIDES = 200_000  # of all shapes
_MAX_PAIRS = 50_000_000  # of a polygon's sides, to see whether they cross; they take some 5 s
_PAIRS_AT_ONCE = 1_000_000
_SLACK = 1e-9  # [m] rounding error allowed where a shape touches the bounds


def floor_plan(place: str, drawing: object) -> FloorPlan:
    """Build the plan from the content of the YAML. place: the file's name in messages.

    Raises InputError that names the file, the entry and what would be right, for unknown or missing keys, wrong
    numbers, sizes that are not positive, polygons that cross themselves or enclose no area, and shapes outside
    the bounds.
    """
    entry = Entry(place, drawing, ["bounds"], (*SHAPES, *_OTHER_KEYS))
    x0, y0, x1, y1 = entry.numbers("bounds", "x_min, y_min, x_max, y_max", 4)
    if x0 >= x1 or y0 >= y1:
        raise entry.mistake("bounds", "[x_min, y_min, x_max, y_max] with each min less than its max")
    # Collect the solids, the circles and the walls, which are lines if thin and polygons if thick.
    outline = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    solids = [
        _within(outline, entry_name, maker(entry_name, item))
        for key, maker in _SOLIDS.items()
        for entry_name, item in entry.entries(key)
    ]
    circles = [_circle(outline, *item) for item in entry.entries("circles")]
    thin, thick = [np.empty((0, 4))], []
    for entry_name, item in entry.entries("walls"):
        legs, thickness = _wall(outline, entry_name, item)
        if thickness is None:
            thin.append(legs)
        else:
            thick += [_bar(leg, thickness) for leg in legs]
    sides = sum(map(len, (*solids, *thick, *thin))) + len(circles)
    if sides > MAX_SIDES:
        raise InputError(f"{place}: its shapes have {sides} sides and circles: must have at most {MAX_SIDES}")
    plan = enclosed(outline, np.array(circles).reshape(-1, 3), np.vstack(thin), (*solids, *thick))
    movers = tuple(mover_of(*item) for item in entry.entries("movers"))
    start, goal = _place(entry, "start", (2, 3)), _place(entry, "goal", (2,))
    return replace(
        plan, world=replace(plan.world, movers=movers) if movers else plan.world, start=start, goal=goal
    )


def _place(entry: Entry, key: str, counts: tuple[int, ...]) -> tuple[float, ...] | None:
    """The start or the goal, if the file has it, else None."""
    value = entry.value(key)
    if value is None:
        return None
    count = len(value) if isinstance(value, list) and len(value) in counts else counts[0]
    return tuple(entry.numbers(key, "x, y] or [x, y, yaw" if len(counts) > 1 else "x, y", count))


def _box(name: str, item: object) -> Floats:
    entry = Entry(name, item, ["centre", "size"], ["yaw_deg"])
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    return _placed(corners, entry)


def _ellipse(name: str, item: object) -> Floats:
    entry = Entry(name, item, ["centre", "size"], ["yaw_deg"])
    angles = np.arange(ELLIPSE_SIDES) * (2 * math.pi / ELLIPSE_SIDES)
    return _placed(np.column_stack([np.cos(angles), np.sin(angles)]) / 2, entry)


def _placed(unit: Floats, entry: Entry) -> Floats:
    """A shape of unit size (V, 2), scaled, rotated and moved as its entry says."""
    centre = entry.numbers("centre", "x, y", 2)
    size = entry.numbers("size", "along x, along y", 2, above=0.0)
    yaw = math.radians(entry.number("yaw_deg", 0.0))
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    return np.asarray((unit * size) @ turn + centre)


def _polygon(name: str, item: object) -> Floats:
    entry = Entry(name, item, ["points"])
    points = entry.points("points", 3)
    following = np.roll(points, -1, axis=0)
    if (points[0] == points[-1]).all():
        raise entry.mistake("points", "a polygon whose last point is not the first again")
    if abs(_side(points[0], points, following).sum()) < 1e-12:
        raise entry.mistake("points", "a polygon that encloses an area")
    try:
        crossing = _crosses_itself(points, following)
    except ValueError as error:
        raise entry.mistake("points", f"a polygon with fewer or shorter sides ({error})") from error
    if crossing:
        raise entry.mistake("points", "a polygon whose sides do not cross")
    return points


_SOLIDS: dict[str, Callable[[str, object], Floats]] = {
    "boxes": _box,
    "polygons": _polygon,
    "ellipses": _ellipse,
}
SHAPES = (*_SOLIDS, "circles", "walls")  # the keys of a shape file besides `bounds`
_OTHER_KEYS = ("movers", "start", "goal")  # keys that are not shapes


def _circle(outline: Floats, name: str, item: object) -> list[float]:
    entry = Entry(name, item, ["centre", "radius"])
    centre, radius = entry.numbers("centre", "x, y", 2), entry.number("radius", above=0.0)
    _within(outline, name, np.array([np.subtract(centre, radius), np.add(centre, radius)]))
    return [*centre, radius]


def _wall(outline: Floats, name: str, item: object) -> tuple[Floats, float | None]:
    """The legs (L, 4) of the wall's centre line, and its thickness [m]."""
    entry = Entry(name, item, ["points"], ["thickness"])
    points = _within(outline, name, entry.points("points", 2))
    thick = entry.value("thickness") is not None
    return np.hstack([points[:-1], points[1:]]), entry.number("thickness", above=0.0) if thick else None


def _bar(leg: Floats, thickness: float) -> Floats:
    """(4, 2) corners of one leg of a wall, half a thickness longer at both ends so that its corners close."""
    along = (leg[2:] - leg[:2]) * (thickness / 2 / math.hypot(*(leg[2:] - leg[:2])))
    across = np.array([-along[1], along[0]])
    start, end = leg[:2] - along, leg[2:] + along
    return np.array([start - across, end - across, end + across, start + across])


def _within(outline: Floats, name: str, points: Floats) -> Floats:
    """The points (V, 2) unchanged. Raises InputError unless all of them lie within the bounds."""
    low, high = outline[0], outline[2]
    outside = ((points < low - _SLACK) | (points > high + _SLACK)).any(axis=1)
    if outside.any():
        x, y = points[outside][0]
        bounds = ", ".join(f"{number:g}" for number in (*low, *high))
        raise InputError(f"{name}: reaches ({x:g}, {y:g}): must lie within bounds [{bounds}]")
    return points


def _crosses_itself(start: Floats, end: Floats) -> bool:
    """Return whether two sides start[i]–end[i] of a closed polygon cross between their ends.

    Only sides that overlap along x, or along y where fewer do, are compared. Raises ValueError if they are too many.
    """
    low, high = np.minimum(start, end), np.maximum(start, end)
    # Sort the sides by their lower end along each axis. A side overlaps those after it up to its rank, which begin
    # before it ends. Sweep along the axis with fewer overlaps.
    orders = [np.argsort(low[:, axis], kind="stable") for axis in (0, 1)]
    ranks = [
        np.searchsorted(low[order, axis], high[order, axis], side="right")
        for axis, order in enumerate(orders)
    ]
    order, stops = min(zip(orders, ranks, strict=True), key=lambda choice: choice[1].sum())
    starts = np.arange(1, len(order) + 1)
    ends = np.cumsum(stops - starts)  # of the pairs of each side with later ones
    if ends[-1] > _MAX_PAIRS:
        raise ValueError(f"{ends[-1]} pairs of sides overlap")
    # Compare the pairs in batches, since all of them may not fit into memory.
    begin = 0
    while begin < len(order):
        stop = max(int(np.searchsorted(ends, ends[begin] + _PAIRS_AT_ONCE)), begin + 1)
        counts = (stops - starts)[begin:stop]
        side = np.repeat(np.arange(begin, stop), counts)
        later_side = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + starts[side]
        i, j = order[side], order[later_side]
        # Sides whose boxes meet cross if the ends of each lie on different sides of the other.
        may_meet = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        i, j = i[may_meet], j[may_meet]
        sides_of_j = _side(start[i], end[i], start[j]) * _side(start[i], end[i], end[j])
        sides_of_i = _side(start[j], end[j], start[i]) * _side(start[j], end[j], end[i])
        if ((sides_of_j < 0) & (sides_of_i < 0)).any():
            return True
        begin = stop
    return False


def _side(a: Floats, b: Floats, point: Floats) -> Floats:
    """Positive if a point lies to the left of the line from a to b."""
    along, to = b - a, point - a
    return np.asarray(along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0])
