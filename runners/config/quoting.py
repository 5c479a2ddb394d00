"""Texts in Hydra's override grammar, and back."""

from __future__ import annotations

import shlex
from pathlib import Path

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Quote, QuotedString
from hydra.errors import HydraException


def quoted(text: str) -> str:
    """`text` as a string in Hydra's override grammar, with any characters."""
    return QuotedString(text, Quote.single).with_quotes()


def unquoted(value: str) -> str:
    """The value of an override without its quotes, if it has any."""
    try:
        read = OverridesParser.create().parse_override(f"key={value}").value()
    except HydraException:
        return value.strip("'\"")
    return read if isinstance(read, str) and value[:1] in ("'", '"') else value


def resume_command(command: str, directory: Path) -> str:
    """The words that resume the run in `directory`, quoted for Hydra and for the shell where they need it."""
    text = str(directory)
    try:
        read = OverridesParser.create().parse_override(f"resume={text}")
        plain = not read.is_sweep_override() and str(read.value()) == text
    except HydraException:
        plain = False
    return f"lme {command} {shlex.quote(f'resume={text if plain else quoted(text)}')}"
