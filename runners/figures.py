"""Pictures of episodes: pure functions of records, trajectories and worlds.

Colours are Okabe and Ito's, which every kind of colour vision tells apart; line styles and markers say the
same again for print in grey.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.types import Floats
from lme.worlds.world import Task, World

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


class Style(NamedTuple):
    """How the paths of one outcome look."""

    colour: str
    line: str
    marker: str  # at the end of the path


STYLES = {  # worst first
    "collision": Style("#D55E00", "-", "X"),
    "timeout": Style("#0072B2", "--", "s"),
    "success": Style("#009E73", "-", ""),
}
LEGEND_ORDER = ("success", "collision", "timeout")
END: dict[str, Any] = {"markersize": 6, "markeredgecolor": "white", "markeredgewidth": 0.6}
OBSTACLE = "#9A9A9A"
INK = "#333333"
PANELS = 12  # at most: more cannot be read on a page
FAILURES = 2 / 3  # of the panels at most, when there are as many worlds without a failure
PAGE_IN = (10.0, 8.0)  # at most
LEGEND_IN = 6.6  # the least width that holds the key
GAP_IN, TITLE_IN, HEADER_IN, FOOTER_IN = 0.12, 0.22, 0.55, 0.42
AROUND_M = 1.5  # shown around starts, goals and paths
MARGIN_M = 0.4  # shown beyond the outermost obstacle
DPI = 200


class Box(NamedTuple):
    """Lower left and upper right corner [m]."""

    x0: float
    y0: float
    x1: float
    y1: float


def trajectories_figure(
    frame: pd.DataFrame, trajectories: pd.DataFrame, worlds: Mapping[int, Task], path: Path
) -> None:
    """Draw the paths of a run, in a sample of its worlds, all at one scale, and save them as PNG.

    frame, trajectories: as `read_episodes` and `read_trajectories` give them. worlds: tasks by number; those
    that `sample_worlds` names are enough.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    numbers = [number for number in sample_worlds(frame) if number in worlds]
    shown = trajectories[trajectories["world"].isin(numbers)]
    paths = dict(list(shown.groupby(["world", "run"])))
    box = common_box([worlds[number] for number in numbers], shown[["x_m", "y_m"]].to_numpy())
    figure = Figure(dpi=DPI)
    FigureCanvasAgg(figure)
    for number, axes in zip(numbers, _panels(figure, len(numbers), box), strict=True):
        episodes = frame[frame["world"] == number]
        draw_task(axes, worlds[number])
        draw_paths(axes, episodes, paths)
        axes.set_title(f"world {number}", fontsize=8, color=INK, pad=3)
    _label(figure, frame, len(numbers), box)
    figure.savefig(path, metadata={"Software": None})


def sample_worlds(frame: pd.DataFrame, limit: int = PANELS) -> list[int]:
    """At most `limit` worlds, spread over outcomes and over the numbers: failures first seen, never alone."""
    worst = _worst_outcomes(frame)
    kinds = {kind: sorted(w for w, outcome in worst.items() if outcome == kind) for kind in STYLES}
    good = len(kinds["success"])
    failures = max(limit - good, math.ceil(limit * FAILURES))
    # Timeouts are rare and say most; then collisions; worlds without a failure fill the rest.
    timeouts = min(len(kinds["timeout"]), max(failures - len(kinds["collision"]), failures // 2))
    collisions = min(len(kinds["collision"]), failures - timeouts)
    shares = {"timeout": timeouts, "collision": collisions, "success": limit - timeouts - collisions}
    return sorted(number for kind, share in shares.items() for number in _spread(kinds[kind], share))


def _worst_outcomes(frame: pd.DataFrame) -> dict[int, str]:
    """Of each world, the worst outcome that any of its runs had."""
    by_world = frame.groupby("world")["outcome"].agg(set)
    return {
        int(str(world)): next(kind for kind in STYLES if kind in outcomes)
        for world, outcomes in by_world.items()
    }


def _spread(numbers: Sequence[int], count: int) -> list[int]:
    """`count` of `numbers`, evenly spaced in their order."""
    chosen = np.linspace(0, len(numbers) - 1, min(count, len(numbers))).round().astype(int)
    return [numbers[index] for index in chosen]


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


def _extremes(world: World) -> Floats:
    """(N, 2) points that span the obstacles [m]."""
    centres, radii = world.circles[:, :2], world.circles[:, 2:]
    return np.vstack([centres - radii, centres + radii, world.edges.reshape(-1, 2)])


def _panels(figure: Figure, count: int, box: Box) -> list[Axes]:
    """`count` equal panels at one scale, as large as the page allows; sets the figure's size."""
    aspect = (box.y1 - box.y0) / (box.x1 - box.x0)

    def panel_width(columns: int) -> float:
        across = PAGE_IN[0] / columns - GAP_IN
        down = (PAGE_IN[1] - HEADER_IN - FOOTER_IN) / math.ceil(count / columns) - TITLE_IN - GAP_IN
        return min(across, down / aspect)

    columns = max(range(1, count + 1), key=panel_width)
    width, tall = panel_width(columns), panel_width(columns) * aspect
    grid = columns * (width + GAP_IN) - GAP_IN
    page = max(grid + 2 * GAP_IN, LEGEND_IN)
    height = HEADER_IN + FOOTER_IN + math.ceil(count / columns) * (tall + TITLE_IN + GAP_IN)
    figure.set_size_inches(page, height)
    axes = []
    for index in range(count):
        row, column = divmod(index, columns)
        x = (page - grid) / 2 + column * (width + GAP_IN)
        y = height - HEADER_IN - (row + 1) * (tall + TITLE_IN) - row * GAP_IN
        axes.append(_panel(figure, (x / page, y / height, width / page, tall / height), box))
    return axes


def _panel(figure: Figure, rectangle: tuple[float, float, float, float], box: Box) -> Axes:
    axes = figure.add_axes(rectangle)
    frame_panel(axes, box)
    return axes


def frame_panel(axes: Axes, box: Box) -> None:
    """Show a part of the world at one scale for both axes, in a thin frame without numbers."""
    axes.set(xlim=(box.x0, box.x1), ylim=(box.y0, box.y1), aspect="equal", xticks=[], yticks=[])
    axes.spines[:].set(linewidth=0.5, color="#BBBBBB")


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


def _label(figure: Figure, frame: pd.DataFrame, shown: int, box: Box) -> None:
    """Heading and counts of outcomes above; the key to lines and markers below."""
    counts = frame["outcome"].value_counts()
    outcomes = ", ".join(f"{counts[kind]} {kind}" for kind in LEGEND_ORDER if counts.get(kind, 0))
    worlds = frame["world"].nunique()
    sample = f" · {shown} of {worlds} worlds, failures first" if shown < worlds else ""
    summary = f"{len(frame)} episodes: {outcomes}{sample} · panel width {box.x1 - box.x0:.1f} m"
    for text, from_top_in, size in ((" · ".join(_names(frame)), 0.18, 11), (summary, 0.39, 8.5)):
        y = 1 - from_top_in / figure.get_figheight()
        figure.text(0.5, y, text, ha="center", va="center", fontsize=size, color=INK)
    keys = legend_keys()
    figure.legend(
        handles=keys, loc="lower center", ncols=len(keys), frameon=False, fontsize=8.5, labelcolor=INK
    )


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


def _names(frame: pd.DataFrame) -> list[str]:
    columns = [column for column in ("system", "ablation", "map", "subset", "robot") if column in frame]
    values = [", ".join(map(str, frame[column].unique())) for column in columns]
    return [value for value in values if value not in ("", "none")]
