"""One figure from one composed config: episodes where none are given, then the picture."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from lme.errors import InputError
from runners.config import build
from runners.config.composer import without_hydra
from runners.config.instantiate import build as build_target
from runners.experiments import evaluate
from runners.figures.parts.jobs import Kind, read_jobs
from runners.figures.parts.style import FORMATS
from runners.records.launch_record import LAUNCH
from runners.records.records import find_runs


def validate(config: DictConfig) -> None:
    """Build what is cheap to build, so that mistakes show before anything runs. Raises InputError."""
    plain = build.plain(config)
    kind = _kind(plain)
    _worlds(plain)
    if not plain["formats"] or not set(plain["formats"]) <= set(FORMATS):
        raise InputError(f"formats is {plain['formats']}: must be some of {', '.join(FORMATS)}")
    if plain["run"] is not None:
        find_runs([Path(plain["run"])])
    elif kind.drives:
        build.check_drive(_with_worlds(plain))


def prepare(config: DictConfig, run_dir: Path) -> None:
    """Drive the episodes that the figure shows; of a figure that is no sweep, draw it too."""
    plain = build.plain(config)
    drives = plain["run"] is None and _kind(plain).drives
    if drives:
        _drive(_with_worlds(plain), run_dir)
    if evaluate.sweep_directory() is not None:
        return
    try:
        draw(config, [run_dir], run_dir)
    except (InputError, KeyboardInterrupt):
        if not drives:
            _leave(run_dir)
        raise


def draw(config: DictConfig, driven: Sequence[Path], folder: Path) -> list[Path]:
    """Draw the runs that the config names, or else those just driven, and print where; the files."""
    plain = build.plain(without_hydra(config))
    runs = driven if plain["run"] is None else [Path(plain["run"])]
    kind = _kind(plain)
    jobs = read_jobs(runs) if kind.drives else []
    if kind.drives and not jobs:
        raise InputError(
            f"run is {plain['run']}: no {LAUNCH} there tells of the config, so it cannot be drawn"
        )
    stem = folder / kind.name
    paths = kind.draw(jobs, _worlds(plain), stem, plain["formats"])
    print("\n".join(map(str, paths)))
    return paths


def _drive(plain: dict[str, Any], run_dir: Path) -> None:
    try:
        evaluate.drive(plain, evaluate.run_labels(plain), build.map_set(plain), run_dir)
    except KeyboardInterrupt:
        print(f"\nStopped. Go on with: lme figure resume={run_dir}", file=sys.stderr)
        raise


def _leave(run_dir: Path) -> None:
    """Take back the directory of a figure that came to nothing, unless it holds more than how it was started."""
    if {path.name for path in run_dir.iterdir()} <= {LAUNCH, ".hydra"}:
        shutil.rmtree(run_dir)


def _kind(plain: dict[str, Any]) -> Kind:
    kind: Kind = build_target(plain["figure"], "figure")
    return kind


def _worlds(plain: dict[str, Any]) -> list[int]:
    """The worlds asked for; none where that is left to the figure."""
    return [] if plain["world"] is None else build.worlds_of(plain["world"])


def _with_worlds(plain: dict[str, Any]) -> dict[str, Any]:
    """The config with the worlds to be driven: those asked for, those that the map set names, or its first."""
    worlds = _worlds(plain) or plain["map"]["worlds"] or [build.map_set(plain).numbers[0]]
    return {**plain, "map": {**plain["map"], "worlds": worlds}}
