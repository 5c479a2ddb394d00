"""Help texts of commands that have options of their own instead of a config."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import Any

from runners.records import trust


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Describe --trust, which `runners/cli/main.py` removes from the words of every command."""
    help_text = "run the code that a run names (SECURITY.md); without it, only lme's own is run"
    parser.add_argument(trust.FLAG, action="store_true", help=help_text)


def texts(description: str | None, examples: Iterable[str], notes: str = "") -> dict[str, Any]:
    """Return keywords for `ArgumentParser` and `add_parser`; the help ends with notes, if any, and examples."""
    example_text = "\n".join(["examples:", *(f"  {example}" for example in examples)])
    return {
        "description": description,
        "epilog": f"{notes}\n\n{example_text}" if notes else example_text,
        "formatter_class": argparse.RawDescriptionHelpFormatter,
    }
