"""List map sets, look at their worlds, import published ones, or build a map from a log."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError
from lme.inputs.guarded_file import expanded
from runners.cli.help import texts

if TYPE_CHECKING:
    from lme.worlds.world import Task
    from runners.config.catalogue import Catalogue
    from runners.config.map_sets import MapSetChoice

EXAMPLES = (
    "lme maps",
    "lme maps show barn subset=official50",
    "lme maps show barn 42",
    "lme maps show file 0 path=hall.yaml robot=turtlebot2",
    "lme maps show traps 0 1 2 kind=door --output traps.pdf",
    "lme maps import ~/the-barn-challenge barn_worlds",
    "lme maps build drive.bag",
)
NAMED = 6  # worlds that the file name of a picture lists at most
BUILD_EXAMPLES = (
    "lme maps build drive.bag",
    "lme maps build office.log.gz --output maps/office.yaml",
    "lme maps build outputs/live/RUN/recordings/*.mcap --radius 0.18",
    "lme maps build drive.mcap topics.scan=/front/scan frames.odom=odom start=20 end=300",
)
BUILDINGS_EXAMPLES = ("lme maps buildings ~/ple", "lme maps buildings ~/ple my_buildings --overwrite")
_BUILD = """\
Build a map from the log of a drive, to drive in with map=file or map=building.

A log holds scans and poses: a ROS 1 or ROS 2 recording (.bag, .db3, .mcap, or its folder), a recording of lme live or
lme eval, or a CARMEN log (.log, .clf, also .gz) with FLASER or ROBOTLASER1 lines. Several logs make one map if they
are of one drive, so that their poses are in one frame.

Poses come from tf in the frame "map" if a localiser or a SLAM program ran, else from odometry. The map is only as good
as the poses: odometry drifts, so its walls become double. Nothing is aligned here.

A beam hits the cell in which it ends and passes those before it. A cell is occupied if it has at least two hits and at
least 12 % of its beams are hits. Free is what the robot's body swept, and what its body can reach. The rest is unknown,
an obstacle for map=file. OUTPUT_way.png shows the map with the robot's way: look at it."""
_BUILD_NOTES = """\
settings of the log are keys of lme replay, as in conf/replay.yaml:
  topics.scan, topics.pose   topics, if there are several of a type; lme replay LOG list=true shows them
  frames.odom, frames.base   frames of the poses; frames.odom=odom: odometry although there is a frame "map"
  scan.mount                 [x, y, z, roll, pitch, yaw] of the lidar on the base [m, rad], if tf does not know it
  scan.range_max             [m] range without a return, if the recording does not say
  scan.cloud.min_height, …   how a point cloud becomes a scan
  start, end                 [s] from the beginning of the log
  clock                      header | recorded | auto"""
_BUILDINGS = """\
Build the maps of ten real buildings from published laser logs, for map=building.

The logs were made by real robots, published on Radish, the Robotics Data Set Repository, and corrected by SLAM. They
are in https://github.com/acschaefer/ple, data/carmen/*-corrected.log.gz. Nothing is downloaded: clone it first. The
terms of the data are those of Radish and of each log's author, so lme ships neither logs nor maps.

The buildings: acapulco, aces, belgioioso, csail, edmonton, freiburg-079, freiburg-101, intel, orebro, seattle. Each log
must be the published file, by its SHA-256 digest; a building whose log is not there is left out. freiburg-campus and
infinite-corridor are kilometres long and not built."""


def main(argv: list[str]) -> int:
    """Run `lme maps` or one of its verbs: show, import, build, buildings."""
    arguments = _parsed(argv)
    arguments.run(arguments)
    return 0


