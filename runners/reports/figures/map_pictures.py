"""A sheet of map sets, or of the worlds of one map set."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.errors import InputError, require
from lme.geometry.frames import to_world
from lme.robots import Robot
from lme.types import Floats, Pose
from lme.worlds.movers import Mover
from lme.worlds.world import Task
from runners.config.catalogue import Catalogue, shipped
from runners.config.escaping import plot_text
from runners.config.map_sets import GRAMMAR, MapSetChoice, choose, known_path
from runners.reports.figures.driven_runs import DrivenRun
from runners.reports.figures.scene import (
    MARGIN_M,
    Box,
    draw_task,
    extremes,
    frame_panel,
    legend_keys,
    scale_bar,
)
from runners.reports.figures.style import BLUE, GRID, INK, OBSTACLE, VERMILION, entitle, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

COLUMNS = 4  # of panels, at most, by default
PANELS = 60  # at most: more would be too small to read
PAGE_IN, CELL_IN = 7.0, 3.4  # width of the page and of a panel, at most
TALL = 1.45  # height of a panel over its width, at most
HEADING_IN, SCALE_IN, GAP_IN = 0.47, 0.2, 0.12  # above a panel, below it, around it
NUMBERS_IN = 0.36  # left of and below a panel with numbers in metres
SCALE_SHARE = 0.3  # of a panel's width that its scale bar may take
SCALE_PT = 7.0  # from a panel down to its scale bar
KEY_IN, KEY_LINE_IN = 1.3, 0.16  # size of an entry in the key
ROOM = 0.12  # kept around start and goal for their letters, as a share of the longest side
SIDES = 24  # of the polygon that outlines a disc
SQUARES = 16  # of the grid along the longest side, at most

MOVER: dict[str, Any] = {"edgecolor": VERMILION, "linewidth": 1.0, "facecolor": "none"}
WALL: dict[str, Any] = {"edgecolor": OBSTACLE, "linewidth": 0.6}
WAY: dict[str, Any] = {"color": BLUE, "linewidth": 1.1, "linestyle": (0, (4, 1.5))}


class MapPanel(NamedTuple):
    """A world. detail: text below the name. way: (P, 2) path [m] that the optimal time is based on."""

    name: str
    detail: str
    task: Task
    way: Floats | None


@dataclass(slots=True)
class MapsConfig:
    """Keys of `conf/figure/maps.yaml`."""

    maps: list[str] | None
    columns: int
    way: bool

    def __post_init__(self) -> None:
        require("columns", self.columns, at_least=1, at_most=8)
        if self.maps == []:
            raise InputError(f"figure.maps is []: must be a list of {GRAMMAR}, or null for all")


class Maps:
    """A kind of figure: see `runners.reports.figures.driven_runs.Kind`."""

    Config = MapsConfig
    name = "maps"
    drives = False
    guided = None

    def __init__(
        self, config: MapsConfig, robot: Robot | None = None, configs: Catalogue | None = None
    ) -> None:
        """Choose the worlds. robot, configs: as for `runners.config.map_sets.choose`.

        Raises InputError for a map set, a world or a setting that does not exist.
        """
        self.config, self._robot, self._configs = config, robot, configs or shipped()
        if config.maps is not None:
            self._entries = [entry.split() for entry in config.maps]
            for entry in self._entries:
                self._choose(entry)
            return
        # By default, every map set that works without a setting.
        self._entries = []
        for name in self._configs.titles("map"):
            with suppress(InputError):
                choose([name], self._robot, self._configs)
                self._entries.append([name])

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Draw the worlds named with each map set, else `worlds`, else its first world; return the paths."""
        panels = []
        for entry in self._entries:
            choice = self._choose(entry)
            if worlds and not choice.worlds:
                choice = self._choose([*entry, *map(str, worlds)])
            panels += panels_of(choice)
        if not self.config.way:
            panels = [panel._replace(way=None) for panel in panels]
        figure = sheet(panels, self.config.columns)
        entitle(figure)
        return save(figure, stem, formats)

    def _choose(self, entry: Sequence[str]) -> MapSetChoice:
        try:
            return choose(entry, self._robot, self._configs)
        except InputError as error:
            raise InputError(f"figure.maps holds {' '.join(entry)!r}: {error}") from error


