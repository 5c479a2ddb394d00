"""Rebuild tables and pictures from records, without driving again."""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from runners.cli.help import add_trust, texts

if TYPE_CHECKING:
    import pandas as pd

    from runners.reports.analysis.summary import Row

EXAMPLES = (
    "lme table outputs/eval/RUN",
    "lme table RUN1 RUN2 --format csv",
    "lme table SWEEP1 SWEEP2 --into outputs/robustness",
    "lme table SWEEP --width 3.5 --title 'Hall, 50 pairs'",
)


def main(argv: list[str]) -> int:
    """Print one table over all runs. Raises InputError for a path without records."""
    from runners.config.schema import PictureConfig
    from runners.records.records import find_runs, read_episodes
    from runners.reports.analysis.summary import rows_of_runs
    from runners.reports.figures.style import PicturePage, drawn_on

    arguments = _parser().parse_args(argv)
    picture = PictureConfig(title=arguments.title, caption=arguments.caption, width=arguments.width)
    page = PicturePage(picture.title, picture.caption, picture.width)
    runs = find_runs(arguments.runs)
    frame = read_episodes(runs)
    rows = rows_of_runs(frame, runs, is_sweep=runs != arguments.runs[:1])
    _print(frame, rows, arguments.format)
    if len(arguments.runs) == 1 or arguments.into:
        with drawn_on(page):
            words = _rewrite(frame, rows, runs, arguments.into or arguments.runs[0])
        for line in words if arguments.format == "rich" else []:
            print(line)
    return 0


def _parser() -> argparse.ArgumentParser:
    notes = (
        "One run or sweep: its own files are rewritten, not those of a sweep's jobs.\n"
        "Several: nothing is written without --into."
    )
    parser = argparse.ArgumentParser(prog="lme table", **texts(__doc__, EXAMPLES, notes))
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="a run's directory, or a sweep's")
    parser.add_argument(
        "--into", type=Path, metavar="DIR", help="write the tables and pictures of all runs there"
    )
    parser.add_argument(
        "--format", choices=("rich", "md", "csv", "tex"), default="rich", help="default: rich"
    )
    parser.add_argument("--title", help="above the pictures, in place of what they show; '': none")
    parser.add_argument("--caption", help="below the pictures, in place of what explains them; '': none")
    parser.add_argument(
        "--width",
        type=float,
        metavar="IN",
        help="of the pictures [in], e.g. 3.5 or 7.16: a column or page of IEEE",
    )
    add_trust(parser)
    return parser


def _print(frame: pd.DataFrame, rows: list[Row], style: str) -> None:
    from runners.reports.analysis import tables

    renderers = {"md": tables.to_markdown, "csv": tables.to_csv}
    if style in renderers:
        print(renderers[style](rows), end="")
    elif style == "tex":
        print(tables.to_latex(frame, rows), end="")
    else:
        tables.print_table(frame, rows)


def _rewrite(frame: pd.DataFrame, rows: list[Row], runs: list[Path], directory: Path) -> list[str]:
    """Rewrite the tables and pictures of a run or sweep and return its findings. Raises InputError if that fails."""
    from lme.errors import InputError
    from runners.evaluate import evaluate
    from runners.reports.analysis.tables import write_tables

    try:
        directory.mkdir(parents=True, exist_ok=True)
        if runs != [directory]:
            return evaluate.report_runs(frame, rows, runs, directory).lines
        write_tables(frame, rows, directory)
        _draw(frame, directory)
    except OSError as error:
        raise InputError(f"cannot write to {directory} ({error.strerror}): the table above is all") from None
    return []


def _draw(frame: pd.DataFrame, run: Path) -> None:
    """Draw the paths. This needs the worlds, so a folder without a launch record gets no picture."""
    from runners.config import build
    from runners.records.launch_record import read_launch
    from runners.records.trust import UntrustedError
    from runners.reports.figures.paths import draw_run, sample_worlds

    launch = read_launch(run)
    if launch is None:
        return
    try:
        maps = build.map_set(launch.worlds_config, sample_worlds(frame))
    except UntrustedError as error:  # the table needs nothing but the records
        warnings.warn(f"no picture of the paths: {error}", stacklevel=2)
        return
    draw_run(frame, run, maps, run / "trajectories.png")
