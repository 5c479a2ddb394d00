"""Command line after `lme COMMAND`: overrides, with flags anywhere among them.

Overrides are checked for mistakes of typing and pasting: blanks around =, and characters that look like others.
"""

from __future__ import annotations

import argparse
import os.path
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from lme.errors import InputError
from lme.inputs.guarded_file import expanded

INFO = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")
CFG = ("job", "hydra", "all")
_DASHES = "\u2010\u2011\u2012\u2013\u2014\u2015\u2212\ufe58\ufe63\uff0d"
_DOUBLE, _SINGLE = "\u201c\u201d\u201e\u201f\u00ab\u00bb\u2033\uff02", "\u2018\u2019\u201a\u201b\u2032\uff07"
_INVISIBLE = "\u200b\u2060\ufeff\u00ad"
_AS_TYPED = str.maketrans(
    {**dict.fromkeys(_DASHES, "-"), **dict.fromkeys(_DOUBLE, '"'), **dict.fromkeys(_SINGLE, "'")}
    | dict.fromkeys(_INVISIBLE, "")
)
# The name of a file may hold any of these characters; a number, and the text around a value, may not.
_NUMBERS = re.compile(r"[\d.,:eE+\-*_\s\[\](){}]*\d[\d.,:eE+\-*_\s\[\](){}]*")
_NEGATIVE = re.compile(rf"(?:^|[\[({{,:=\s])[{_DASHES}]\s*(?=[\d.]|inf)")
_OUTSIDE = re.compile(rf"^[\s{_DOUBLE}{_SINGLE}{_INVISIBLE}]|[\s{_DOUBLE}{_SINGLE}{_INVISIBLE}]$")


@dataclass(slots=True)
class Arguments:
    """A parsed command line.

    cfg, package, resolve: the config to print instead of running. info, hydra_help: output that Hydra itself prints.
    """

    overrides: list[str] = field(default_factory=list)
    multirun: bool = False
    config_dir: Path | None = None  # absolute
    config_name: str | None = None
    cfg: str | None = None
    package: str | None = None
    resolve: bool = False
    info: str | None = None
    hydra_help: bool = False


def parse(argv: Sequence[str]) -> Arguments:
    """Parse a command line. Raises InputError for an unknown flag, and for a mistyped override."""
    parsed = Arguments(**vars(_parser().parse_intermixed_args(list(argv))))
    check_words(parsed.overrides)
    if parsed.config_dir is not None:
        check_config_dir(parsed.config_dir)
        parsed.config_dir = parsed.config_dir.resolve()
    if parsed.resolve and parsed.cfg is None:
        raise InputError("--resolve goes with --cfg: --cfg job --resolve")
    return parsed


def check_config_dir(folder: Path, prefix: str = "--config-dir ") -> None:
    """Raise InputError unless a folder of the user's own options exists. prefix: text before it in the message."""
    if not os.path.isdir(folder):  # noqa: PTH112 - Path.is_dir raises for a name that is too long
        raise InputError(f"{prefix}{folder}: no such directory")


def _from_home(word: str) -> str:
    """Replace the ~ of `key=~/path`. A shell replaces it only at the beginning of a word."""
    key, equals, value = word.partition("=")
    home = value == "~" or value.startswith("~/")
    return f"{key}={expanded(value)}" if equals and home else word


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see --help)")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(add_help=False, allow_abbrev=False)
    parser.add_argument("overrides", nargs="*", type=_from_home)
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--cfg", "-c", choices=CFG)
    parser.add_argument("--resolve", action="store_true")
    parser.add_argument("--package", "-p")
    parser.add_argument("--info", "-i", nargs="?", const="all", choices=INFO)
    parser.add_argument("--hydra-help", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=Path)
    parser.add_argument("--config-name", "-cn")
    return parser


def check_words(words: Sequence[str]) -> None:
    """Raise InputError for an override with a blank around its =, or with a lookalike of the right character."""
    for number, word in enumerate(words):
        _check_lookalikes(word)
        before, after = words[number - 1 : number], words[number + 1 : number + 2]
        if word.startswith("=") and before:
            raise _blank([*before, word, *(after if word == "=" else [])])
        if word.endswith("=") and after and "=" not in after[0]:
            raise _blank([word, *after])
        key, colon, value = word.partition(":")
        if colon and "=" not in word and re.fullmatch(r"\+*[\w./@]+", key):
            raise InputError(f"{word}: must be key=value: write {key}={value.strip()}")


def _blank(words: Sequence[str]) -> InputError:
    return InputError(f"{' '.join(words)}: there must be no blank beside =: write {''.join(words)}")


def _check_lookalikes(word: str) -> None:
    typed = _as_typed(word)
    if typed == word:
        return
    key, equals, value = word.partition("=")
    typed_value = typed.partition("=")[2]
    in_key = not equals or _as_typed(key) != key
    in_value = _OUTSIDE.search(value) or _NEGATIVE.search(value) or _NUMBERS.fullmatch(typed_value)
    if in_key or in_value:
        wrong = next(letter for letter in word if _as_typed(letter) != letter)
        name = unicodedata.name(wrong, "unnamed").lower()
        raise InputError(
            f"{word}: holds {name} (U+{ord(wrong):04X}), which only looks like what a keyboard types: write {typed}"
        )


def _as_typed(word: str) -> str:
    """Return the word with lookalikes replaced by the characters of a keyboard."""
    dashes = len(word) - len(word.lstrip(_DASHES + "-"))
    if dashes and "=" not in word and any(letter in _DASHES for letter in word[:dashes]):  # a flag
        flag = word[dashes:].translate(_AS_TYPED)
        return ("-" if len(flag) == 1 else "--") + flag
    return unicodedata.normalize("NFKC", word.translate(_AS_TYPED)).strip() if not word.isascii() else word
