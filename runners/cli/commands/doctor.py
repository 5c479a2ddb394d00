"""Check this installation, and print what a bug report needs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING

from runners.cli.parsers import texts

if TYPE_CHECKING:
    from runners.cli.doctor import Line

EXAMPLES = (
    "lme doctor",
    "lme doctor > report.txt",
)
_MARK = "!"
_NOTES = f"""\
A line that begins with {_MARK} is a problem; the next line says what to do.
The exit status is 1 if there is a problem, else 0.
Call it in the folder where you call lme: outputs and the MLflow store are relative to it.
Nothing is written, sent or started. The report names your folders: read it before you publish it."""


def main(argv: list[str]) -> int:
    """Print the report; return 1 if there is a problem."""
    from runners.cli import doctor

    _parser().parse_args(argv)
    lines = doctor.report()
    print("\n".join(_format(lines)))
    return int(any(line.advice for line in lines))


def _parser() -> argparse.ArgumentParser:
    return argparse.ArgumentParser(prog="lme doctor", **texts(__doc__, EXAMPLES, _NOTES))


def _format(lines: Sequence[Line]) -> list[str]:
    """Return the report as two columns, with advice below each problem and the number of problems at the end."""
    width = max(len(line.name) for line in lines)
    texts = []
    for line in lines:
        texts.append(f"{_MARK if line.advice else ' '} {line.name.ljust(width)}  {line.found}")
        texts += [f"{' ' * (width + 4)}{line.advice}"] if line.advice else []
    problems = sum(bool(line.advice) for line in lines)
    return [*texts, "", f"{problems or 'No'} problem{'' if problems == 1 else 's'}."]
