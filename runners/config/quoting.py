"""Quote texts in Hydra's override grammar and back, and print `lme` commands that a shell runs as printed."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from pathlib import Path

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Quote, QuotedString
from hydra.errors import HydraException


def quoted(text: str) -> str:
    """Return any `text` as a string in Hydra's override grammar."""
    return QuotedString(text, Quote.single).with_quotes()


def unquoted(value: str) -> str:
    """Return the value of an override without its quotes, if it has any."""
    try:
        parsed = OverridesParser.create().parse_override(f"key={value}").value()
    except HydraException:
        return value.strip("'\"")
    return parsed if isinstance(parsed, str) and value[:1] in ("'", '"') else value


def value_text(value: object) -> str:
    """Return a value as one types it: null, true and false where Python writes None, True and False."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return str(value)


def override(key: str, value: str | Path) -> str:
    """Return the override `key=value` of a text, quoted for Hydra where it would read something else."""
    return f"{key}={element(str(value))}"


def key_of(override: str) -> str:
    """Return the key of an override, without the + or ~ before it."""
    return override.partition("=")[0].lstrip("+~")


def element(text: str) -> str:
    """Return a text as a value in Hydra's override grammar, quoted only where Hydra would read something else."""
    try:
        parsed: object = OverridesParser.create().parse_override(f"key={text}").value()
        plain = isinstance(parsed, str) and parsed == text and not text.startswith("~")
    except HydraException:
        plain = False
    return text if plain else quoted(text)


def lme_command(command: str, *words: str | Path, folders: Sequence[Path] = ()) -> str:
    """Return the line `lme COMMAND WORDS` for a shell. Every command that lme prints or writes is made here.

    folders: config folders, the shipped one first; the line names the user's own.
    """
    # A path that begins with a dash would be read as an option.
    plain = [f"./{word}" if isinstance(word, Path) and str(word).startswith("-") else word for word in words]
    own = [part for folder in folders[1:] for part in ("--config-dir", str(folder))]
    return " ".join(["lme", command, *(_for_shell(str(word)) for word in (*plain, *own))])


def resume_command(command: str, directory: Path) -> str:
    """Return the command that resumes the run in `directory`, which holds the flags that it was started with."""
    return lme_command(command, override("resume", directory))


def _for_shell(word: str) -> str:
    """Quote a word for the shell if needed; what a terminal does not print is escaped, as in $'\\x1b'."""
    if word.isprintable():
        return shlex.quote(word)
    return "$'{}'".format("".join(map(_escaped, word)))


def _escaped(letter: str) -> str:
    if letter.isprintable():
        return f"\\{letter}" if letter in "\\'" else letter
    return "".join(f"\\x{byte:02x}" for byte in letter.encode("utf-8", "surrogateescape"))
