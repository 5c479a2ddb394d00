"""The requirements in lme's metadata, and how to install the optional ones."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, requires

DISTRIBUTION = "lme-nav"  # `lme` on a package index is another project


def install(*packages: str) -> str:
    """Return the command that installs `packages`, which are optional requirements, in suitable versions.

    It names the packages rather than an extra of lme, which is on no package index, so the command works in any
    folder, for a checkout and for a wheel.
    """
    return " ".join(["pip install", *(f"'{_bounded(package)}'" for package in packages)])


def declared() -> list[str]:
    """The requirements in our metadata, with those of the extras; none if lme is not installed."""
    try:
        return requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        return []


def _bounded(package: str) -> str:
    """`package` with the bounds in our metadata; without them if lme is not installed."""
    for requirement in declared():
        bounded = requirement.partition(";")[0].strip()
        if re.split(r"[<>=!~\[ ]", bounded, maxsplit=1)[0] == package:
            return bounded
    return package