def _parsed(argv: list[str]) -> argparse.Namespace:
    """Parse the arguments. Worlds and settings may follow an option, which argparse alone does not allow."""
    parser = _parser()
    arguments, unparsed = parser.parse_known_args(argv)
    strange = [word for word in unparsed if word.startswith("-") and not re.fullmatch(r"-\d+", word)]
    if strange or (unparsed and not hasattr(arguments, "what")):
        parser.error(f"unrecognized arguments: {' '.join(strange or unparsed)}")
    if arguments.config_dir is not None and arguments.run not in (_list, _show):
        parser.error("--config-dir is for `lme maps` and `lme maps show`")
    if unparsed:
        arguments.what += unparsed
    return arguments


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="lme maps", **texts(__doc__, EXAMPLES))
    parser.set_defaults(run=_list)
    own_options: dict[str, Any] = {
        "type": Path,
        "metavar": "DIR",
        "help": "a folder of your own options, such as map/ and robot/",
    }
    parser.add_argument("--config-dir", "-cd", **own_options)
    # lme maps show MAP [NUMBER | key=value …]
    verbs = parser.add_subparsers(metavar="VERB")
    description = (
        "The worlds of one map set: optimal time, time limit and measures, as lme eval drives them.\n"
        "Worlds given by number are also drawn, in a file whose path is printed.\n"
        "Settings are the keys of conf/map/MAP.yaml, and robot=NAME or robot.KEY=VALUE: starts, goals and times "
        "depend on the robot."
    )
    examples = [example for example in EXAMPLES if " show " in example]
    title = "the worlds of one map set: measures, and pictures of those given by number"
    show = verbs.add_parser("show", help=title, **texts(description, examples))
    show.add_argument("map", help="a map set that `lme maps` lists")
    show.add_argument(
        "what",
        nargs="*",
        metavar="NUMBER|key=value",
        help="worlds, such as 3 or 0-5; settings of the map set; robot=NAME",
    )
    # Without the option here, what stands before the verb stays.
    show.add_argument("--config-dir", "-cd", default=argparse.SUPPRESS, **own_options)
    show.add_argument(
        "--output",
        type=Path,
        metavar="PATH",
        help="the picture's file, .png, .pdf or .svg; default: outputs/maps/MAP-NUMBER.png",
    )
    show.set_defaults(run=_show)
    # lme maps import SOURCE DESTINATION
    bring = verbs.add_parser("import", help="check published BARN worlds, copy them, compare with ours")
    bring.add_argument("source", type=Path, help="an official checkout, its worlds/ or its BARN/")
    bring.add_argument("destination", type=Path, help="a new folder, for map.source=")
    bring.set_defaults(run=_import)
    _add_build(verbs)
    _add_buildings(verbs)
    return parser


def _list(arguments: argparse.Namespace) -> None:
    for name, title in _configs(arguments).titles("map").items():
        print(f"{name:<14}  {title}")
    print("\nOne set's worlds: lme maps show NAME; one of them, with a picture: lme maps show NAME NUMBER")


def _configs(arguments: argparse.Namespace) -> Catalogue:
    """Return the options of `conf/`, and those of `--config-dir`."""
    from runners.config import catalogue
    from runners.config.arguments import check_config_dir

    config_dirs = [arguments.config_dir] if arguments.config_dir else []
    for folder in config_dirs:
        check_config_dir(folder)
    return catalogue.shipped(*config_dirs)


def _show(arguments: argparse.Namespace) -> None:
    from runners.config.map_sets import choose
    from runners.reports.analysis.tables import aligned

    # Build the chosen tasks, print their measures, and draw those that were named.
    choice = choose([arguments.map, *arguments.what], configs=_configs(arguments))
    if not choice.worlds and arguments.output is not None:
        raise InputError(
            f"--output {arguments.output}: name the worlds, lme maps show {arguments.map} NUMBER …"
        )
    tasks = [choice.maps.task(number) for number in choice.maps.numbers]
    path = _saved(choice, tasks, arguments.output)
    measures = list(tasks[0].measures)
    rows = [["world", "optimal_time_s", *measures, "time_limit_s"]]
    for task in tasks:
        values = (f"{task.measures[name]:.4g}" for name in measures)
        rows.append([str(task.number), f"{task.optimal_time:.3f}", *values, f"{task.time_limit:.4g}"])
    print("\n".join(aligned(rows, right=range(len(rows[0])))))
    if path is not None:
        print(path, file=sys.stderr)


