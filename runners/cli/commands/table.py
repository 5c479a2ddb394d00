"""Rebuild tables and pictures from records, without driving again."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

EXAMPLES = (
    "lme table outputs/eval/RUN",
    "lme table RUN1 RUN2 --format csv",
)


def main(argv: list[str]) -> int:
    """Print one table over all runs. Raises InputError for a path without records."""
    from runners.records.records import find_runs, read_episodes

    arguments = _parser().parse_args(argv)
    runs = find_runs(arguments.runs)
    frame = read_episodes(runs)
    order = [] if runs == arguments.runs[:1] else _order(runs)
    _print(frame, order, arguments.format)
    if len(arguments.runs) == 1:
        words = _rewrite(frame, order, runs, arguments.runs[0])
        for line in words if arguments.format == "rich" else []:
            print(line)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lme table",
        description=__doc__,
        epilog="One run or sweep: its own files are written anew, not those of a sweep's jobs.\n"
        "Several: nothing is written.\n\nexamples:\n  " + "\n  ".join(EXAMPLES),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="a run's directory, or a sweep's")
    parser.add_argument(
        "--format", choices=("rich", "md", "csv", "tex"), default="rich", help="default: rich"
    )
    return parser


def _order(runs: list[Path]) -> list[str]:
    """The rows that a sweep's config asks for."""
    from runners.records.launch_record import read_launch

    launch = read_launch(runs[0])
    return list(launch.configs[0].get("table", [])) if launch is not None else []


def _print(frame: pd.DataFrame, order: list[str], style: str) -> None:
    from runners.analysis import tables
    from runners.analysis.summary import summarise

    renderers = {"md": tables.to_markdown, "csv": tables.to_csv, "tex": tables.to_latex}
    if style in renderers:
        print(renderers[style](summarise(frame, order)), end="")
    else:
        tables.print_table(frame, order)


def _rewrite(frame: pd.DataFrame, order: list[str], runs: list[Path], place: Path) -> list[str]:
    """Tables and pictures of the run or sweep that was named; what they say. Raises InputError if it cannot."""
    from lme.errors import InputError
    from runners.analysis.tables import write_tables
    from runners.experiments import sweeps

    try:
        if runs != [place]:
            return sweeps.report(frame, order, runs, place).words
        write_tables(frame, place)
        _draw(frame, place)
    except OSError as error:
        raise InputError(f"cannot write to {place} ({error.strerror}): the table above is all") from None
    return []


def _draw(frame: pd.DataFrame, run: Path) -> None:
    """The picture needs the worlds, which the run's config describes; a folder without one gets none."""
    from runners.config import build
    from runners.figures.reports.paths import sample_worlds, trajectories_figure
    from runners.records.launch_record import read_launch
    from runners.records.records import read_trajectories

    launch = read_launch(run)
    if launch is not None:
        maps = build.map_set(launch.configs[0])
        worlds = {number: maps.task(number) for number in sample_worlds(frame)}
        trajectories_figure(frame, read_trajectories([run]), worlds, run / "trajectories.png")
