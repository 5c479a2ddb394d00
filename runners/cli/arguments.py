"""The words after `lme COMMAND`: flags that may stand anywhere, and overrides."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from lme.errors import InputError

INFO = ("all", "config", "defaults", "defaults-tree", "plugins", "searchpath")
CFG = ("job", "hydra", "all")


@dataclass(slots=True)
class Arguments:
    """A command line, taken apart. `shows`: flags that make Hydra print something instead of running."""

    overrides: list[str] = field(default_factory=list)
    multirun: bool = False
    config_dir: Path | None = None  # absolute
    config_name: str | None = None
    shows: list[str] = field(default_factory=list)

    def hydra_argv(self) -> list[str]:
        """The same for Hydra, which wants its flags before the overrides."""
        flags = list(self.shows)
        if self.multirun and not self.shows:
            flags.append("--multirun")
        if self.config_dir is not None:
            flags += ["--config-dir", str(self.config_dir)]
        return flags + self.overrides


def parse(argv: Sequence[str]) -> Arguments:
    """Take a command line apart. Raises InputError for a flag that there is not."""
    flags = _parser().parse_intermixed_args(list(argv))
    if flags.config_dir is not None and not flags.config_dir.is_dir():
        raise InputError(f"--config-dir {flags.config_dir}: no such directory")
    return Arguments(
        overrides=flags.overrides,
        multirun=flags.multirun,
        config_dir=flags.config_dir and flags.config_dir.resolve(),
        config_name=flags.config_name,
        shows=_shows(flags),
    )


def _shows(flags: argparse.Namespace) -> list[str]:
    shows = []
    if flags.cfg is not None:
        shows += ["--cfg", flags.cfg]
        shows += ["--resolve"] if flags.resolve else []
        shows += ["--package", flags.package] if flags.package else []
    if flags.info is not None:
        shows += ["--info", flags.info]
    if flags.hydra_help:
        shows.append("--hydra-help")
    if flags.resolve and flags.cfg is None:
        raise InputError("--resolve goes with --cfg: --cfg job --resolve")
    return shows


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see --help)")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(add_help=False, allow_abbrev=False)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--cfg", "-c", choices=CFG)
    parser.add_argument("--resolve", action="store_true")
    parser.add_argument("--package", "-p")
    parser.add_argument("--info", "-i", nargs="?", const="all", choices=INFO)
    parser.add_argument("--hydra-help", action="store_true")
    parser.add_argument("--config-dir", "-cd", type=Path)
    parser.add_argument("--config-name", "-cn")
    return parser
