"""Robots from above, side by side at one scale."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError, require
from lme.robots import Lidar, Robot
from lme.types import Floats
from runners.config.catalogue import Catalogue, shipped
from runners.config.escaping import plot_text
from runners.config.map_sets import choose_robot
from runners.reports.figures.driven_runs import DrivenRun
from runners.reports.figures.robot_view import upwards
from runners.reports.figures.scene import (
    POINTER,
    Around,
    Box,
    aspect_of,
    lay_out,
    outline,
    panel_width,
    same_size,
    scale_bar,
    wrapped,
)
from runners.reports.figures.style import (
    BLUE,
    INK,
    ORANGE,
    PAGE_IN,
    VERMILION,
    entitle,
    new_figure,
    page_width,
    save,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

ROBOTS = 12  # at most: more would be too small to read
MARGIN = 0.12  # around a robot, as a share of its longest side
PANEL_IN = 3.4  # width of a panel, at most
PAGE_HEIGHT_IN = 9.5  # at most
KEYS_IN = 3.6  # width of two columns of the key
NAME = 34  # letters above a panel, at most
NOSE = 0.35  # size of the pointer, as a share of the smaller half of the outline

BODY: dict[str, Any] = {"facecolor": "#6FA8D0", "edgecolor": INK, "linewidth": 0.8}
STOPPED: dict[str, Any] = {"facecolor": "none", "edgecolor": BLUE, "linewidth": 0.9, "linestyle": ":"}
CONTACT: dict[str, Any] = {"facecolor": "none", "edgecolor": VERMILION, "linewidth": 1.0}
RADIUS: dict[str, Any] = {"facecolor": "none", "edgecolor": INK, "linewidth": 0.8, "linestyle": "--"}
SEEN: dict[str, Any] = {"facecolor": ORANGE, "edgecolor": "none", "alpha": 0.18}
LIDAR: dict[str, Any] = {
    "marker": "o", "color": ORANGE, "markersize": 5, "markeredgecolor": INK, "markeredgewidth": 0.6,
}  # fmt: skip


@dataclass(slots=True)
class RobotsConfig:
    """Keys of `conf/figure/robot.yaml`."""

    robots: list[str] | None
    columns: int
    width: float

    def __post_init__(self) -> None:
        require("columns", self.columns, at_least=1, at_most=6)
        require("width", self.width, at_least=2.0)
        if self.robots is not None and not 0 < len(self.robots) <= ROBOTS:
            raise InputError(
                f"figure.robots holds {len(self.robots)} robots: must hold 1 to {ROBOTS}, or be null for that of robot="
            )


class Robots:
    """A kind of figure: see `runners.reports.figures.driven_runs.Kind`."""

    Config = RobotsConfig
    name = "robot"
    drives = False
    guided = None

    def __init__(self, config: RobotsConfig, robot: Robot, configs: Catalogue | None = None) -> None:
        """Choose the robots: those of the config, or else `robot`. Raises InputError for one that does not exist."""
        self._config, self._robots = config, [robot]
        if config.robots is not None:
            self._robots = [_chosen(entry, configs or shipped()) for entry in config.robots]

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Draw the robots; return the paths."""
        figure = sheet(self._robots, self._config.columns, self._config.width)
        entitle(figure)
        return save(figure, stem, formats)


def _chosen(entry: str, configs: Catalogue) -> Robot:
    """Return the robot of "NAME [key=value…]", with the entry as its name."""
    name, *settings = entry.split() or [""]
    try:
        robot = choose_robot([f"robot={name}", *(f"robot.{setting}" for setting in settings)], configs)
        return replace(robot, name=entry)
    except InputError as error:
        raise InputError(f"figure.robots holds {entry!r}: {error}") from error


def stopping_distance(robot: Robot) -> float:
    """Distance from the top speed to a stop that is commanded one control period later [m]."""
    return robot.v_max * robot.dt + robot.v_max**2 / (2.0 * robot.alpha_v)


def ahead(robot: Robot) -> Floats:
    """Displacement (2,) of the robot until it has stopped from its top speed, in its frame [m]."""
    return np.array([stopping_distance(robot), 0.0])


