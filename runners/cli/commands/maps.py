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
from runners.cli import map_building
from runners.cli.parsers import texts

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
    map_building.add_verbs(verbs)
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

    # Build the chosen tasks, print their measures, and draw those that were named.
    choice = choose([arguments.map, *arguments.what], configs=_configs(arguments))
    if not choice.worlds and arguments.output is not None:
        raise InputError(
            f"--output {arguments.output}: name the worlds, lme maps show {arguments.map} NUMBER …"
        )
    tasks = [choice.maps.task(number) for number in choice.maps.numbers]
    path = _saved(choice, tasks, arguments.output)
    print("\n".join(_table(tasks)))
    if path is not None:
        print(path, file=sys.stderr)


def _table(tasks: Sequence[Task]) -> list[str]:
    from runners.reports.analysis.tables import aligned

    rows = [_measures(task) for task in tasks]
    return aligned(
        [list(rows[0]), *([row[name] for name in rows[0]] for row in rows)], right=range(len(rows[0]))
    )


def _measures(task: Task) -> dict[str, str]:
    measures = {name: f"{value:.4g}" for name, value in task.measures.items()}
    optimal, limit = f"{task.optimal_time:.3f}", f"{task.time_limit:.4g}"
    return {"world": str(task.number), "optimal_time_s": optimal, **measures, "time_limit_s": limit}


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
    from lme.worlds.barn.importing import import_worlds
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
