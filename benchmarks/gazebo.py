"""Compares episodes in our simulators with logs of the same system in Gazebo, world by world.

    python -m benchmarks.gazebo [--shared ../shared] [--log FILE[:BLOCK] …] [--runs 2] [--record] [WORD …]

Drives the organisers' stack, `system=move_base_as_run` in `sim=gazebo`, through the worlds of `official50`, and
compares it with its two public logs. The words go to `lme eval`: `sim=skid` chooses another simulator, and `system=…
map.subset=…` with `--log` another system and its log. Needs the logs' folder, which does not ship.
"""

import itertools
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.command import check_named, run_main
from benchmarks.gazebo_logs import Agreement, Rates, agreement, read_log
from benchmarks.recording import parser, show
from benchmarks.speed import machine

if TYPE_CHECKING:
    import pandas as pd

LOGS = ("barn/dwa_out.txt", "facts/gazebo_logs/bobae3_default.txt")  # the organisers' own, another machine's
SHARED = Path("../shared")
WORDS = ("system=move_base_as_run", "map=barn", "map.subset=official50")


def main() -> None:
    """Print the report, and write it with --record."""
    options = parser(__doc__, "gazebo")
    options.add_argument("--shared", type=Path, help=f"folder of the logs; default: {SHARED}")
    options.add_argument(
        "--log", action="append", metavar="FILE[:BLOCK]", help=f"default: {' and '.join(LOGS)}"
    )
    options.add_argument("--runs", type=int, default=2, help="episodes in each world")
    options.add_argument(
        "words",
        nargs="*",
        metavar="WORD",
        help="words for lme eval, instead of the default's where they have the same key",
    )
    arguments = options.parse_args()
    check_named("--shared", arguments.shared)
    folder = arguments.shared or SHARED
    for name in arguments.log or ():
        check_named("--log", _file(folder, name))
    names = arguments.log or list(LOGS)
    absent = [name for name in names if not _file(folder, name).is_file()]
    if absent:
        print(f"Skipped: {folder} has no {', '.join(absent)}; give the logs' folder with --shared.")
        return
    logs = {name: read_log(_file(folder, name), name.partition(":")[2] or None) for name in names}
    show(
        report(with_defaults([f"runs={arguments.runs}", *arguments.words]), logs), "gazebo", arguments.record
    )


def with_defaults(words: Sequence[str]) -> list[str]:
    """The words for lme eval: those of the default whose keys are not given, then these."""
    keys = {word.partition("=")[0] for word in words}
    return [*(word for word in WORDS if word.partition("=")[0] not in keys), *words]


def report(words: Sequence[str], logs: Mapping[str, "pd.DataFrame"]) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Gazebo, world by world\n"
    yield f"`python -m benchmarks.gazebo --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"Ours: `lme eval {' '.join(words)}`\n"
    sides = "success / collision / time-out, time [s]"
    yield (
        f"| one | other | worlds | one: {sides} | other: {sides} | correlation | same verdict | "
        "time ratio | time correlation |"
    )
    yield "|---|---|---:|---|---|---:|---:|---:|---:|"
    records = episodes(words)
    for name, log in logs.items():
        yield row("ours", name, agreement(records, log))
    for (log_name, log), (other_name, second) in itertools.combinations(logs.items(), 2):
        yield row(log_name, other_name, agreement(log, second))


def row(name: str, reference: str, result: Agreement) -> str:
    """A line of the table."""
    return (
        f"| {name} | {reference} | {result.worlds} | {_rates(result.one)} | {_rates(result.other)} | "
        f"{result.correlation:.2f} | {result.same_verdict:.2f} | {result.time_ratio:.2f} | "
        f"{result.time_correlation:.2f} |"
    )


def episodes(words: Sequence[str]) -> "pd.DataFrame":
    """The records of `lme eval` with these words."""
    from runners.records.records import read_episodes

    with tempfile.TemporaryDirectory() as folder:
        run_dir = Path(folder) / "run"
        command = [sys.executable, "-m", "runners.cli.main", "eval", *words]
        options = ["tracking=none", f"hydra.run.dir={run_dir}"]
        subprocess.run([*command, *options], check=True, stdout=sys.stderr)
        return read_episodes([run_dir])


def _rates(rates: Rates) -> str:
    shares = f"{rates.success:.3f} / {rates.collision:.3f} / {rates.timeout:.3f}"
    return f"{shares}, {rates.time_s:.1f} ({rates.episodes} episodes)"


def _file(folder: Path, name: str) -> Path:
    return folder / name.partition(":")[0]


if __name__ == "__main__":
    run_main(main)
