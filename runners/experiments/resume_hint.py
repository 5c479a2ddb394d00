"""Says how to resume a run after Ctrl-C or SIGTERM."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from runners.config.quoting import resume_command


@contextmanager
def resume_hint(command: str, run_dir: Path) -> Iterator[None]:
    """Print the command that resumes the run in `run_dir` if Ctrl-C or SIGTERM ends the block."""
    try:
        yield
    except KeyboardInterrupt:
        print(
            f"\nStopped; finished work is kept. Continue with: {resume_command(command, run_dir)}",
            file=sys.stderr,
        )
        raise
