"""Animated episodes side by side, all at the same simulated time."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lme.types import Floats, Outcome
from runners.config.escaping import plot_text
from runners.config.schema import DriveConfig
from runners.reports.figures.film import Picture, write_film
from runners.reports.figures.layout import Around, aspect_of, best_columns, lay_out, panel_width, wrapped
from runners.reports.figures.scene import Box, common_box, draw_task, same_size
from runners.reports.figures.stage import Stage, index_at
from runners.reports.figures.style import BLUE, END, INK, STYLES, new_figure
from runners.workers.trace import Trace, rerun

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

DPI = 100
WIDTH_PX = 560
TALL = 0.75  # height over width of a film, at most
MOST_FRAMES = 150  # a longer episode shows every second, third, … decision
LAST_S = 1.0  # duration of the last frame
LINE_IN, LETTER_IN, SIZE_PT = 0.16, 0.058, 8
SAMPLE = 5  # number of frames from which a GIF's colours are chosen
KEY = "orange: laser scan · star: subgoal · line: the way so far"
CANDIDATES_KEY = "dots: candidates, the brighter the higher their score S"


class FilmPace(NamedTuple):
    """The times of a film. times: simulated time of each frame [s]. fps: of the film [1/s]."""

    times: Floats
    fps: float

    @property
    def held(self) -> Floats:
        """Return the times, with the last one repeated for `LAST_S`."""
        return np.append(self.times, np.full(math.ceil(LAST_S * self.fps), self.times[-1]))


def animate(config: DriveConfig, world: int, run: int, path: Path) -> Outcome:
    """Drive one episode of a config as `lme eval` does, save it as GIF, and return its outcome."""
    trace = rerun(config, world, run)
    all_times = np.array([frame.time for frame in trace.frames])
    stride = math.ceil(len(all_times) / MOST_FRAMES)
    pace = FilmPace(np.append(all_times[:-1:stride], all_times[-1]), trace.robot.control_rate / stride)
    screen = Screen([trace], [""], WIDTH_PX)
    write_film(screen.pictures(pace.held), path, pace.fps, screen.sample(pace.times))
    return Outcome(trace.episode.outcome)


class Screen:
    """Panels of one size, one per episode, drawn at one moment after another.

    The static part is drawn once; the moving part is drawn on top of it for every picture.
    """

    def __init__(
        self,
        traces: Sequence[Trace],
        labels: Sequence[str],
        width_px: int,
        *,
        candidates: bool = False,
        note: str = "",
    ) -> None:
        """Lay out the panels. labels: above panels, empty for none. width_px: at most. note: text before the key."""
        boxes = same_size([_box(trace, traces) for trace in traces])
        page = (width_px / DPI, TALL * width_px / DPI)
        margins = Around(title=LINE_IN * (1 + any(labels)) + 0.08, footer=2 * LINE_IN, header=0.04)
        columns = best_columns(len(traces), aspect_of(boxes[0]), page, margins)
        width = panel_width(columns, len(traces), aspect_of(boxes[0]), page, margins)
        self._figure = new_figure(*page, DPI, layout=None)
        rows = lay_out(self._figure, wrapped(boxes, columns), width, margins)
        all_axes = [axes for row in rows for axes in row]
        self._panels = [
            _Panel(axes, trace, label, candidates)
            for axes, trace, label in zip(all_axes, traces, labels, strict=True)
        ]
        text = " · ".join(filter(None, [note, KEY, CANDIDATES_KEY if candidates else ""]))
        lines = textwrap.fill(text, int(self._figure.get_figwidth() / LETTER_IN))
        bottom_text_y = (margins.footer + 0.06) / self._figure.get_figheight()
        self._figure.text(0.5, bottom_text_y, lines, ha="center", va="top", fontsize=7, color=INK)
        self._still: Any = None

    def pictures(self, times: Sequence[float] | Floats) -> Iterator[Picture]:
        """Return one picture for each of the times [s]."""
        return (self.at(time) for time in times)

    def sample(self, times: Floats) -> list[Picture]:
        """Return a few pictures, evenly spread over the times."""
        indices = np.linspace(0, len(times) - 1, SAMPLE).round().astype(int)
        return list(self.pictures(times[indices]))

    def at(self, time_s: float) -> Picture:
        """Return the picture at this time, (height, width, 3)."""
        # Draw the static part once, and restore it for every picture.
        canvas: Any = self._figure.canvas
        if self._still is None:
            canvas.draw()
            self._still = canvas.copy_from_bbox(self._figure.bbox)
        canvas.restore_region(self._still)
        for panel in self._panels:
            panel.show(time_s)
        return np.array(canvas.buffer_rgba())[..., :3]


class _Panel:
    """The panel of one episode."""

    def __init__(self, axes: Axes, trace: Trace, label: str, candidates: bool) -> None:
        self._axes, self._trace = axes, trace
        self._way = np.array([frame.pose[:2] for frame in trace.frames])
        draw_task(axes, trace.task)
        text: dict[str, Any] = {
            "fontsize": SIZE_PT,
            "color": INK,
            "ha": "center",
            "textcoords": "offset points",
        }
        above: dict[str, Any] = {"xy": (0.5, 1.0), "xycoords": "axes fraction", "annotation_clip": False}
        axes.annotate(plot_text(label), xytext=(0, 3 + 72 * LINE_IN), weight="bold", **above, **text)
        self._clock = axes.annotate("", xytext=(0, 4), **above, **text)
        (self._trail,) = axes.plot([], [], color=BLUE, linewidth=1.2, zorder=3)
        self._stage = Stage(axes, trace, candidates=candidates)
        style = STYLES[Outcome(trace.episode.outcome)]
        (self._end_mark,) = axes.plot(
            [], [], marker=style.marker, color=style.colour, linestyle="", zorder=8, **END
        )
        self._moving: list[Artist] = [self._trail, *self._stage.artists, self._end_mark, self._clock]
        for artist in self._moving:
            artist.set_animated(True)

    def show(self, time_s: float) -> None:
        """Draw the frame at this time, or the end if the episode has ended."""
        index = index_at(self._trace, time_s)
        self._stage.show(index)
        self._trail.set_data(*self._way[: index + 1].T)
        outcome, over = Outcome(self._trace.episode.outcome), index == len(self._trace.steps)
        self._end_mark.set_data(*(self._way[-1:].T if over else ([], [])))
        clock = f"{self._trace.frames[index].time:.1f} s"
        self._clock.set_text(f"{outcome}, {clock}" if over else clock)
        self._clock.set_color(STYLES[outcome].colour if over else INK)
        for artist in self._moving:
            self._axes.draw_artist(artist)


def _box(trace: Trace, traces: Sequence[Trace]) -> Box:
    """Return the box of the world that is shown, which is the same for all episodes in the world."""
    traces_in_world = [
        peer for peer in traces if (peer.config.map, peer.world) == (trace.config.map, trace.world)
    ]
    paths = [np.array([frame.pose[:2] for frame in peer.frames]) for peer in traces_in_world]
    return common_box([trace.task], np.vstack(paths))