def panels_of(chosen: MapSetChoice) -> list[MapPanel]:
    """Return one panel per chosen world; if none is chosen, the first world represents the whole set."""
    maps = chosen.maps
    if not chosen.worlds:
        task = maps.task(maps.numbers[0])
        return [MapPanel(chosen.name, describe_set(chosen, task), task, None)]
    return [
        MapPanel(
            f"{chosen.name} {task.number}",
            f"{metres(task)}\noptimal time {task.optimal_time:.3g} s",
            task,
            known_path(maps, task),
        )
        for task in map(maps.task, chosen.worlds)
    ]


def extent(task: Task) -> Box:
    """Return the box around obstacles, movers at their first pose, start and goal."""
    ends = np.array([task.start[:2], task.goal])
    movers = (mover_outline(mover) for mover in task.world.movers)
    points = np.vstack([ends, extremes(task.world), *movers])
    return Box(*points.min(axis=0).tolist(), *points.max(axis=0).tolist())


def mover_outline(mover: Mover) -> Floats:
    """Return (V, 2) corners of a mover at its first pose [m]; a disc becomes a polygon of `SIDES` sides."""
    angles = np.arange(SIDES) * (2 * math.pi / SIDES)
    outline = mover.outline
    if outline is None:
        outline = (mover.radius or 0.0) * np.column_stack([np.cos(angles), np.sin(angles)])
    return to_world(outline, Pose(*mover.path[0].tolist()))


def metres(task: Task) -> str:
    """Return the size of a world as text, start and goal included, rounded to half a metre."""
    box = extent(task)
    return " × ".join(f"{round(2 * side) / 2:g}" for side in (box.x1 - box.x0, box.y1 - box.y0)) + " m"


def describe_set(chosen: MapSetChoice, task: Task) -> str:
    """Return two lines: the size of the world shown, and the number of worlds."""
    count = len(chosen.maps.numbers)
    choice = f", {chosen.choice}" if chosen.choice else ""
    return f"{metres(task)}\n{count} world{'s' * (count > 1)}{choice}"


def sheet(panels: Sequence[MapPanel], columns: int) -> Figure:
    """Draw all panels in rows, each as large as fits, with a scale bar; a single panel gets axes in metres.

    Raises InputError for too many panels.
    """
    if len(panels) > PANELS:
        raise InputError(f"{len(panels)} worlds on one sheet: must be at most {PANELS}")
    columns, is_single = min(columns, len(panels)), len(panels) == 1
    # Sizes of everything in inches: cells, worlds, rows and the key.
    label_width, label_height = (NUMBERS_IN, NUMBERS_IN) if is_single else (0.0, SCALE_IN)
    cell = min(PAGE_IN / columns, CELL_IN)
    boxes = [_box(panel.task) for panel in panels]
    sizes = [_size(box, cell - 2 * GAP_IN - label_width) for box in boxes]
    rows = [range(i, min(i + columns, len(panels))) for i in range(0, len(panels), columns)]
    heights = [HEADING_IN + max(sizes[i][1] for i in row) + label_height + GAP_IN for row in rows]
    keys = _keys(panels)
    per_line = max(1, int(cell * columns / KEY_IN))
    foot = math.ceil(len(keys) / per_line) * KEY_LINE_IN + GAP_IN
    page, height = cell * columns, sum(heights) + foot
    figure = new_figure(page, height, layout=None)
    # Draw row by row from the top, each panel below its heading.
    for row, indices in enumerate(rows):
        for column, index in enumerate(indices):
            x, top = (column + 0.5) * cell + label_width / 2, foot + sum(heights[row:])
            panel_width, panel_height = sizes[index]
            left, bottom = x - panel_width / 2, top - HEADING_IN - panel_height
            axes = figure.add_axes((left / page, bottom / height, panel_width / page, panel_height / height))
            _draw(axes, panels[index], boxes[index], is_single)
            _head(figure, panels[index], (x, top))
    style: dict[str, Any] = {"loc": "lower center", "frameon": False, "fontsize": 7.5, "labelcolor": INK}
    figure.legend(handles=keys, ncols=per_line, **style)
    return figure


