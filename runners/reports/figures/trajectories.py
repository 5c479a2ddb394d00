"""Paths of several systems: side by side, one row per place, or overlaid, one panel per place."""

from __future__ import annotations

import math
import re
import textwrap
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.errors import InputError, require
from runners.config.escaping import plot_text
from runners.records.trust import UntrustedError
from runners.reports.figures.driven_runs import DrivenRun, runs_of
from runners.reports.figures.panels import (
    SCALE,
    SYSTEMS,
    Panel,
    TrajectoryStyle,
    draw_panel,
    ends_before,
    episodes_of,
    footer_height_in,
    least_in,
    scale_drop_pt,
    steps_of,
)
from runners.reports.figures.paths import without_steps
from runners.reports.figures.scene import (
    Around,
    Box,
    aspect_of,
    best_columns,
    common_box,
    lay_out,
    legend_keys,
    same_size,
    scale_bar,
    wrapped,
)
from runners.reports.figures.stage import SUBGOAL, DrivenPlace, places, stage_keys
from runners.reports.figures.style import (
    INK,
    LEGEND_ORDER,
    STYLES,
    Style,
    entitle,
    new_figure,
    page_width,
    save,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

NAME = "side_by_side"
ROWS, COLUMNS = 6, 6  # at most: more cannot be read on a page
PANEL_IN, TALL_IN = 2.3, 9.6  # of a panel in a sweep's picture; height of all rows, at most
ROW_IN = 0.35  # approximate height of the texts above and below a row
WIDEST_IN = 3.5  # width of a panel that is alone on its page
LINE_IN, LETTER_IN, LABEL_IN = 0.16, 0.07, 0.28  # a line of text, a letter, the name of a row
LEAST_IN = 4.2  # minimum width for the key
PAGE_IN = (7.16, 5.0)  # page that panels of one system, or of overlaid systems, may fill
ORDERS = {"faded": "subgoals, later ones stronger", "numbered": "some subgoals in order"}
SUBGOALS = ("none", *ORDERS)
WORLD = ", world "  # ends the name of the map in that of a place
LAYOUTS = ("side_by_side", "overlaid")
KEYS: dict[str, Any] = {"frameon": False, "fontsize": 7.5, "labelcolor": INK}
_SECONDS = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*s")


@dataclass(slots=True)
class TrajectoriesFigureConfig:
    """Appearance of the paths of several systems."""

    layout: str
    moment: Any
    subgoals: str
    width: float

    def __post_init__(self) -> None:
        for key, values in (("layout", LAYOUTS), ("subgoals", SUBGOALS)):
            if getattr(self, key) not in values:
                raise InputError(f"figure.{key} is {getattr(self, key)!r}: must be {' or '.join(values)}")
        require("width", self.width, at_least=2.0)
        moment(self.moment)


class Trajectories:
    """The kind `trajectories` of `lme figure`."""

    Config = TrajectoriesFigureConfig
    name = "trajectories"
    drives = True
    guided = None

    def __init__(self, config: TrajectoriesFigureConfig) -> None:
        self._config = config

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Draw the runs, save the figure as `stem`.png, …, and return the paths.

        worlds: one row or panel each; empty: a sample. Raises InputError if the panels do not fit on a page.
        """
        overlaid = self._config.layout == "overlaid"
        look = TrajectoryStyle(
            moment(self._config.moment), self._config.subgoals, _styles(runs) if overlaid else {}
        )
        scenes = places(runs, worlds)
        rows = _rows(runs, scenes, look, self._config.width)
        if len(rows) > ROWS:
            raise InputError(
                f"{len(_labels(runs))} systems in {len(scenes)} worlds make {len(rows)} rows of panels; at most {ROWS} "
                "are readable on a page: choose fewer with world="
            )
        return save(_draw_page(rows, look, self._config.width), stem, formats)


def side_by_side_figure(frame: pd.DataFrame, run_dirs: Sequence[Path], folder: Path) -> list[Path]:
    """Draw the paths of every run of a sweep, save them in `folder` as PNG and PDF, and return the paths.

    Nothing is drawn for a single system, or for more systems than fit on a page. Warns if steps were deleted, and if
    a run names code or files that may not be used, since tables do not need them.
    """
    try:
        runs = runs_of(frame, run_dirs)
    except UntrustedError as error:
        warnings.warn(f"no picture of the paths: {error}", stacklevel=2)
        return []
    # A comparison needs at least two systems, with all their steps.
    columns = len(_labels(runs))
    if not 1 < columns <= COLUMNS or without_steps(run_dirs):
        return []
    width, scenes = page_width(PANEL_IN * columns), places(runs)[:ROWS]
    rows = _rows(runs, scenes, TrajectoryStyle(), page_width(math.inf))
    # On a narrow page, a place takes several rows: show fewer places.
    per_place = max(len(rows) // len(scenes), 1)
    rows = rows[: max(ROWS // per_place // per_place, 1) * per_place]
    return save(_draw_page(rows, TrajectoryStyle(), width), folder / NAME, ("png", "pdf"))


def moment(value: Any) -> int | float | None:
    """Parse `figure.moment`: a step (int), seconds (float) or None. Raises InputError."""
    seconds = _SECONDS.fullmatch(value) if isinstance(value, str) else None
    if seconds is not None:
        return float(seconds[1])
    if value is None or (isinstance(value, int) and not isinstance(value, bool) and value >= 0):
        return value
    raise InputError(
        f"figure.moment is {value!r}: must be null, the number of a step, or a time such as 12.5s"
    )


def _labels(runs: Sequence[DrivenRun]) -> list[str]:
    return list(dict.fromkeys(run.label for run in runs))


def _styles(runs: Sequence[DrivenRun]) -> dict[str, Style]:
    labels = _labels(runs)
    if len(labels) > len(SYSTEMS):
        raise InputError(
            f"figure.layout is overlaid: {len(labels)} systems cannot be distinguished in one panel, "
            f"{len(SYSTEMS)} can; choose side_by_side, or fewer systems"
        )
    return dict(zip(labels, SYSTEMS, strict=False))


def _rows(
    runs: Sequence[DrivenRun],
    scenes: Sequence[DrivenPlace],
    look: TrajectoryStyle,
    width_in: float = math.inf,
) -> list[list[Panel]]:
    """Return rows of panels for a page of this width."""
    labels = _labels(runs)
    max_columns = (width_in - LABEL_IN) / (least_in([run.label for run in runs], look) + Around().gap)
    columns = int(max(min(max_columns, COLUMNS), 1))
    # One panel for each place, or for each system and place.
    if look.systems or len(labels) == 1:
        panels = [Panel(scene.name, scene, scene.runs) for scene in scenes]
        aspect = aspect_of(same_size([_box(scene) for scene in scenes])[0])
        rows = wrapped(panels, min(best_columns(len(panels), aspect, PAGE_IN, Around()), columns))
    else:
        rows = [
            [
                Panel(label, scene, tuple(run for run in scene.runs if run.label == label))
                for label in labels_in_row
            ]
            for scene in scenes
            for labels_in_row in wrapped(labels, columns)
        ]
    return rows


def _draw_page(rows: Sequence[Sequence[Panel]], look: TrajectoryStyle, width_in: float) -> Figure:
    panels = [panel for row in rows for panel in row]
    # Find the box of each place; panels of different places share one scale.
    boxes = {panel.place: _box(panel.place) for panel in panels}
    if _is_wrapped(rows):
        boxes = dict(zip(boxes, same_size(list(boxes.values())), strict=True))
    row_boxes = [[boxes[panel.place] for panel in row] for row in rows]
    keys = _keys(panels, look)
    # Lay the panels out, then draw them row by row.
    page = _widest_page(rows, row_boxes, look, keys, width_in)
    figure = new_figure(width_in, TALL_IN, layout=None)
    all_axes = lay_out(figure, row_boxes, page.panel, page.around, page.width)
    title, row_labels = _names(rows)
    labels = iter(row_labels)
    for row, row_axes in zip(rows, all_axes, strict=True):
        scale_bar(row_axes[0], boxes[row[0].place], SCALE, scale_drop_pt(panels, look, page.panel))
        if label := next(labels):
            height = row_axes[0].get_position().height * figure.get_figheight()
            letters = int(height / LETTER_IN)
            text = plot_text(label if len(label) <= letters else f"{label[: letters - 1]}…")
            row_axes[0].set_ylabel(text, fontsize=8, color=INK, labelpad=4)
        for panel, axes in zip(row, row_axes, strict=True):
            draw_panel(axes, panel, look, boxes[panel.place])
            if row is rows[0] or not _is_repeated(rows):
                axes.set_title(plot_text(page.titles[panel.title]), fontsize=8.5, color=INK, pad=3)
    figure.legend(handles=keys, loc="lower center", ncols=_key_columns(keys, page.width), **KEYS)
    entitle(figure, title)
    return figure


def _names(rows: Sequence[Sequence[Panel]]) -> tuple[str, list[str]]:
    """Return the title, which is the map that all rows share, and the name of each row; empty if panels have it."""
    if _is_wrapped(rows):
        return "", [""] * len(rows)
    names = [row[0].place.name for row in rows]
    maps = {name.partition(WORLD)[0] for name in names}
    if len(maps) > 1:
        return "", names
    if len(set(names)) == 1:
        return names[0], [""] * len(rows)
    return maps.pop(), [name.partition(", ")[2] for name in names]


class _Page(NamedTuple):
    """Widths of the figure and of a panel, and the space around panels [in]; titles wrapped to fit."""

    width: float
    panel: float
    around: Around
    titles: dict[str, str]


def _widest_page(
    rows: Sequence[Sequence[Panel]],
    row_boxes: Sequence[Sequence[Box]],
    look: TrajectoryStyle,
    keys: Sequence[Line2D],
    width_in: float,
) -> _Page:
    """Return the page with the widest panels that `width_in` and the page height allow."""
    margin_left = LABEL_IN if any(_names(rows)[1]) else Around().left
    columns = max(map(len, rows))
    # As wide as the page allows, but not so high that the rows leave it.
    panel = min((width_in - margin_left) / columns - Around().gap, WIDEST_IN)
    available_height = (PAGE_IN[1] if _is_wrapped(rows) else TALL_IN) - ROW_IN * len(rows)
    min_panel = least_in([run.label for row in rows for panel_drawn in row for run in panel_drawn.runs], look)
    panel = min(panel, max(min_panel, available_height / sum(max(map(aspect_of, row)) for row in row_boxes)))
    width = max(columns * (panel + Around().gap) + margin_left, min(width_in, LEAST_IN))
    # Space for titles, key and texts at this width.
    names = dict.fromkeys(panel_drawn.title for row in rows for panel_drawn in row)
    titles = {name: textwrap.fill(name, max(int(panel / LETTER_IN), 8)) for name in names}
    title = LINE_IN * (1 + max(text.count("\n") for text in titles.values())) + 0.05
    key_lines = math.ceil(len(keys) / _key_columns(keys, width))
    foot = footer_height_in([panel_drawn for row in rows for panel_drawn in row], look, panel)
    headings = {"title": 0.04, "header": title} if _is_repeated(rows) else {"title": title, "header": 0.04}
    return _Page(
        width,
        panel,
        Around(foot=foot, left=margin_left, footer=LINE_IN * key_lines + 0.1, **headings),
        titles,
    )


def _key_columns(keys: Sequence[Line2D], width_in: float) -> int:
    longest = max(len(str(key.get_label())) for key in keys)
    return max(min(len(keys), int(width_in / (0.5 + 0.055 * longest))), 1)


def _is_wrapped(rows: Sequence[Sequence[Panel]]) -> bool:
    """Return whether panels show different places instead of different systems."""
    return rows[0][0].title == rows[0][0].place.name


def _is_repeated(rows: Sequence[Sequence[Panel]]) -> bool:
    """Return whether every row has the same titles, so that only the first row needs them."""
    return all([panel.title for panel in row] == [panel.title for panel in rows[0]] for row in rows)


def _keys(panels: Sequence[Panel], look: TrajectoryStyle) -> list[Line2D]:
    """Return the entries of the key, for the lines and markers that occur."""
    from matplotlib.lines import Line2D

    runs_and_scenes = [(run, panel.place) for panel in panels for run in panel.runs]
    outcomes_driven = {
        str(outcome) for run, scene in runs_and_scenes for outcome in episodes_of(run, scene)["outcome"]
    }
    outcomes = [kind for kind in LEGEND_ORDER if kind in outcomes_driven]
    systems = [
        Line2D([], [], color=style.colour, linestyle=style.line, label=plot_text(label))
        for label, style in look.systems.items()
    ]
    keys = [*systems, *legend_keys(outcomes, by_system=bool(look.systems))]
    if look.subgoals == "none" and look.moment is None:
        return keys
    # Subgoals: overlaid systems colour those along the path; that of a moment is yellow.
    star = {**SUBGOAL, "color": "white"} if look.systems and look.subgoals != "none" else SUBGOAL
    label = ORDERS.get(look.subgoals, "subgoal then")
    keys.append(Line2D([], [], marker="*", linestyle="", label=label, **star))
    # The robot, its scan and movers at a moment.
    if look.moment is not None:
        colour = INK if look.systems or len(outcomes) > 1 else STYLES[outcomes[0]].colour
        is_time = isinstance(look.moment, float)
        time_text = f"at {look.moment:g} s" if is_time else f"at step {look.moment}"
        qualifier = " or its end" if ends_before(panels, look.moment) else ""
        movers = any(panel.place.task.world.movers for panel in panels)
        keys += stage_keys(f"{time_text}{qualifier}", colour, scan=not look.systems, movers=movers)
    if any(len(episodes_of(run, scene)) > 1 for run, scene in runs_and_scenes):
        meaning = (
            "subgoals" if look.moment is None else "robot" if look.subgoals == "none" else "robot, subgoals"
        )
        keys.append(Line2D([], [], linestyle="", label=f"{meaning}: 1st episode"))
    return keys


def _box(scene: DrivenPlace) -> Box:
    """Return the box that all panels of a place show."""
    points = [steps_of(run, scene)[["x_m", "y_m"]].to_numpy() for run in scene.runs]
    return common_box([scene.task], np.vstack(points))
