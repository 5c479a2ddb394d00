"""Compare runs world by world: paired differences, intervals, Holm's correction, and a picture."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from lme.errors import InputError
from runners.cli.help import texts

EXAMPLES = (
    "lme compare outputs/eval/RUN1 outputs/eval/RUN2",
    "lme compare outputs/eval/SWEEP",
    "lme compare outputs/eval/SWEEP/1 outputs/eval/SWEEP  # its job 1 is the reference",
    "lme compare RUN1 RUN2 RUN3 --into outputs/weights_compared",
)


def main(argv: list[str]) -> int:
    """Print the comparison, write its files, and say where they are. Raises InputError."""
    from runners.records.records import find_runs, read_runs
    from runners.records.run_directories import ROOT
    from runners.reports.analysis import compare_report
    from runners.reports.analysis.compare_pictures import compare_figures
    from runners.reports.analysis.compare_runs import NOT_COMPARED, compare_runs

    # Compare, and print the result in the chosen format.
    arguments = _parser().parse_args(argv)
    runs = find_runs(arguments.runs)
    for path in arguments.runs:
        _check_named(path, runs)
    comparisons = compare_runs(read_runs(runs, NOT_COMPARED))
    renderers = {
        "text": compare_report.to_text,
        "md": compare_report.to_markdown,
        "tex": compare_report.to_latex,
    }
    print(renderers[arguments.format](comparisons), end="")
    # Write the files into the sweep, if one was given alone, else into a new folder.
    is_sweep = len(arguments.runs) == 1 and arguments.runs != runs
    new = ROOT / "compare" / f"{datetime.now():%Y-%m-%d_%H-%M-%S}"
    directory = arguments.into or (arguments.runs[0] if is_sweep else new)
    try:
        directory.mkdir(parents=True, exist_ok=True)
        pictures = compare_figures(comparisons, directory)
        files = [*compare_report.write(comparisons, pictures, directory), *pictures]
    except OSError as error:
        raise InputError(
            f"cannot write to {directory} ({error.strerror}): what is printed above is all"
        ) from None
    message = f"Tables and pictures: {', '.join(path.name for path in files)} in {directory}"
    print(message, file=sys.stdout if arguments.format == "text" else sys.stderr)
    return 0


def _parser() -> argparse.ArgumentParser:
    notes = (
        "The first run is the reference. Every other run is compared with it over the episodes that both have: the\n"
        "same world, the same number of the run. Worlds that only one has are left out, and counted. Runs are named\n"
        "by what differs between them: system, weights, ablation, changed keys. What may make a comparison unfair,\n"
        "such as another robot, simulator, time limit or seed, is said below the table.\n"
        "\n"
        "A difference comes with a 95 % bootstrap interval over worlds, and with a p from a sign-flip permutation\n"
        "test over worlds, adjusted by Holm over all runs compared; * marks p below 0.05. Two runs are drawn against\n"
        "each other, a dot per world; more as a heat map of runs by worlds.\n"
        "\n"
        "Runs that are not finished can be compared: what they have counts."
    )
    parser = argparse.ArgumentParser(prog="lme compare", **texts(__doc__, EXAMPLES, notes))
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="a run's directory, or a sweep's")
    parser.add_argument(
        "--into",
        type=Path,
        metavar="DIR",
        help="where tables and pictures go; default: the sweep, if one is given alone, else outputs/compare/",
    )
    parser.add_argument("--format", choices=("text", "md", "tex"), default="text", help="of what is printed")
    return parser


def _check_named(path: Path, runs: Sequence[Path]) -> None:
    """Raise InputError if `path` is a folder of runs that were not started together."""
    from runners.records.launch_record import LAUNCH

    inside = [run for run in runs if run.parent == path]
    is_sweep = (path / LAUNCH).exists() or all(run.name.isdigit() for run in inside)
    if path not in runs and not is_sweep:
        first = " ".join(map(str, inside[:2]))
        raise InputError(
            f"{path}: is a folder of {len(inside)} runs, not a sweep: name the runs to compare, such as\n"
            f"  lme compare {first}"
        )
