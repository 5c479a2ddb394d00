"""A film of an episode, several systems side by side."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lme.errors import InputError, require
from runners.reports.figures.animation import GIF, MP4, FilmPace, Picture, Screen, find_ffmpeg, write_film
from runners.reports.figures.driven_runs import DrivenRun, chosen_world
from runners.workers.trace import Trace

PANELS = 6  # at most: more cannot be seen at once
ENOUGH_S = 20.0  # longest film if no speed is given


@dataclass(slots=True)
class FilmConfig:
    """Appearance of a film."""

    format: str
    speed: float | None
    fps: float
    width: int

    def __post_init__(self) -> None:
        if self.format not in (GIF, MP4):
            raise InputError(f"figure.format is {self.format!r}: must be {GIF} or {MP4}")
        if self.format == MP4:
            find_ffmpeg()
        if self.speed is not None:
            require("speed", self.speed, above=0.0)
        require("fps", self.fps, above=0.0, at_most=50.0)
        require("width", self.width, at_least=200, at_most=4000)


@dataclass(slots=True)
class VideoConfig(FilmConfig):
    """Appearance of a film, and whether it shows candidates."""

    candidates: bool


class Video:
    """The kind `video` of `lme figure`."""

    Config = VideoConfig
    name = "video"
    drives = True
    guided = None

    def __init__(self, config: VideoConfig) -> None:
        self._config = config

    def draw(
        self, runs: Sequence[DrivenRun], worlds: Sequence[int], stem: Path, formats: Sequence[str]
    ) -> list[Path]:
        """Save the film of the runs as `stem`.gif or `stem`.mp4, and return its path. formats: ignored.

        Raises InputError for too many panels, or for an episode that cannot be driven again.
        """
        config = self._config
        episodes = select_episodes(runs, worlds)
        traces = [driven_run.trace(world, run) for driven_run, world, run in episodes]
        pace, speed = pace_of(traces, config.speed, config.fps)
        note = "" if speed == 1.0 else f"{speed:.3g}× real time"
        screen = Screen(traces, labels_of(episodes), config.width, candidates=config.candidates, note=note)
        path = stem.with_name(f"{stem.name}.{config.format}")
        pictures = with_progress(screen.pictures(pace.held), len(pace.held))
        write_film(pictures, path, pace.fps, screen.sample(pace.times))
        return [path]


def with_progress(pictures: Iterator[Picture], total: int) -> Iterator[Picture]:
    """Yield the pictures, with a progress bar on standard error."""
    from rich.progress import track

    from runners.workers.progress import error_console

    yield from track(pictures, "Drawing", total, console=error_console())


def select_episodes(runs: Sequence[DrivenRun], worlds: Sequence[int]) -> list[tuple[DrivenRun, int, int]]:
    """Return (driven run, world, run number) of each panel.

    Without worlds, a panel shows the first world of the first run in each place.
    """
    episodes = []
    # Runs in one place show the same world.
    for driven_run in runs:
        reference = next(candidate for candidate in runs if candidate.place == driven_run.place)
        for world in worlds or [chosen_world(reference, [])[0]]:
            episodes.append((driven_run, *chosen_world(driven_run, [world])))
    if len(episodes) > PANELS:
        raise InputError(
            f"{len(runs)} runs make {len(episodes)} panels; at most {PANELS} fit at once: choose fewer systems, or "
            "one world"
        )
    return episodes


def pace_of(traces: Sequence[Trace], speed: float | None, fps: float) -> tuple[FilmPace, float]:
    """Return the time of each frame, and the speed relative to real time."""
    duration = max(trace.end.time for trace in traces)
    speed = speed if speed is not None else max(1.0, duration / ENOUGH_S)
    times = np.arange(0.0, duration - 1e-9, speed / fps)
    return FilmPace(np.append(times, duration), fps), speed


def labels_of(episodes: Sequence[tuple[DrivenRun, int, int]]) -> list[str]:
    """Return the label above each panel: the system, the map and world, or both, whichever differ."""
    systems = [driven_run.label for driven_run, _, _ in episodes]
    world_labels = [f"{driven_run.frame['map'].iloc[0]}, world {world}" for driven_run, world, _ in episodes]
    if len(set(world_labels)) == 1:
        return systems
    if len(set(systems)) == 1:
        return world_labels
    return [f"{system}: {world_label}" for system, world_label in zip(systems, world_labels, strict=True)]