def _box(task: Task) -> Box:
    """Return the box of a panel: the world, the goal circle and the letters, with a margin."""
    box, reach = extent(task), task.goal_tolerance
    margins = ROOM * max(box.x1 - box.x0, box.y1 - box.y0)
    ends = np.array([task.start[:2], task.goal])
    low = np.min(
        [(box.x0 - MARGIN_M, box.y0 - MARGIN_M), task.goal - reach - MARGIN_M, *(ends - margins)], axis=0
    )
    high = np.max(
        [(box.x1 + MARGIN_M, box.y1 + MARGIN_M), task.goal + reach + MARGIN_M, *(ends + margins)], axis=0
    )
    return Box(*low.tolist(), *high.tolist())


def _size(box: Box, width_in: float) -> tuple[float, float]:
    """Return width and height of the box on the page [in]: at most `width_in` wide, and `TALL` times that high."""
    width, height = box.x1 - box.x0, box.y1 - box.y0
    scale = min(width_in / width, width_in * TALL / height)
    return width * scale, height * scale


def _step(longest_m: float) -> float:
    """Return the smallest step of 1, 2 or 5 times a power of ten that gives at most `SQUARES` squares [m]."""
    min_step = longest_m / SQUARES
    power = 10.0 ** math.floor(math.log10(min_step))
    return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= min_step)


def _draw(axes: Axes, panel: MapPanel, box: Box, is_single: bool) -> None:
    """Draw the world, with a grid in metres if `is_single`, else with a scale bar below."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Polygon

    frame_panel(axes, box)
    draw_task(axes, panel.task)
    # A wall of 3 cm is thinner than a pixel: an outline keeps it visible.
    axes.add_collection(PolyCollection(panel.task.world.polygons, facecolor="none", **WALL))
    if panel.way is not None:
        axes.plot(*panel.way.T, zorder=3, **WAY)
    for mover in panel.task.world.movers:
        axes.add_patch(Polygon(mover_outline(mover), zorder=3, **MOVER))
    if is_single:
        _number(axes, box)
    else:
        scale_bar(axes, box, SCALE_SHARE, SCALE_PT)


def _number(axes: Axes, box: Box) -> None:
    """Draw a grid behind the world, and metres along both axes."""
    step = _step(max(box.x1 - box.x0, box.y1 - box.y0))
    sides = ((axes.xaxis, "x [m]", box.x0, box.x1), (axes.yaxis, "y [m]", box.y0, box.y1))
    for axis, label, low, high in sides:
        ticks = [step * i for i in range(math.ceil(low / step), math.floor(high / step) + 1)]
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_label_text(label, fontsize=7.5, color=INK)
        axis.labelpad = 1.0
    axes.tick_params(length=0, labelsize=7, colors=INK, pad=2)
    axes.grid(color=GRID, linewidth=0.4)
    axes.set_axisbelow(True)


def _head(figure: Figure, panel: MapPanel, top_middle: tuple[float, float]) -> None:
    """Write the name and, below it, the detail, from `top_middle` [in] down."""
    page, height = figure.get_size_inches()
    x, top = top_middle
    style: dict[str, Any] = {"ha": "center", "va": "top", "color": INK, "linespacing": 1.1}
    figure.text(
        x / page, (top - 0.05) / height, plot_text(panel.name), fontsize=8.5, fontweight="bold", **style
    )
    figure.text(x / page, (top - 0.195) / height, plot_text(panel.detail), fontsize=7, **style)


def _keys(panels: Sequence[MapPanel]) -> list[Line2D]:
    """Return the entries of the key, for what the panels show."""
    from matplotlib.lines import Line2D

    keys = legend_keys(())
    if any(panel.way is not None for panel in panels):
        keys.append(Line2D([], [], label="optimal path", **WAY))
    if any(panel.task.world.movers for panel in panels):
        ring: dict[str, Any] = {"marker": "o", "markerfacecolor": "none", "markeredgecolor": VERMILION}
        keys.append(Line2D([], [], label="moves, where it starts", linestyle="", markersize=7, **ring))
    return keys
