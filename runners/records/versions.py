"""Versions of Python, packages and the checkout, on which a result may depend."""

from __future__ import annotations

import platform
import subprocess
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

import lme

_ROOT = Path(__file__).resolve().parents[2]
_SHOWN = 8  # digits of a commit, as text


class Commit(NamedTuple):
    """Commit of a checkout. changed: whether its files have uncommitted changes."""

    number: str
    changed: bool


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of Python, lme, and each of the packages that is installed, by name."""
    versions_by_package = {"python": platform.python_version(), "lme": lme.__version__}
    for package in packages:
        with suppress(PackageNotFoundError):
            versions_by_package[package] = version(package)
    return versions_by_package


@cache
def commit() -> Commit | None:
    """Return the commit of this file's checkout; None in an installed wheel."""
    try:
        if Path(_git("rev-parse", "--show-toplevel")).resolve() != _ROOT:
            return None
        has_changes = bool(_git("status", "--porcelain", "--untracked-files=no"))
        return Commit(_git("rev-parse", "HEAD"), has_changes)
    except (OSError, subprocess.SubprocessError):
        return None


def code() -> str:
    """Return the version of lme and its commit as text: "lme 0.2.0, commit 1ec8305b, changed"."""
    checkout = commit()
    notes = (
        [] if checkout is None else [f"commit {checkout.number[:_SHOWN]}", *["changed"] * checkout.changed]
    )
    return ", ".join([f"lme {lme.__version__}", *notes])


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(_ROOT), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
