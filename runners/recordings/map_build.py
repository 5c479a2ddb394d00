"""ROS maps built from the logs of one drive: a picture of cells, its YAML file, and a picture with the path.

`build_all` builds those of ten real buildings from the corrected CARMEN logs of Radish in github.com/acschaefer/ple.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import yaml
from PIL import Image

from lme.errors import InputError, require
from lme.inputs import plausibility
from lme.inputs.guarded_file import LOG_BYTES, read_bytes
from lme.mapping.occupancy import FREE, OCCUPIED, GridMap, OccupancyGrid
from lme.perception.scan_check import ScanTally
from lme.types import Floats
from lme.worlds.bitmap import MAX_PIXELS
from runners.config.quoting import element, lme_command
from runners.recordings.posed_scans import DriveLog, LogConfig
from runners.records.atomic_write import output_file
from runners.reports.figures.style import BLUE, INK, VERMILION, new_figure
from runners.workers.progress import ScanProgress

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_LONGEST_IN, _MARGIN_IN = 9.0, 0.7
_GREYS = {FREE: 1.0, OCCUPIED: 0.1}
_UNKNOWN_GREY = 0.78
ENDING, PICTURE = ".yaml", "_way"  # of a map's file; of the name of its picture with the way
NO_RETURNS = ("clear", "ignore")
CHECKOUT = Path("data/carmen")  # where the logs lie in a checkout
SUFFIX = "-corrected.log.gz"  # of a log's file name, after the building's name
DIGESTS = {  # SHA-256 of the logs at commit cfcb5a7 of acschaefer/ple
    "acapulco": "fbd19a018534dee751606a9520fd6be25c86f3d7f1f7d849b1834d047b330116",
    "aces": "5434d44384166250608a64d3a8c32de84512f82c46cb60a2657f138592024569",
    "belgioioso": "a130e3e6d9e5ec5e6a7f94cbb5cb6bca2df2626c7ed6bebb7b7a282253b10f6e",
    "csail": "a98de24fc319651f231f9a8625b78bf1972312b86f7b00d2ddc979c4ac92ae2d",
    "edmonton": "96599a91e0cc9cb2570dbb92f92bbdf1e3a405b16aa99f6d3ce1a703011befdb",
    "freiburg-079": "0631d30baf4b9d1d209af47da9096e876e1b4cb3d5a2d68ef9c39c5a2360a466",
    "freiburg-101": "7792de88bcb050f8edba92914aea75e8ec2fb73b483c01903bd2753aa655e982",
    "intel": "71bef16e9926506cf7417995ef35ace09dbd5de067fd042a3aab85188b5480dc",
    "orebro": "39a189c64489b84996669bc484d6bd6864f8733029a280a0e549a0adaae08a82",
    "seattle": "5719198036b788d78a877ca04efdbfb07c2518508310f51d49c198bf1956bb4b",
}


def way_picture(built: GridMap, path: Floats, title: str) -> Figure:
    """Draw the map with the robot's path (N, 2) [m]: free white, obstacles black, unknown grey."""
    width, height = built.size
    scale = _LONGEST_IN / max(width, height)
    figure = new_figure(max(width * scale, 2.5) + _MARGIN_IN, max(height * scale, 1.5) + _MARGIN_IN)
    axes = figure.add_subplot()
    grey = np.full(built.cells.shape, _UNKNOWN_GREY)
    for value, shade in _GREYS.items():
        grey[built.cells == value] = shade
    x, y = built.origin
    extent = (x, x + width, y, y + height)
    axes.imshow(grey, cmap="gray", vmin=0.0, vmax=1.0, origin="lower", extent=extent, interpolation="nearest")
    axes.plot(*path.T, color=BLUE, linewidth=0.9, label="way of the robot")
    axes.plot(*path[0], "o", color=BLUE, markersize=4, label="its start")
    axes.plot(*path[-1], "s", color=VERMILION, markersize=4, label="its end")
    axes.set_title(f"{title}: {built.free_area:.0f} m² free", fontsize=9, color=INK)
    axes.set_xlabel("x [m]", fontsize=8, color=INK)
    axes.set_ylabel("y [m]", fontsize=8, color=INK)
    axes.tick_params(labelsize=7, colors=INK)
    figure.legend(loc="outside lower center", ncols=3, frameon=False, fontsize=7.5, labelcolor=INK)
    return figure


@dataclass(slots=True)
class BuildConfig:
    """Settings of a map. Names in messages are those of the options of `lme maps build`."""

    resolution: float = 0.05  # [m] side of a cell
    max_range: float = 10.0  # [m] ASSUMED: farther returns smear, as an error of 1° moves them by 17 cm
    radius: float = 0.25  # [m] ASSUMED: of the robot that made the log, e.g. a Pioneer 2
    reach: float = 5.0  # [m] ASSUMED: farther from the robot's way too little was seen to drive there
    no_returns: str = "clear"  # clear | ignore: what a beam without a return says about its cells
    log: LogConfig = field(default_factory=LogConfig)

    def __post_init__(self) -> None:
        for key in ("resolution", "max_range", "radius", "reach"):
            require(f"--{key.replace('_', '-')}", getattr(self, key), above=0.0)
        for key in ("resolution", "radius"):
            plausibility.check(f"--{key}", getattr(self, key))
        if self.no_returns not in NO_RETURNS:
            raise InputError(f"--no-returns is {self.no_returns}: must be {' or '.join(NO_RETURNS)}")


class BuiltMap(NamedTuple):
    """A map, the robot's path (N, 2) [m], the scans in the map, and those left out because they have no pose.

    tally: of the beams of these scans.
    """

    map: GridMap
    way: Floats
    scans: int
    skipped: int
    tally: ScanTally
    sources: str


