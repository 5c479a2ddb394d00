"""A world and the paths in it, drawn at one scale, and rows of panels of equal width.

Sizes on the page are in inches, so that texts do not overlap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from lme.robots import Footprint
from lme.types import Floats
from lme.worlds.world import Task, World
from runners.reports.figures.style import END, FRAME, INK, LEGEND_ORDER, OBSTACLE, STYLES, VERMILION, Style

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.path import Path

Item = TypeVar("Item")
ROOM_M = 10.0  # a world with sides up to this is shown whole; of a larger one, the part around the paths
AROUND_M = 1.5  # shown around starts, goals and paths
MARGIN_M = 0.4  # shown beyond the outermost obstacle
FLAG = ((0.0, 0.0), (0.0, 1.0), (0.72, 0.72), (0.0, 0.44), (0.0, 0.0))  # a pennant; its foot marks the point
FLAG_SIZE = 20  # at the goal; Matplotlib measures a marker to both sides of its origin
POINTER = (
    (1.0, 0.0),
    (-0.8, 0.62),
    (-0.4, 0.0),
    (-0.8, -0.62),
    (1.0, 0.0),
)  # longer than wide, so that it points
POINTER_SIZE = 10  # at the start
PATH_PT = 1.1
BEHIND_PT, BESIDE_PT = (
    10.0,
    8.0,
)  # distance of "S" behind the start, where no path begins, and of "G" from the goal


class Box(NamedTuple):
    """Lower left and upper right corner [m]."""

    x0: float
    y0: float
    x1: float
    y1: float


def common_box(tasks: Sequence[Task], path: Floats) -> Box:
    """Return the box for every panel: obstacles, starts, goals and paths, without the empty space around them.

    path: (N, 2) positions on all paths [m]; those that are not finite, in damaged records, do not count.
    """
    path = path[np.isfinite(path).all(axis=1)]
    ends = np.array([[[task.start.x, task.start.y], task.goal] for task in tasks]).reshape(-1, 2)
    reach = np.array([task.goal_tolerance for task in tasks]).max()
    solid = np.vstack([ends - reach, ends + reach, *(extremes(task.world) for task in tasks)])
    busy = np.vstack([ends - reach, ends + reach, path])
    low, high = solid.min(axis=0) - MARGIN_M, solid.max(axis=0) + MARGIN_M
    if (solid.max(axis=0) - solid.min(axis=0)).max() > ROOM_M:
        low = np.maximum(busy.min(axis=0) - AROUND_M, low)
        high = np.minimum(busy.max(axis=0) + AROUND_M, high)
    return Box(low[0], low[1], high[0], high[1])


def frame_panel(axes: Axes, box: Box) -> None:
    """Show a box of the world at equal scale on both axes, in a thin frame without ticks."""
    axes.set(xlim=(box.x0, box.x1), ylim=(box.y0, box.y1), aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set(linewidth=0.5, color=FRAME)


def same_size(boxes: Sequence[Box]) -> list[Box]:
    """Return the boxes, each enlarged about its centre to the largest width and height of all."""
    sides = np.array([(box.x1 - box.x0, box.y1 - box.y0) for box in boxes])
    paddings = (sides.max(axis=0) - sides) / 2
    return [
        Box(box.x0 - x, box.y0 - y, box.x1 + x, box.y1 + y)
        for box, (x, y) in zip(boxes, paddings, strict=True)
    ]


def outline(footprint: Footprint) -> Floats:
    """Return (V, 2) corners of the rounded box in the robot frame [m], counter-clockwise."""
    half_length, half_width, rounding = footprint.box
    arcs = []
    # A quarter of a circle around each corner of the inner box.
    for quarter, (x, y) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        angles = np.linspace(quarter, quarter + 1, 7) * math.pi / 2
        centre = np.array([x * half_length, y * half_width])
        arcs.append(centre + rounding * np.column_stack([np.cos(angles), np.sin(angles)]))
    return np.vstack(arcs)


def draw_obstacles(axes: Axes, world: World) -> None:
    """Draw the static obstacles."""
    from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection

    centres, diameters = world.circles[:, :2], 2.0 * world.circles[:, 2]
    discs = EllipseCollection(
        diameters, diameters, np.zeros(len(diameters)), units="xy", offsets=centres,
        offset_transform=axes.transData, facecolors=OBSTACLE, edgecolors="none",
    )  # fmt: skip
    axes.add_collection(discs)
    axes.add_collection(PolyCollection(world.polygons, facecolors=OBSTACLE, edgecolors="none"))
    walls = list(world.segments.reshape(-1, 2, 2))
    axes.add_collection(LineCollection(walls, colors=OBSTACLE, linewidths=1.2))


def draw_task(axes: Axes, task: Task) -> None:
    """Draw obstacles, start (a pointer along its heading), goal and the circle of its tolerance."""
    from matplotlib.patches import Circle

    draw_obstacles(axes, task.world)
    gx, gy = task.goal
    reached = Circle((gx, gy), task.goal_tolerance, fill=False, linestyle=":", linewidth=0.8, edgecolor=INK)
    axes.add_patch(reached)
    axes.plot(gx, gy, zorder=7, **_flag())
    start = task.start
    style: dict[str, Any] = {"markersize": POINTER_SIZE, "color": INK, "markeredgewidth": 0}
    axes.plot(start.x, start.y, marker=pointer(start.yaw), zorder=7, **style)
    offset = (-BEHIND_PT * math.cos(start.yaw), -BEHIND_PT * math.sin(start.yaw))
    write(axes, "S", (start.x, start.y), offset)
    write(axes, "G", (gx, gy), (BESIDE_PT, 0.0))


def pointer(yaw: float) -> Path:
    """Return a marker that points along a heading [rad]."""
    from matplotlib.path import Path

    cos, sin = math.cos(yaw), math.sin(yaw)
    return Path(np.array(POINTER) @ [[cos, sin], [-sin, cos]])


def draw_paths(
    axes: Axes,
    episodes: pd.DataFrame,
    paths: Mapping[tuple[int, int], pd.DataFrame],
    system: Style | None = None,
) -> None:
    """Draw one line per episode; failures are on top, with a marker at their end.

    system: style of the lines; None: by outcome.
    """
    # Successes first, so that failures are on top.
    for outcome, kind in reversed(STYLES.items()):
        style = kind if system is None else system._replace(marker=kind.marker)
        episodes_of_outcome = episodes[episodes["outcome"] == outcome]
        for world, run in zip(episodes_of_outcome["world"], episodes_of_outcome["run"], strict=True):
            steps = paths.get((world, run))
            if steps is None:
                continue
            x, y = steps["x_m"].to_numpy(), steps["y_m"].to_numpy()
            axes.plot(x, y, color=style.colour, linestyle=style.line, linewidth=PATH_PT, zorder=3)
            axes.plot(x[-1:], y[-1:], marker=style.marker, color=style.colour, linestyle="", zorder=5, **END)


def legend_keys(outcomes: Sequence[str] = LEGEND_ORDER, by_system: bool = False) -> list[Line2D]:
    """Return the entries of the key: paths by outcome, start, goal and its tolerance.

    by_system: lines show systems; only the marker at the end of a path shows its outcome.
    """
    from matplotlib.lines import Line2D

    paths = [
        Line2D([], [], color=style.colour, linestyle=style.line, marker=style.marker, label=outcome, **END)
        for outcome, style in ((outcome, STYLES[outcome]) for outcome in outcomes)
    ]
    if by_system:
        for key in paths:
            key.set(color=INK, linestyle="")
        paths = [key for key in paths if key.get_marker()]
    look: dict[str, Any] = {"markersize": POINTER_SIZE, "color": INK, "linestyle": "", "markeredgewidth": 0}
    start = Line2D([], [], marker=pointer(math.pi / 2), label="start", **look)
    goal = Line2D([], [], label="goal", **_flag(in_key=True))
    circle = Line2D([], [], color=INK, linestyle=":", linewidth=0.8, label="goal tolerance")
    return [*paths, start, goal, circle]


def scale_bar(axes: Axes, box: Box, max_share: float, drop_pt: float) -> None:
    """Draw a scale bar `drop_pt` below the panel's lower left corner. max_share: share of the panel's width."""
    from matplotlib.transforms import ScaledTranslation

    # The longest of 1, 2 and 5 times a power of ten [m] that fits.
    longest = (box.x1 - box.x0) * max_share
    power = 10.0 ** math.floor(math.log10(longest))
    length = max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= longest * (1 + 1e-9))
    offset = ScaledTranslation(0.0, -drop_pt / 72, axes.figure.dpi_scale_trans)
    x, y = [box.x0, box.x0, box.x0 + length, box.x0 + length], [0.0, 0.0, 0.0, 0.0]
    # Metres along the panel, points below it.
    bar = axes.get_xaxis_transform() + offset
    axes.plot(x, y, transform=bar, color=INK, linewidth=1.2, marker="|", markersize=4, clip_on=False)
    axes.annotate(
        f"{length:g} m",
        (x[-1], 0.0),
        (4, 0),
        xycoords=bar,
        textcoords="offset points",
        va="center",
        fontsize=7,
        color=INK,
        annotation_clip=False,
    )


def write(axes: Axes, text: str, point: Sequence[float], offset_pt: tuple[float, float]) -> None:
    """Write small bold text next to a point, with a white outline that keeps it readable."""
    from matplotlib.patheffects import withStroke

    x, y = point
    axes.annotate(
        text,
        (x, y),
        offset_pt,
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=7,
        weight="bold",
        color=INK,
        zorder=7,
        path_effects=[withStroke(linewidth=1.8, foreground="white")],
        clip_on=True,
    )


def _flag(in_key: bool = False) -> dict[str, Any]:
    """Return a pennant whose foot is at its point; in a key it is centred."""
    from matplotlib.path import Path

    if in_key:
        shifted = Path(np.array(FLAG) - (0.36, 0.5))
        return {**_flag(), "marker": shifted, "markersize": FLAG_SIZE / 2}
    edge = {"markeredgecolor": INK, "markeredgewidth": 0.8}
    return {"marker": Path(FLAG), "markersize": FLAG_SIZE, "color": VERMILION, "linestyle": "", **edge}


def extremes(world: World) -> Floats:
    """Return (N, 2) points that span the obstacles [m]."""
    centres, radii = world.circles[:, :2], world.circles[:, 2:]
    return np.vstack([centres - radii, centres + radii, world.edges.reshape(-1, 2)])


class Around(NamedTuple):
    """Free space [in]: above, below and between panels, and at the left, upper and lower edge of the page."""

    title: float = 0.22
    foot: float = 0.0
    gap: float = 0.12
    left: float = 0.12
    header: float = 0.0
    footer: float = 0.0

    @property
    def per_row(self) -> float:
        """Height of a row without its panels."""
        return self.title + self.foot + self.gap


def panel_width(columns: int, count: int, aspect: float, page: tuple[float, float], around: Around) -> float:
    """Return the largest width of `count` panels in `columns` columns on a page [in]. aspect: height over width."""
    rows = math.ceil(count / columns)
    max_width = (page[0] - around.left) / columns - around.gap
    max_height = (page[1] - around.header - around.footer) / rows - around.per_row
    return min(max_width, max_height / aspect)


def best_columns(count: int, aspect: float, page: tuple[float, float], around: Around) -> int:
    """Return the number of columns that gives the widest panels."""
    return max(range(1, count + 1), key=lambda columns: panel_width(columns, count, aspect, page, around))


def wrapped(items: Sequence[Item], columns: int) -> list[list[Item]]:
    """Return rows of at most `columns` items."""
    return [list(items[first : first + columns]) for first in range(0, len(items), columns)]


def lay_out(
    figure: Figure, rows: Sequence[Sequence[Box]], width_in: float, around: Around, least_in: float = 0.0
) -> list[list[Axes]]:
    """Add one framed panel per box, all of one width, and set the figure's size, at least `least_in` wide.

    A row is as high as its highest box.
    """
    # Heights of the rows, and the size of the page.
    row_heights = [width_in * max(map(aspect_of, row)) for row in rows]
    grid = max(map(len, rows)) * (width_in + around.gap) + around.left
    page = max(grid, least_in)
    height = around.header + around.footer + sum(row_heights) + len(rows) * around.per_row
    figure.set_size_inches(page, height)
    # Place the panels from the top down, all relative to the page.
    left, top = (page - grid) / 2 + around.left, height - around.header
    panels: list[list[Axes]] = []
    for row, row_in in zip(rows, row_heights, strict=True):
        bottom = top - around.title - row_in
        panels.append([])
        for column, box in enumerate(row):
            x = left + column * (width_in + around.gap)
            axes = figure.add_axes((x / page, bottom / height, width_in / page, row_in / height))
            frame_panel(axes, box)
            panels[-1].append(axes)
        top -= row_in + around.per_row
    return panels


def aspect_of(box: Box) -> float:
    """Return height over width."""
    return (box.y1 - box.y0) / (box.x1 - box.x0)
