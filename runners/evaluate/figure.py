"""Draw the figure of one job: drive episodes if none are given, then draw the picture."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lme.errors import InputError
from runners.config import build, instantiate
from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.map_sets import parse_worlds
from runners.config.schema import FigureConfig
from runners.evaluate.evaluate import drive, page_of, resume_hint, run_labels
from runners.records.launch_record import LAUNCH
from runners.records.records import find_runs
from runners.reports.figures.driven_runs import Kind, check_guided, read_runs
from runners.reports.figures.style import FORMATS, drawn_on


def validate(job: Job[FigureConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    config, kind = job.config, _kind(job)
    worlds_of(config.world)
    if not config.formats or not set(config.formats) <= set(FORMATS):
        raise InputError(f"formats is {config.formats}: must be some of {', '.join(FORMATS)}")
    if config.run is not None:
        find_runs([Path(config.run)])
    elif kind.drives:
        job.check_scale()
        build.check_drive(_with_worlds(config), num_tasks=None)


def figure(job: Job[FigureConfig]) -> None:
    """Drive the episodes that the figure shows; draw the figure too, unless the job is part of a sweep."""
    kind = _kind(job)
    drives = job.config.run is None and kind.drives
    if drives:
        _check_guide(job, kind)
        driven = replace(job, config=_with_worlds(job.config))
        maps = build.map_set(driven.config)
        with resume_hint("figure", job.run_dir):
            drive(driven.config, run_labels(driven, maps), maps, job.run_dir)
    if job.sweep_dir is not None:
        return
    try:
        _draw(job, [job.run_dir], job.run_dir)
    except (InputError, KeyboardInterrupt):
        if not drives:
            _remove_unless_drawn(job.run_dir)
        raise


def draw_sweep(job: Job[FigureConfig], run_dirs: Sequence[Path]) -> None:
    """Draw one figure of all jobs of a sweep. job: the first one."""
    assert job.sweep_dir is not None
    _draw(job, run_dirs, job.sweep_dir)


def worlds_of(world: Any) -> list[int]:
    """Return the requested worlds: numbers, ranges, or a list of them; null for none. Raises InputError."""
    if world is None:
        return []
    numbers = parse_worlds(world, "world")
    if not isinstance(numbers, list) or not numbers or any(type(number) is not int for number in numbers):
        raise InputError(f"world is {world!r}: must be a number, or a list of numbers")
    return numbers


def _draw(job: Job[FigureConfig], run_dirs: Sequence[Path], folder: Path) -> None:
    """Draw the runs that the config names, or else those just driven, and print the paths of the files."""
    config, kind = job.config, _kind(job)
    runs = run_dirs if config.run is None else [Path(config.run)]
    driven_runs = read_runs(runs) if kind.drives else []
    if kind.drives and not driven_runs:
        raise InputError(f"run is {config.run}: there is no {LAUNCH} with its config, so it cannot be drawn")
    with drawn_on(page_of(config)):
        paths = kind.draw(driven_runs, worlds_of(config.world), folder / kind.name, config.formats)
    print("\n".join(map(str, paths)))


def _check_guide(job: Job[FigureConfig], kind: Kind) -> None:
    """Raise InputError before driving if the figure cannot draw this guide; a sweep's figure leaves it out."""
    if kind.guided is None or job.sweep_dir is not None:
        return
    try:
        check_guided([job.config], kind.name, kind.guided)
    except InputError:
        _remove_unless_drawn(job.run_dir)
        raise


def _remove_unless_drawn(run_dir: Path) -> None:
    """Remove the directory of a figure that was not drawn, unless it holds more than the launch record."""
    if {path.name for path in run_dir.iterdir()} <= {LAUNCH, ".hydra"}:
        shutil.rmtree(run_dir)


def _kind(job: Job[FigureConfig]) -> Kind:
    cls, config = instantiate.configured(job.config.figure, "figure")
    args = (config,) if cls.drives else (config, job.config.robot, Catalogue(job.folders))
    kind: Kind = cls(*args)
    return kind


def _with_worlds(config: FigureConfig) -> FigureConfig:
    """Return the config with the worlds to drive: those requested, those that the map set names, or its first."""
    worlds = worlds_of(config.world) or config.map.get("worlds") or [build.map_set(config).numbers[0]]
    return replace(config, map={**config.map, "worlds": worlds})
