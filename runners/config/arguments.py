"""Command line after `lme COMMAND`: overrides, with flags anywhere among them."""

from __future__ import annotations

import argparse
import os.path
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from lme.errors import InputError
from lme.inputs.guarded_file import expanded
from runners.config.lookalikes import check_words

INFO = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")
CFG = ("job", "hydra", "all")


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
    given = Arguments(**vars(_parser().parse_intermixed_args(list(argv))))
    check_words(given.overrides)
    if given.config_dir is not None:
        check_config_dir(given.config_dir)
        given.config_dir = given.config_dir.resolve()
    if given.resolve and given.cfg is None:
        raise InputError("--resolve goes with --cfg: --cfg job --resolve")
    return given


def check_config_dir(folder: Path, given: str = "--config-dir ") -> None:
    """Raise InputError unless a folder of the user's own options exists. given: text before it in the message."""
    if not os.path.isdir(folder):  # noqa: PTH112 - Path.is_dir raises for a name that is too long
        raise InputError(f"{given}{folder}: no such directory")


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