def _saved(choice: MapSetChoice, tasks: Sequence[Task], output: Path | None) -> Path | None:
    """Draw the named worlds into a file. Return its path, or None if no world or too many worlds are named.

    Raises InputError if the file cannot be written, or if a file was requested for too many worlds.
    """
    if not choice.worlds:
        return None
    from runners.reports.figures.map_pictures import COLUMNS, PANELS, panels_of, sheet
    from runners.reports.figures.style import FORMATS, save_as

    if output is None and len(tasks) > PANELS:
        return None
    # Check the ending first, since drawing takes a while.
    path = output or _default_output(tasks)
    ending = path.suffix.removeprefix(".") or "png"
    if ending not in FORMATS:
        raise InputError(f"--output {path}: must end in .{', .'.join(FORMATS)}")
    figure = sheet(panels_of(choice), COLUMNS)
    # A name without an ending gets one, unless it is that of an existing device or pipe.
    if not path.suffix and (path.is_dir() or not os.path.lexists(path)):
        path = path.with_name(f"{path.name}.{ending}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        save_as(figure, path, ending)
        return path
    except OSError as error:
        raise InputError(f"--output {path}: cannot be written ({error.strerror})") from error


def _default_output(tasks: Sequence[Task]) -> Path:
    from runners.records.run_directories import ROOT

    numbers = [str(task.number) for task in tasks]
    if len(numbers) > NAMED:
        numbers = [numbers[0], "to", numbers[-1]]
    name = re.sub(r"[^\w.-]+", "_", tasks[0].map_name)
    return ROOT / "maps" / f"{'-'.join([name, *numbers])}.png"


def _import(arguments: argparse.Namespace) -> None:
    from lme.worlds.barn.layouts import import_worlds
    from runners.config.quoting import lme_command, override

    report = import_worlds(expanded(arguments.source), expanded(arguments.destination))
    different = [world for world in report if "different" in (world.cylinders, world.path)]
    for world in different:
        print(f"world {world.number}: cylinders {world.cylinders}, path {world.path}")
    source = override("map.source", arguments.destination)
    print(
        f"{len(report)} worlds in {arguments.destination}, {len(report) - len(different)} equal to the "
        f"regenerated ones. Run them: {lme_command('eval', 'map=barn', 'map.subset=all', source)}"
    )


def _add_build(verbs: Any) -> None:
    build = verbs.add_parser(
        "build",
        help="a map from the log of a drive: a ROS recording, a CARMEN log, a recording of lme live",
        **texts(_BUILD, BUILD_EXAMPLES, _BUILD_NOTES),
    )
    build.add_argument(
        "what", nargs="+", metavar="LOG|key=value", help="logs of one drive; settings of the log"
    )
    build.add_argument(
        "--output", type=Path, metavar="PATH", help="the map's file, .yaml; default: outputs/maps/LOG.yaml"
    )
    _add_overwrite(build)
    # Lengths in metres, each with its default and its help.
    numbers = {
        "resolution": (0.05, "side of a cell"),
        "max-range": (
            10.0,
            "what is farther from the lidar does not count as a hit; a beam clears at most this far",
        ),
        "radius": (0.25, "radius of the robot: what it swept is free, and where it cannot go is closed"),
        "reach": (5.0, "space farther than this from the robot's way, along rows and columns, is closed"),
    }
    for name, (default, words) in numbers.items():
        build.add_argument(
            f"--{name}", type=float, default=default, metavar="M", help=f"{words} [m]; default: {default:g}"
        )
    build.add_argument(
        "--no-returns",
        default="clear",
        metavar="clear|ignore",
        help="clear: a beam without a return passes free cells (default); ignore: it says nothing, as through glass",
    )
    build.add_argument(
        "--robot",
        metavar="NAME",
        help="the robot whose lidar it is, if the log does not say where it is mounted",
    )
    build.set_defaults(run=_build)


def _add_buildings(verbs: Any) -> None:
    buildings = verbs.add_parser(
        "buildings",
        help="maps of ten real buildings, from published logs that you have",
        **texts(_BUILDINGS, BUILDINGS_EXAMPLES),
    )
    buildings.add_argument(
        "source", type=Path, help="a checkout of acschaefer/ple, or a folder with its logs"
    )
    buildings.add_argument(
        "destination",
        type=Path,
        nargs="?",
        default=Path("outputs/maps/buildings"),
        help="a folder for the maps; default: outputs/maps/buildings",
    )
    _add_overwrite(buildings)
    buildings.set_defaults(run=_buildings)


def _add_overwrite(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--overwrite", action="store_true", help="replace maps that exist")


def _build(arguments: argparse.Namespace) -> None:
    from runners.config.quoting import element, lme_command
    from runners.recordings.map_build import BuildConfig, build_map, check_target, describe, write_map
    from runners.recordings.posed_scans import log_config
    from runners.records.run_directories import ROOT

    logs, settings = _split_words(arguments.what)
    config = BuildConfig(
        resolution=arguments.resolution,
        max_range=arguments.max_range,
        radius=arguments.radius,
        reach=arguments.reach,
        no_returns=arguments.no_returns,
        log=log_config(settings, arguments.robot),
    )
    # Check the target before the logs are read, which may take minutes.
    log_name = logs[0].resolve().name.removesuffix(".gz")
    default_target = ROOT / "maps" / f"{log_name.rpartition('.')[0] or log_name}.yaml"
    target = expanded(arguments.output) if arguments.output else default_target
    check_target(target, arguments.overwrite)
    built = build_map(logs, config)
    write_map(built, target)
    print(f"log      {built.sources}")
    print(f"map      {describe(built)}: {target}")
    print(f"picture  {target.with_name(f'{target.stem}_way.png')}")
    print(f"scans    {built.tally}")
    paths = f"map.paths=[{element(str(target))}]"
    print(f"Drive in it: {lme_command('eval', 'map=building', paths, 'robot=turtlebot2')}")


def _split_words(words: Sequence[str]) -> tuple[list[Path], dict[str, Any]]:
    """Split the words into logs and settings. Raises InputError if there is no log, or a setting is not YAML."""
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    settings = [word for word in words if "=" in word and not expanded(word).exists()]
    logs = [expanded(word) for word in words if word not in settings]
    if not logs:
        raise InputError("give the log of a drive, e.g. lme maps build drive.bag")
    try:
        parsed_settings: Any = OmegaConf.to_container(OmegaConf.from_dotlist(settings))
    except (OmegaConfBaseException, YAMLError, ValueError) as error:
        raise InputError(f"{' '.join(settings)}: must be key=value, as in YAML") from error
    return logs, parsed_settings


def _buildings(arguments: argparse.Namespace) -> None:
    from runners.recordings.map_build import build_all

    build_all(expanded(arguments.source), expanded(arguments.destination), arguments.overwrite)