def build_map(paths: Sequence[Path], config: BuildConfig, shown: bool = True) -> BuiltMap:
    """Build the map from the logs of one drive, whose poses share a frame. shown: whether to show a progress bar.

    Raises InputError if a log cannot be read, has no scans or no poses, or if the map would be too large.
    """
    grid = OccupancyGrid(config.resolution, config.max_range)
    positions: list[tuple[float, float]] = []
    sources: list[str] = []
    skipped, tally = 0, ScanTally()
    # Add the scans of all logs to one grid.
    for path in paths:
        num_before = len(positions)
        with DriveLog(path, config.log) as log, ScanProgress("scans", log.num_scans, shown=shown) as progress:
            sources.append(log.sources)
            for located in log.scans():
                progress.add()
                if located is None:
                    skipped += 1
                    continue
                tally.add(located.scan)
                grid.add(located.scan, located.lidar, located.sees_far and config.no_returns == "clear")
                positions.append((located.base.x, located.base.y))
        if len(positions) == num_before:
            raise InputError(f"log {path}: no scan between start and end has a pose within half a second")
    # Turn the grid into a map, whose size is limited.
    points = np.array(positions)
    built = grid.finish(points, config.radius, config.reach)
    if built.cells.size > MAX_PIXELS:
        width, height = built.size
        min_resolution = config.resolution * (built.cells.size / MAX_PIXELS) ** 0.5
        raise InputError(
            f"--resolution is {config.resolution:g} m for a map of {width:.0f} by {height:.0f} m: must give at most "
            f"{MAX_PIXELS} cells, so at least {min_resolution:.2g} m"
        )
    return BuiltMap(built, points, len(positions), skipped, tally, "; ".join(dict.fromkeys(sources)))


def check_target(path: Path, overwrite: bool) -> None:
    """Raise InputError unless a map can be written to `path`, a YAML file."""
    if path.suffix != ENDING:
        raise InputError(f"--output {path}: must end in {ENDING}")
    for file in _files(path):
        if file.exists() and not overwrite:
            raise InputError(f"--output {path}: {file.name} exists; add --overwrite, or choose another name")


def write_map(built: BuiltMap, path: Path) -> None:
    """Write the map to `path`, a YAML file, with its two pictures next to it. Raises InputError if that fails."""
    from runners.reports.figures.style import save_as

    _, image, picture = _files(path)
    metadata = {
        "image": image.name,
        "resolution": built.map.resolution,
        "origin": [*built.map.origin, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    # Row 0 of the picture is the top, row 0 of the cells the bottom.
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with output_file(image) as draft:
            Image.fromarray(built.map.cells[::-1]).save(draft)
        save_as(way_picture(built.map, built.way, path.stem), picture, "png")
        with output_file(path) as draft:
            draft.write_text(
                yaml.safe_dump(metadata, sort_keys=False, default_flow_style=None), encoding="utf-8"
            )
    except OSError as error:
        raise InputError(f"--output {path}: cannot be written ({error.strerror})") from error


def describe(built: BuiltMap) -> str:
    """Return one line about a map."""
    width, height = built.map.size
    unposed = f" ({built.skipped} more without a pose)" if built.skipped else ""
    return (
        f"{width:.1f} × {height:.1f} m, {built.map.free_area:.0f} m² free, from {built.scans} scans{unposed}"
    )


def _files(path: Path) -> tuple[Path, Path, Path]:
    """Return the paths of a map's YAML file, of its picture of cells, and of its picture with the path."""
    return path, path.with_suffix(".png"), path.with_name(f"{path.stem}{PICTURE}.png")


def build_all(source: Path, destination: Path, overwrite: bool) -> None:
    """Build the map of every building whose log is in `source` in the folder `destination`; print a line for each.

    Raises InputError if there are no logs, one is not the published file, or a map exists and `overwrite` is false.
    Everything is checked before the first map is built.
    """
    logs = dict(_logs(source))
    if not logs:
        raise InputError(
            f"{source}: has no logs of these buildings, such as intel{SUFFIX}: must be a checkout of "
            f"github.com/acschaefer/ple, or a folder with the files of its {CHECKOUT}"
        )
    for name, log in logs.items():
        _check_digest(name, log)
        check_target(_target(destination, name), overwrite)
    for name, log in logs.items():
        built = build_map([log], BuildConfig())
        write_map(built, _target(destination, name))
        print(f"{name:<14}{describe(built)}")
    missing_logs = [name for name in DIGESTS if name not in logs]
    if missing_logs:
        print(f"left out, without a log: {', '.join(missing_logs)}")
    paths = f"map.paths=[{element(str(destination))}]"
    print(f"Drive in them: {lme_command('eval', 'map=building', paths, 'robot=turtlebot2')}")


def _logs(source: Path) -> Iterator[tuple[str, Path]]:
    """Yield the known buildings whose logs are in a checkout or a folder."""
    if not source.is_dir():
        raise InputError(f"{source}: {'is not a folder' if source.exists() else 'no such folder'}")
    folder = source / CHECKOUT if (source / CHECKOUT).is_dir() else source
    for name in DIGESTS:
        if (folder / f"{name}{SUFFIX}").is_file():
            yield name, folder / f"{name}{SUFFIX}"


def _check_digest(name: str, log: Path) -> None:
    try:
        digest = hashlib.sha256(read_bytes(log, LOG_BYTES)).hexdigest()
    except OSError as error:
        raise InputError(f"{log}: cannot be read ({error.strerror})") from error
    if digest != DIGESTS[name]:
        raise InputError(
            f"{log}: its SHA-256 is {digest}: must be {DIGESTS[name]}, that of the published file; "
            "for a log of your own: lme maps build"
        )


def _target(destination: Path, name: str) -> Path:
    return destination / f"{name}{ENDING}"
