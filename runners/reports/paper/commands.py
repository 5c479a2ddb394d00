"""The commands that make the runs of a paper again, as a script, from their launch records."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from runners.config.escaping import visible
from runners.config.quoting import lme_command, override
from runners.config.schema import COMMANDS
from runners.records.launch_record import Launch, read_launch

ROOT = Path("outputs/reproduced")


def script(paths: Sequence[Path], run_dirs: Sequence[Path]) -> str:
    """Return the script. paths: runs and sweeps, as they were given. run_dirs: the runs below them."""
    lines = ["#!/bin/sh", "# Drives the runs of this paper again, then makes its folder again.", "set -e"]
    made: list[Path] = []
    for path in paths:
        # A sweep is one command, unless only its runs are recorded.
        is_recorded = read_launch(path) is not None
        for directory in [path] if is_recorded else [run for run in run_dirs if path in (run, run.parent)]:
            launch = read_launch(directory)
            if launch is None or launch.command not in COMMANDS:
                lines += ["", f"# {visible(str(directory))}: how it was started is not recorded"]
                continue
            made.append(ROOT / str(len(made) + 1))
            lines += ["", *_lines(launch, made[-1])]
    again = ["", lme_command("paper", *made, "--into", Path("paper_again"))] if made else []
    return "\n".join([*lines, *again]) + "\n"


def _lines(launch: Launch, into: Path) -> list[str]:
    """Return the lines for one run or sweep. Its record may come from anyone, so a comment stays one line."""
    folder = "hydra.sweep.dir" if launch.multirun else "hydra.run.dir"
    again = dataclasses.replace(launch, overrides=[*launch.overrides, override(folder, into)])
    needed = [
        f"# needs {visible(file.source)}, SHA-256 {visible(file.sha256)}"
        for entry in launch.inputs
        for file in entry.files.values()
    ]
    code = f"# driven by {visible(launch.code or 'a version that is not recorded')}"
    return [code, *needed, again.command_line]