def sheet(robots: Sequence[Robot], columns: int, width_in: float = PAGE_IN) -> Figure:
    """Draw the robots in rows, heading up, all at the scale of the largest. width_in: of the page, at most [in]."""
    boxes = same_size([_box(robot) for robot in robots])
    keys = _keys(robots)
    page = (page_width(width_in), PAGE_HEIGHT_IN)
    per_line = 3 if len(robots) > 1 and page[0] > KEYS_IN else 2
    around = Around(title=0.76, foot=0.22, footer=0.18 * math.ceil(len(keys) / per_line) + 0.1)
    columns = min(columns, len(robots))
    width = min(panel_width(columns, len(robots), aspect_of(boxes[0]), page, around), PANEL_IN)
    figure = new_figure(*page, layout=None)
    rows = lay_out(figure, wrapped(boxes, columns), width, around, least_in=min(KEYS_IN, page[0]))
    for axes, robot, box in zip([axes for row in rows for axes in row], robots, boxes, strict=True):
        _draw(axes, robot, box)
        scale_bar(axes, box, 0.3, 7.0)
        axes.set_title(
            plot_text(shorten(robot.name, NAME, placeholder="…")),
            fontsize=8.5,
            fontweight="bold",
            color=INK,
            pad=36,
        )
        axes.annotate(
            plot_text(describe(robot)), (0.5, 1.0), (0, 3), xycoords="axes fraction", textcoords="offset points",
            ha="center", va="bottom", fontsize=7, color=INK, linespacing=1.15,
        )  # fmt: skip
    figure.legend(
        handles=keys,
        loc="lower center",
        ncols=per_line,
        frameon=False,
        fontsize=7,
        labelcolor=INK,
        handlelength=1.6,
    )
    return figure


def describe(robot: Robot) -> str:
    """Return three lines: limits and control rate, the distance to a stop, and the lidar."""
    lidar = robot.lidar
    return (
        f"{robot.v_max:.3g} m/s, {robot.omega_max:.3g} rad/s, {robot.control_rate:.3g} Hz\n"
        f"stops in {stopping_distance(robot):.2g} m\n"
        f"{lidar.num_beams} beams, {math.degrees(lidar.fov):.0f}°, {lidar.range_min:g}–{lidar.range_max:g} m"
    )


def _box(robot: Robot) -> Box:
    """Return the view: all that is drawn of the robot but the field of view, with a margin."""
    stopped = outline(robot.footprint) + ahead(robot)
    radius = robot.r * np.array([(1.0, 1.0), (-1.0, -1.0)])
    drawn = [outline(robot.footprint), stopped, radius, np.array([robot.lidar.sensor[:2]])]
    if robot.drivetrain is not None and robot.drivetrain.contact is not None:
        drawn.append(outline(robot.drivetrain.contact))
    points = upwards(np.vstack(drawn))
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * (high - low).max()
    return Box(*(low - margin).tolist(), *(high + margin).tolist())


def _draw(axes: Axes, robot: Robot, box: Box) -> None:
    from matplotlib.patches import Circle, Polygon

    reach = math.hypot(box.x1 - box.x0, box.y1 - box.y0)
    axes.add_patch(Polygon(upwards(field_of_view(robot.lidar, reach)), zorder=1, **SEEN))
    axes.add_patch(Circle((0.0, 0.0), robot.r, zorder=3.5, **RADIUS))
    shape = outline(robot.footprint)
    axes.add_patch(Polygon(upwards(shape + ahead(robot)), zorder=2, **STOPPED))
    axes.add_patch(Polygon(upwards(shape), zorder=3, **BODY))
    if robot.drivetrain is not None and robot.drivetrain.contact is not None:
        axes.add_patch(Polygon(upwards(outline(robot.drivetrain.contact)), zorder=4, **CONTACT))
    nose = NOSE * robot.footprint.inscribed_radius * np.array(POINTER)
    axes.add_patch(Polygon(upwards(nose), zorder=4, facecolor="white", linewidth=0))
    axes.plot(*upwards(np.array(robot.lidar.sensor[:2])), zorder=5, linestyle="", **LIDAR)


def field_of_view(lidar: Lidar, reach: float) -> Floats:
    """Corners (V, 2) of the sector that the lidar sees up to `reach` [m], in the robot frame."""
    bearings = lidar.yaw + np.linspace(lidar.angle_min, lidar.angle_min + lidar.fov, 73)
    arc = reach * np.column_stack([np.cos(bearings), np.sin(bearings)])
    corners = arc if lidar.full_circle else np.vstack([np.zeros((1, 2)), arc])
    seen: Floats = corners + np.array(lidar.sensor[:2])
    return seen


def _keys(robots: Sequence[Robot]) -> list[Line2D | Patch]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys: list[Line2D | Patch] = [
        Patch(label="footprint", **BODY),
        Line2D([], [], label="collision radius of LME", color=INK, linewidth=0.8, linestyle="--"),
        Line2D([], [], label="where it stops from full speed", color=BLUE, linewidth=0.9, linestyle=":"),
        Line2D([], [], label="lidar", linestyle="", **LIDAR),
        Patch(label="field of view", **SEEN),
    ]
    if any(robot.drivetrain is not None and robot.drivetrain.contact is not None for robot in robots):
        keys.append(Line2D([], [], label="outline that collides", color=VERMILION, linewidth=1.0))
    return keys
