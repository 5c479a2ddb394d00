"""A world and what is driven in it, drawn at one scale."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lme.types import Floats
from lme.worlds.world import Task, World
from runners.pictures.style import END, FRAME, INK, LEGEND_ORDER, OBSTACLE, STYLES

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

AROUND_M = 1.5  # shown around starts, goals and paths
MARGIN_M = 0.4  # shown beyond the outermost obstacle


class Box(NamedTuple):
    """Lower left and upper right corner [m]."""

    x0: float
    y0: float
    x1: float
    y1: float


def common_box(tasks: Sequence[Task], path: Floats) -> Box:
    """What every panel shows: where things happen, and no more of the emptiness around the obstacles.

    path: (N, 2) all positions driven through [m].
    """
    ends = np.array([[[task.start.x, task.start.y], task.goal] for task in tasks]).reshape(-1, 2)
    reach = np.array([task.goal_tolerance for task in tasks]).max()
    solid = np.vstack([ends - reach, ends + reach, *(_extremes(task.world) for task in tasks)])
    busy = np.vstack([ends - reach, ends + reach, path])
    low = np.maximum(busy.min(axis=0) - AROUND_M, solid.min(axis=0) - MARGIN_M)
    high = np.minimum(busy.max(axis=0) + AROUND_M, solid.max(axis=0) + MARGIN_M)
    return Box(low[0], low[1], high[0], high[1])


def frame_panel(axes: Axes, box: Box) -> None:
    """Show a part of the world at one scale for both axes, in a thin frame without numbers."""
    axes.set(xlim=(box.x0, box.x1), ylim=(box.y0, box.y1), aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set(linewidth=0.5, color=FRAME)


def draw_task(axes: Axes, task: Task) -> None:
    """Obstacles, start (an arrowhead along its heading), goal and the circle that counts as reached."""
    from matplotlib.collections import LineCollection, PatchCollection
    from matplotlib.patches import Circle, Polygon

    solids = [Circle((x, y), radius) for x, y, radius in task.world.circles]
    solids += [Polygon(corners) for corners in task.world.polygons]
    axes.add_collection(PatchCollection(solids, facecolor=OBSTACLE, edgecolor="none"))
    axes.add_collection(
        LineCollection(task.world.segments.reshape(-1, 2, 2), colors=OBSTACLE, linewidths=1.2)
    )
    gx, gy = task.goal
    reached = Circle((gx, gy), task.goal_tolerance, fill=False, linestyle=":", linewidth=0.8, edgecolor=INK)
    axes.add_patch(reached)
    axes.plot(gx, gy, marker="*", markersize=7, color=INK, markeredgewidth=0, zorder=4)
    arrow = (3, 0, math.degrees(task.start.yaw) - 90)
    axes.plot(task.start.x, task.start.y, marker=arrow, markersize=6, color=INK, markeredgewidth=0, zorder=4)


def draw_paths(axes: Axes, episodes: pd.DataFrame, paths: Mapping[tuple[int, int], pd.DataFrame]) -> None:
    """One line per run; failures on top, with a marker where they ended."""
    for outcome, style in reversed(STYLES.items()):
        for episode in episodes[episodes["outcome"] == outcome].itertuples():
            steps = paths.get((episode.world, episode.run))
            if steps is None:
                continue
            x, y = steps["x_m"].to_numpy(), steps["y_m"].to_numpy()
            axes.plot(x, y, color=style.colour, linestyle=style.line, linewidth=1.0, zorder=3)
            axes.plot(x[-1:], y[-1:], marker=style.marker, color=style.colour, linestyle="", zorder=5, **END)


def legend_keys() -> list[Line2D]:
    from matplotlib.lines import Line2D

    styles = [(outcome, STYLES[outcome]) for outcome in LEGEND_ORDER]
    paths = [
        Line2D([], [], color=style.colour, linestyle=style.line, marker=style.marker, label=outcome, **END)
        for outcome, style in styles
    ]
    start, goal = (
        Line2D([], [], marker=marker, label=label, color=INK, linestyle="", markeredgewidth=0)
        for marker, label in (("^", "start"), ("*", "goal"))
    )
    circle = Line2D([], [], color=INK, linestyle=":", linewidth=0.8, label="goal tolerance")
    return [*paths, start, goal, circle]


def _extremes(world: World) -> Floats:
    """(N, 2) points that span the obstacles [m]."""
    centres, radii = world.circles[:, :2], world.circles[:, 2:]
    return np.vstack([centres - radii, centres + radii, world.edges.reshape(-1, 2)])
