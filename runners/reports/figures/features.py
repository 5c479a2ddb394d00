"""Each criterion and the score S of the candidates of one decision (paper Figs. "Visualization of features").

The page has equal panels, each with a title and a colour bar, a heading, a key and a note.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.errors import InputError, nearest
from lme.guides.lme.explanation import Explanation
from lme.guides.lme.score import CRITERIA
from lme.types import Bools, Floats
from runners.reports.figures import robot_view as view
from runners.reports.figures.driven_runs import (
    DecisionFigure,
    DecisionView,
    StepConfig,
    candidate_reach,
)
from runners.reports.figures.robot_view import draw_key, key
from runners.reports.figures.scene import frame_panel
from runners.reports.figures.style import BLUE, INK, new_figure, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


VALUES = ("raw", "weighted")
COLOURS = "viridis"  # from dark to light: readable with any colour vision and in grey
NO, YES = 0.0, 1.0  # on the colour scale, for a feature with two values only
TWO_NAMES = {  # what 0 and 1 mean for the paper's collision features
    "c_o": (": way blocked", ": way free"),
    "c_t": (": target blocked", ": target free"),
    "c_h": (": visited", ": not visited"),
}
UNITS = {"a_close": "m", "a_dev": "rad", "a_mount": "m"}
PAGE_IN, EDGE_IN, GAP_IN, WIDEST_IN = 7.0, 0.08, 0.12, 3.2
TITLE_IN, BELOW_IN = 0.22, 0.36  # above and below a panel
BAR_IN, BAR_TOP_IN = 0.08, 0.07  # height of a colour bar, its distance from the panel
KEY_LINE_IN, KEY_COLUMNS, NOTE_IN = 0.155, 4, 0.34


@dataclass(slots=True)
class FeaturesConfig(StepConfig):
    """Content of the figure of `lme figure features`."""

    criteria: list[str] | None
    values: str
    percentiles: list[float]

    def __post_init__(self) -> None:
        StepConfig.__post_init__(self)  # super() fails in a dataclass with slots
        if self.values not in VALUES:
            raise InputError(f"figure.values is {self.values!r}: must be one of {', '.join(VALUES)}")
        low, high = (*self.percentiles, math.nan, math.nan)[:2]
        if len(self.percentiles) != 2 or not 0 <= low < high <= 100:
            raise InputError(
                f"figure.percentiles is {self.percentiles}: must be two of 0 to 100, the lower first"
            )


class _Layer(NamedTuple):
    """A panel. values: (N,), one per candidate. lettered: whether E1, E2, A and B get their names.

    yes: (N,) whether the feature is 1, and names: of 0 and of 1; for a feature with only two values.
    """

    title: str
    values: Floats
    lettered: bool
    yes: Bools | None = None
    names: tuple[str, str] = ("", "")


class Features(DecisionFigure):
    """One panel for each criterion and one for S, in the robot frame with the heading up."""

    Config = FeaturesConfig
    name = "features"

    def figure(self, shot: DecisionView) -> Figure:
        """See `DecisionFigure`."""
        return features_figure(shot, self._config)


def features_figure(shot: DecisionView, config: FeaturesConfig) -> Figure:
    """Draw the page of one decision. Raises InputError for an unknown criterion."""
    layers = [_layer(shot.why, name, config.values) for name in chosen_criteria(shot.why, config.criteria)]
    layers.append(_Layer("$S$, the weighted sum", shot.why.scores, lettered=True))
    page = FeaturePage(shot, len(layers))
    # Each panel has the same scene, and its own candidates.
    for index, layer in enumerate(layers):
        axes = page.panel(index, layer.title)
        _draw_scene(axes, shot, layer.lettered)
        if layer.yes is not None:
            _draw_two(page, index, axes, layer, shot.why)
        else:
            _draw_many(page, index, axes, layer, shot.why, config.percentiles)
    page.label(config.percentiles)
    return page.figure


def chosen_criteria(explanation: Explanation, requested: Sequence[str] | None) -> list[str]:
    """Return the names of the criteria to draw, without S; all if `requested` is None.

    Raises InputError for an unknown criterion.
    """
    if requested is None:
        return list(explanation.names)
    names = [name for name in requested if name != "S"]
    for name in names:
        if name not in explanation.names:
            raise InputError(
                f"figure.criteria has {name!r}: {nearest(name, explanation.names)}the criteria are "
                f"{', '.join(explanation.names)}"
            )
    return names


def _layer(explanation: Explanation, name: str, values: str) -> _Layer:
    row = explanation.names.index(name)
    weight, raw = float(explanation.parameters.weights[row]), explanation.features[row]
    weighted = values == "weighted"
    letter = f"w_{row + 1}" if name in CRITERIA else "w"
    unit = "" if weighted or name not in UNITS else f" [{UNITS[name]}]"
    title = f"{symbol(name)}{unit} (${letter}$ = {weight:g})"
    layer = _Layer(
        f"${letter}$ {title}" if weighted else title,
        raw * weight if weighted else raw,
        lettered=name == "a_mount",
    )
    if not _is_two(name, raw):
        return layer
    no, yes = TWO_NAMES.get(name, ("", ""))
    return layer._replace(yes=raw > 0, names=(f"0{no}", f"{weight if weighted else 1:g}{yes}"))


def _is_two(name: str, raw: Floats) -> bool:
    """Return whether a feature has only the values 0 and 1. A custom criterion counts only if both occur."""
    values = set(np.unique(raw))
    return values == {0.0, 1.0} or (name in TWO_NAMES and values <= {0.0, 1.0})


def _draw_scene(axes: Axes, shot: DecisionView, lettered: bool) -> None:
    """Draw what all panels share."""
    explanation, scene = shot.why, shot.why.view
    view.draw_range(axes, explanation, candidate_reach(shot.trace))
    view.draw_scan(axes, explanation, 1.6)
    view.draw_history(axes, scene.history, 2.2)
    view.draw_robot(axes, shot.trace.robot.footprint)
    view.draw_target(axes, scene.target)
    if scene.blockage is not None:
        view.draw_contour(axes, scene.blockage.points, scene.radius, BLUE)
        rival = view.rival_subgoal(explanation)
        stars = [explanation.decision.subgoal, *([] if rival is None else [rival[1]])]
        view.draw_letters(axes, view.letters(scene.blockage, brief=True), 2.6, lettered, stars)
    view.draw_subgoals(axes, explanation)


def _draw_many(
    page: FeaturePage,
    index: int,
    axes: Axes,
    layer: _Layer,
    explanation: Explanation,
    percentiles: Sequence[float],
) -> None:
    """Draw the candidates coloured by value, and a colour bar."""
    values = layer.values + 0.0  # turns -0.0 into 0.0
    order = np.argsort(values, kind="stable")  # the best on top
    # A colour bar needs more than one value.
    if values[order[0]] == values[order[-1]]:
        _draw_points(axes, explanation.candidates, np.full(len(values), 0.5))
        style: dict[str, Any] = {"va": "top", "ha": "center", "fontsize": 7, "color": INK}
        page.figure.text(*page.below(index), f"\n{values[0]:g} for all candidates", **style)
        return
    low, high = clipped_range(values, percentiles)
    points = _draw_points(axes, explanation.candidates[order], values[order], low, high)
    extensions = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}
    bar = page.figure.colorbar(
        points,
        cax=page.bar(index),
        orientation="horizontal",
        extend=extensions[bool(values.min() < low), bool(values.max() > high)],
        extendfrac=0.06,
    )
    view.style_bar(bar, 4)


def clipped_range(values: Floats, percentiles: Sequence[float]) -> tuple[float, float]:
    """Return the ends of the colour scale: these percentiles, or the extremes if the percentiles are equal."""
    low, high = np.percentile(values, percentiles)
    return (float(low), float(high)) if low < high else (float(values.min()), float(values.max()))


def _draw_two(page: FeaturePage, index: int, axes: Axes, layer: _Layer, explanation: Explanation) -> None:
    """Draw the candidates in two colours, and a key with the count of each."""
    from matplotlib.lines import Line2D

    assert layer.yes is not None
    style: dict[str, Any] = {
        "marker": "o",
        "linestyle": "",
        "markersize": 3.5,
        "markeredgecolor": INK,
        "markeredgewidth": 0.3,
    }
    marks = []
    for mask, value, name in ((layer.yes, YES, layer.names[1]), (~layer.yes, NO, layer.names[0])):
        points = _draw_points(axes, explanation.candidates[mask], np.full(int(mask.sum()), value))
        marks.append(Line2D([], [], color=points.cmap(value), label=f"{name} ({mask.sum()})", **style))
    legend: dict[str, Any] = {
        "frameon": False,
        "fontsize": 7,
        "labelcolor": INK,
        "borderaxespad": 0.2,
        "handletextpad": 0.1,
    }
    draw_key(page.figure, marks, page.below(index), "upper center", labelspacing=0.15, **legend)


def _draw_points(axes: Axes, candidates: Floats, values: Floats, low: float = 0.0, high: float = 1.0) -> Any:
    edge: dict[str, Any] = {"edgecolors": INK, "linewidths": 0.15}
    x, y = view.upwards(candidates).T
    return axes.scatter(x, y, s=7, c=values, cmap=COLOURS, vmin=low, vmax=high, zorder=2, **edge)


def columns(panels: int) -> int:
    """Return the number of panels in a row, with a free place for the key if that adds no row."""
    return panels + 1 if panels < 4 else 3 if panels in (5, 6) else 4


class FeaturePage:
    """A page of equal panels, each with a title above and a colour bar below."""

    def __init__(self, shot: DecisionView, panels: int) -> None:
        self._shot = shot
        self._panels, self._columns = panels, columns(panels)
        self._box = view.reach_box(shot.why.candidates, candidate_reach(shot.trace))
        self._key = key(shot.why, candidate_reach(shot.trace), self._box)
        inner = PAGE_IN - 2 * EDGE_IN - (self._columns - 1) * GAP_IN
        self._width = min(inner / self._columns, WIDEST_IN)
        self._tall = self._width * (self._box.y1 - self._box.y0) / (self._box.x1 - self._box.x0)
        self._rows = math.ceil(panels / self._columns)
        key_rows = math.ceil(len(self._key) / KEY_COLUMNS)
        self._foot = NOTE_IN + (0 if self._has_place else key_rows * KEY_LINE_IN + 0.05)
        self._row = TITLE_IN + self._tall + BELOW_IN
        self._height = self._rows * self._row + self._foot
        self.figure = new_figure(PAGE_IN, self._height, layout=None)

    @property
    def _has_place(self) -> bool:
        return self._rows * self._columns > self._panels

    def panel(self, index: int, title: str) -> Axes:
        """Return the axes of a panel."""
        x, y = self._corner(index)
        axes = self._axes(x, y, self._width, self._tall)
        frame_panel(axes, self._box)
        axes.set_title(title, fontsize=8, color=INK, pad=3)
        return axes

    def bar(self, index: int) -> Axes:
        """Return the axes of the colour bar below a panel."""
        x, y = self._corner(index)
        inset = 0.06 * self._width
        return self._axes(x + inset, y - BAR_TOP_IN - BAR_IN, self._width - 2 * inset, BAR_IN)

    def below(self, index: int) -> tuple[float, float]:
        """Return the middle of a panel's lower edge, in figure coordinates."""
        x, y = self._corner(index)
        return (x + self._width / 2) / PAGE_IN, y / self._height

    def label(self, percentiles: Sequence[float]) -> None:
        """Draw the key and the note."""
        self._draw_key()
        low, high = percentiles
        text = (
            f"{len(self._shot.why.candidates)} candidates. Colours end at percentiles {low:g} and {high:g}; an arrow "
            f"on a bar: values lie beyond.\n{self._describe_sector()}"
        )
        corner = EDGE_IN / PAGE_IN, 0.05 / self._height
        self.figure.text(*corner, text, va="bottom", fontsize=7, color=INK)

    def _describe_sector(self) -> str:
        scene = self._shot.why.view
        if scene.blockage is None:
            return "No sector blocks the way to the target."
        if view.blockage_seen(self._shot.why, self._box) is None:
            return "The sector that blocks the way to the target lies beyond this view."
        end_number = "1" if np.array_equal(scene.blockage.A, scene.blockage.E1) else "2"
        return (
            f"The blocking sector is outlined at $r$ = {scene.radius:.3g} m. $A$, here "
            f"$E_{end_number}$, is the end of it that is nearer in angle to the target."
        )

    def _draw_key(self) -> None:
        if not self._has_place:
            anchor = (0.5, (NOTE_IN + 0.02) / self._height)
            draw_key(self.figure, self._key, anchor, "lower center", ncols=KEY_COLUMNS, **view.KEY)
            return
        x, y = self._corner(self._rows * self._columns - 1)
        anchor = (x / PAGE_IN, (y + self._tall) / self._height)
        draw_key(self.figure, self._key, anchor, "upper left", labelspacing=0.35, **view.KEY)

    def _corner(self, index: int) -> tuple[float, float]:
        """Return the lower left corner of a panel [in]; the grid is centred on the page."""
        row, column = divmod(index, self._columns)
        grid_width = self._columns * (self._width + GAP_IN) - GAP_IN
        x = (PAGE_IN - grid_width) / 2 + column * (self._width + GAP_IN)
        return x, self._height - row * self._row - TITLE_IN - self._tall

    def _axes(self, x: float, y: float, width: float, height: float) -> Axes:
        return self.figure.add_axes((x / PAGE_IN, y / self._height, width / PAGE_IN, height / self._height))
