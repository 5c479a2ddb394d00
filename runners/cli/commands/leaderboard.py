"""Collect runs on one page: systems by map sets, with intervals and links to the reasons."""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

from lme.errors import InputError
from runners.cli.help import texts
from runners.config.escaping import counted

EXAMPLES = (
    "lme leaderboard",
    "lme leaderboard outputs/eval/SWEEP1 outputs/eval/SWEEP2 --into board.html",
)
NAME = "leaderboard.html"


def main(argv: list[str]) -> int:
    """Write the page and print its path. Raises InputError if there are no records or the page cannot be written."""
    from runners.records.atomic_write import output_path
    from runners.records.run_directories import collect
    from runners.reports.analysis.leaderboard import entries
    from runners.reports.explainer.leaderboard import write_leaderboard

    arguments = _parser().parse_args(argv)
    frames, problems = collect(arguments.folders)
    board = entries(frames, problems)
    for problem in problems:
        warnings.warn(f"left out: {problem}", stacklevel=2)
    if not board:
        raise InputError(f"no run in {', '.join(map(str, arguments.folders))} can be read: see above")
    page = output_path(arguments.into, "--into") if arguments.into else arguments.folders[0] / NAME
    write_leaderboard(board, problems, page)
    print(f"Leaderboard of {counted(len(board), 'run')}: {page}")
    return 0


def _parser() -> argparse.ArgumentParser:
    from runners.records.run_directories import ROOT

    notes = (
        "The page is one file that needs no server or network. It links to the explainer pages of the runs."
    )
    parser = argparse.ArgumentParser(prog="lme leaderboard", **texts(__doc__, EXAMPLES, notes))
    parser.add_argument(
        "folders",
        nargs="*",
        type=Path,
        metavar="DIR",
        default=[ROOT],
        help="folders of runs; default: outputs",
    )
    parser.add_argument("--into", type=Path, metavar="FILE", help=f"default: {NAME} in the first folder")
    return parser
