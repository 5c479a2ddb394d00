"""Animated episodes side by side, all at the same simulated time, as films: GIF through Pillow, MP4 through ffmpeg."""

from __future__ import annotations

import contextlib
import math
import shutil
import subprocess
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.requirements import install
from lme.types import Floats, Outcome
from runners.config.escaping import plot_text
from runners.config.schema import DriveConfig
from runners.records.atomic_write import replacing
from runners.reports.figures.scene import (
    Around,
    Box,
    aspect_of,
    best_columns,
    common_box,
    draw_task,
    lay_out,
    panel_width,
    same_size,
    wrapped,
)
from runners.reports.figures.stage import Stage, index_at
from runners.reports.figures.style import BLUE, END, INK, STYLES, new_figure
from runners.workers.trace import Trace, rerun

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from PIL import Image


DPI = 100
WIDTH_PX = 560
TALL = 0.75  # height over width of a film, at most
MOST_FRAMES = 150  # a longer episode shows every second, third, … decision
LAST_S = 1.0  # duration of the last frame
LINE_IN, LETTER_IN, SIZE_PT = 0.16, 0.058, 8
SAMPLE = 5  # number of frames from which a GIF's colours are chosen
KEY = "orange: laser scan · star: subgoal · line: the way so far"
CANDIDATES_KEY = "dots: candidates, the brighter the higher their score S"
Picture = NDArray[np.uint8]  # (height, width, 3)

GIF, MP4 = "gif", "mp4"
COLOURS = 200  # in the palette of a GIF, at most
APART = 12  # least difference between two of them in some channel, of 0 to 255
QUALITY = "23"  # of x264: the encoder's own default; lower is better and larger


class FilmPace(NamedTuple):
    """The times of a film. times: simulated time of each frame [s]. fps: of the film [1/s]."""

    times: Floats
    fps: float

    @property
    def held(self) -> Floats:
        """Return the times, with the last one repeated for `LAST_S`."""
        return np.append(self.times, np.full(math.ceil(LAST_S * self.fps), self.times[-1]))


def animate(config: DriveConfig, world: int, path: Path) -> Outcome:
    """Drive the first episode of a world as `lme eval` does, save it as GIF, and return its outcome."""
    trace = rerun(config, world, 0)
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


def write_film(pictures: Iterable[Picture], path: Path, fps: float, sample: Sequence[Picture]) -> None:
    """Save pictures of one size as GIF or MP4, by the suffix of `path`. A failure leaves no partial file.

    fps: [1/s]. sample: pictures from which the colours of a GIF are chosen. Raises InputError if ffmpeg is missing or
    fails.
    """
    with replacing(path) as draft:
        if path.suffix == f".{GIF}":
            _write_gif(pictures, draft, fps, sample)
        else:
            _write_mp4(pictures, draft, fps)


def find_ffmpeg() -> str:
    """Return the path of ffmpeg: from PATH, else from imageio-ffmpeg. Raises InputError if there is neither."""
    executable = shutil.which("ffmpeg")
    if executable is not None:
        return executable
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise InputError(
            "figure.format is mp4: needs ffmpeg, which is not on the PATH: install it, or "
            f"{install('imageio-ffmpeg')}, or choose figure.format=gif"
        ) from None


def _write_gif(pictures: Iterable[Picture], path: Path, fps: float, sample: Sequence[Picture]) -> None:
    """Write a GIF with one palette for all frames, so that each stores only its differences from the previous one."""
    from PIL import Image

    palette = _palette(np.vstack(sample))

    def quantized() -> Iterator[Image.Image]:
        for picture in pictures:
            yield Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)

    frames = quantized()
    image = next(frames)
    hundredths = max(round(100.0 / fps), 2)  # [0.01 s], the unit of a GIF; browsers ignore less than 2
    image.save(path, save_all=True, append_images=frames, duration=10 * hundredths, loop=0, optimize=False)


def _palette(picture: Picture) -> Image.Image:
    """Return the most frequent clearly different colours: Pillow's fast quantizer confuses similar ones."""
    from PIL import Image

    colours, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    # Take the most frequent colour that is left, and drop those near to it.
    remaining = colours[np.argsort(-counts, kind="stable")].astype(int)
    palette_colours: list[NDArray[np.int_]] = []
    while len(remaining) and len(palette_colours) < COLOURS:
        palette_colours.append(remaining[0])
        remaining = remaining[np.abs(remaining - remaining[0]).max(axis=1) >= APART]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.ravel(palette_colours).tolist())
    return palette


def _write_mp4(pictures: Iterable[Picture], path: Path, fps: float) -> None:
    """Pipe raw frames to ffmpeg, which pads the sides to even lengths, as yuv420p requires."""
    frames = iter(pictures)
    image = next(frames)
    height, width = image.shape[:2]
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-"]
    mp4 = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-c:v", "libx264", "-crf", QUALITY]
    mp4 += ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [find_ffmpeg(), "-y", "-loglevel", "error", *raw, *mp4, str(path)]
    # Send one frame after the other; if ffmpeg fails, the last line of its output is the reason.
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        assert encoder.stderr is not None
        with contextlib.suppress(BrokenPipeError):  # ffmpeg gives the reason on standard error
            for picture in chain([image], frames):
                encoder.stdin.write(picture.tobytes())
        with contextlib.suppress(BrokenPipeError):
            encoder.stdin.close()
        error = encoder.stderr.read().decode(errors="replace").strip()
    if encoder.returncode != 0:
        reason = error.splitlines()[-1] if error else f"exit status {encoder.returncode}"
        raise InputError(f"figure.format is mp4: {command[0]} failed ({reason}); choose figure.format=gif")
