"""Measures the speed of `lme replay`: a whole replay against real time, and one decision.

    python -m benchmarks.replay [--record]

Replays a recording of `lme eval record=mcap` for each of two robots. Needs the extra `replay`. --record also writes
benchmarks/results/replay.md.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine

WANTED_TIMES, WANTED_P99_MS = 20, 1.0
DRIVES = {"turtlebot2": ["map=traps", "map.worlds=[0]"], "jackal": ["map.subset=fresh", "map.worlds=[1000]"]}


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "replay", parser(__doc__, "replay").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Replay\n"
    yield f"`python -m benchmarks.replay --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"Wanted: {WANTED_TIMES} × real time, 99 % of decisions within {WANTED_P99_MS:g} ms.\n"
    yield "| robot | decisions | × real time | decision p50 [ms] | p99 [ms] |"
    yield "|---|---:|---:|---:|---:|"
    for robot, words in DRIVES.items():
        figures = measured(robot, words)
        cells = (
            figures["ticks"],
            figures["times_real_time"],
            figures["decision_ms_p50"],
            figures["decision_ms_p99"],
        )
        yield "| `{}` | {:.0f} | {:.0f} | {:.2f} | {:.2f} |".format(robot, *cells)


def measured(robot: str, words: list[str]) -> dict[str, float]:
    """Record an episode and replay it; return the figures of the replay."""
    with tempfile.TemporaryDirectory() as folder:
        drive = [f"robot={robot}", *words, "runs=1", "executor=serial", "hydra.run.dir=drive", "record=mcap"]
        lme(folder, "eval", *drive)
        (bag,) = Path(folder).glob("drive/recordings/*.mcap")
        lme(folder, "replay", f"bag={bag}", "hydra.run.dir=replay")
        return dict(json.loads((Path(folder) / "replay" / "agreement.json").read_text(encoding="utf-8")))


def lme(folder: str, *words: str) -> None:
    """Run an lme command in a folder, without tracking."""
    program = str(Path(sys.executable).parent / "lme")
    subprocess.run([program, *words, "tracking=none"], cwd=folder, check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    run_main(main)
