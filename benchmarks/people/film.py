"""Makes a film of a recording: the scan, and the tracks with their names, ways and velocities.

    python -m benchmarks.people.film [--shared ../shared] [--recording 3] [--start 10] [--end 30] [--to people.gif]

A GIF or, by the suffix, an MP4. Nothing but the scan is drawn and used; the labels are not.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.command import run_main
from benchmarks.people.labels import Recording, read
from benchmarks.people.tracked import tracked
from lme.perception.people.interface import Tracks
from lme.types import Ints
from runners.reports.figures.animation import Picture, write_film
from runners.reports.figures.style import new_figure

_SIZE, _DPI = (8.0, 4.5), 100  # [in], [1/in]
_BOX = (-3.0, 11.0, -3.5, 4.4)  # [m] x from, to, y from, to
_WAY = 20  # scans for which the way of a track is drawn
_COLOURS = (
    "tab:blue",
    "tab:orange",
    "tab:green",
    "tab:red",
    "tab:purple",
    "tab:brown",
    "tab:pink",
    "tab:olive",
)
_SAMPLE = 5  # pictures from which the colours of a GIF are chosen


def main() -> None:
    """Write the film."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--shared", type=Path, default=Path("../shared"), help="folder of the recordings")
    options.add_argument("--recording", type=int, default=3, choices=range(1, 8))
    options.add_argument("--start", type=float, default=0.0, help="[s]")
    options.add_argument("--end", type=float, default=np.inf, help="[s]")
    options.add_argument("--to", type=Path, default=Path("people.gif"), help="a GIF or an MP4")
    arguments = options.parse_args()
    film(
        arguments.shared / "bags" / "legs" / f"positive_{arguments.recording}.bag",
        arguments.start,
        arguments.end,
        arguments.to,
    )
    print(f"film     {arguments.to}")


def film(bag: Path, start: float, end: float, to: Path) -> None:
    """Track a recording, and film its part from `start` to `end` [s]."""
    recording = read(bag)
    tracks = [tracks_of_scan for tracks_of_scan, _ in tracked(recording)]
    scans = np.flatnonzero((recording.times >= start) & (recording.times <= end))
    sample = scans[:: max(len(scans) // _SAMPLE, 1)]
    rate = 1.0 / float(np.median(np.diff(recording.times)))
    write_film(_pictures(recording, tracks, scans), to, rate, list(_pictures(recording, tracks, sample)))


def _pictures(recording: Recording, tracks: list[Tracks], scans: Ints) -> Iterator[Picture]:
    """A picture of each of the scans."""
    figure = new_figure(*_SIZE, dpi=_DPI, layout=None)
    canvas: Any = figure.canvas
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    angles = recording.angle_min + recording.angle_increment * np.arange(recording.ranges.shape[1])
    for k in scans:
        axes.clear()
        axes.set(xlim=_BOX[:2], ylim=_BOX[2:], aspect="equal")
        axes.set_axis_off()
        is_return = recording.ranges[k] > 0.0
        points = recording.ranges[k][:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        axes.plot(*points[is_return].T, ".", color="0.35", markersize=2.5)
        axes.plot(0.0, 0.0, "^", color="black", markersize=8)
        axes.text(_BOX[0] + 0.2, _BOX[3] - 0.5, f"{recording.times[k]:.1f} s", fontsize=11)
        for name, (x, y, vx, vy), radius in zip(*tracks[k][:3], strict=True):
            colour = _COLOURS[name % len(_COLOURS)]
            history = [
                scan_tracks.pedestrians[scan_tracks.names == name]
                for scan_tracks in tracks[max(k - _WAY, 0) : k + 1]
            ]
            axes.plot(*np.vstack(history)[:, :2].T, "-", color=colour, linewidth=1.5)
            circle = np.linspace(0.0, 2.0 * np.pi, 40)
            axes.plot(x + radius * np.cos(circle), y + radius * np.sin(circle), color=colour, linewidth=1.8)
            axes.annotate("", (x + vx, y + vy), (x, y), arrowprops={"arrowstyle": "->", "color": colour})
            axes.text(x + radius, y + radius, str(name), color=colour, fontsize=11, fontweight="bold")
        canvas.draw()
        yield np.array(canvas.buffer_rgba())[..., :3]


if __name__ == "__main__":
    run_main(main)
