"""List map sets and their worlds, or import published ones."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lme.worlds.world import Task

EXAMPLES = (
    "lme maps show barn subset=official50",
    "lme maps import ~/the-barn-challenge barn_worlds",
)


def main(argv: list[str]) -> int:
    """`lme maps`, `lme maps show MAP [NUMBER…] [key=value…]`, `lme maps import SOURCE DESTINATION`."""
    arguments = _parser().parse_args(argv)
    for line in arguments.lines(arguments):
        print(line)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lme maps",
        description=__doc__,
        epilog="examples:\n  " + "\n  ".join(EXAMPLES),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(lines=_sets)
    verbs = parser.add_subparsers(metavar="VERB")
    show = verbs.add_parser("show", help="the worlds of one map set: optimal time and measures")
    show.add_argument("map", help="a map set that `lme maps` lists")
    show.add_argument("what", nargs="*", metavar="NUMBER|key=value", help="worlds; settings of the map set")
    show.set_defaults(lines=_worlds)
    bring = verbs.add_parser("import", help="check published BARN worlds, copy them, compare with ours")
    bring.add_argument("source", type=Path, help="an official checkout, its worlds/ or its BARN/")
    bring.add_argument("destination", type=Path, help="a new folder, for map.source=")
    bring.set_defaults(lines=_import)
    return parser


def _sets(_: argparse.Namespace) -> Iterator[str]:
    from lme.resources import resource_dir

    for path in sorted((resource_dir("conf") / "map").glob("*.yaml")):
        first = path.read_text(encoding="utf-8").splitlines()[0]
        yield f"{path.stem:<14}  {first.lstrip('# ')}"
    yield "\nOne set's worlds: lme maps show NAME"


def _worlds(arguments: argparse.Namespace) -> Iterator[str]:
    chosen = _map_set(arguments.map, arguments.what)
    rows = [_row(chosen.task(number)) for number in chosen.numbers]
    widths = {name: max(len(name), *(len(row[name]) for row in rows)) for name in rows[0]}
    yield "  ".join(f"{name:>{width}}" for name, width in widths.items())
    for row in rows:
        yield "  ".join(f"{row[name]:>{width}}" for name, width in widths.items())


def _row(task: Task) -> dict[str, str]:
    measures = {name: f"{value:.4g}" for name, value in task.measures.items()}
    return {"world": str(task.number), "optimal_time_s": f"{task.optimal_time:.3f}", **measures}


def _map_set(name: str, what: list[str]) -> Any:
    """Build map set `name` with `key=value` settings; bare numbers choose worlds."""
    from omegaconf import OmegaConf

    from lme.errors import InputError
    from lme.resources import resource_dir
    from runners.mistakes import nearest
    from runners.targets import build

    paths = {path.stem: path for path in sorted((resource_dir("conf") / "map").glob("*.yaml"))}
    if name not in paths:
        raise InputError(f"map set {name!r} is unknown: {nearest(name, paths)}There are {', '.join(paths)}")
    numbers = [word for word in what if "=" not in word]
    bad = [word for word in numbers if not word.isdigit()]
    if bad:
        raise InputError(f"{bad[0]!r} is neither a world number nor key=value")
    settings = [word for word in what if "=" in word]
    node = OmegaConf.merge(OmegaConf.load(paths[name]), OmegaConf.from_dotlist(settings))
    if numbers:
        node["worlds"] = [int(number) for number in numbers]
    return build(node, "map")


def _import(arguments: argparse.Namespace) -> Iterator[str]:
    from lme.worlds.barn_import import import_worlds

    report = import_worlds(arguments.source.expanduser(), arguments.destination.expanduser())
    different = [world for world in report if "different" in (world.cylinders, world.path)]
    for world in different:
        yield f"world {world.number}: cylinders {world.cylinders}, path {world.path}"
    yield (
        f"{len(report)} worlds in {arguments.destination}, {len(report) - len(different)} equal to the "
        f"regenerated ones. Run them: lme eval map=barn map.subset=all map.source={arguments.destination}"
    )
