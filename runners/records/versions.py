"""Versions of Python and of packages, on which a result may depend."""

from __future__ import annotations

import platform
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

import lme


def versions(*packages: str) -> dict[str, str]:
    """The versions of Python, of lme, and of each of the packages that is installed, by name."""
    found = {"python": platform.python_version(), "lme": lme.__version__}
    for package in packages:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return found
