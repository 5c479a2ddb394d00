"""Prints a report line by line, and can write it to a file."""

import argparse
from collections.abc import Iterable
from pathlib import Path

RESULTS = Path(__file__).parent / "results"


def parser(doc: str, name: str) -> argparse.ArgumentParser:
    """A parser with --record, which writes the report to benchmarks/results/NAME.md."""
    arguments = argparse.ArgumentParser(description=doc.splitlines()[0])
    arguments.add_argument("--record", action="store_true", help=f"write benchmarks/results/{name}.md")
    return arguments


def show(lines: Iterable[str], name: str, record: bool) -> None:
    """Print each line as it is made; write all of them at the end if `record`."""
    lines_shown = []
    for line in lines:
        print(line, flush=True)
        lines_shown.append(line)
    if record:
        RESULTS.mkdir(exist_ok=True)
        (RESULTS / f"{name}.md").write_text("\n".join(lines_shown) + "\n", encoding="utf-8")
