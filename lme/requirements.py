"""What lme requires by its metadata, and how to install what only some of it needs."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, requires

DISTRIBUTION = "lme-nav"  # `lme` on a package index is another project


def install(*packages: str) -> str:
    """The command that installs `packages`, which are optional requirements, in versions that fit.

    It names the packages and not an extra of ours: no index has lme, and so the command is right in any folder, for
    a checkout as for a wheel.
    """
    return " ".join(["pip install", *(f"'{_bounded(package)}'" for package in packages)])


def declared() -> list[str]:
    """The requirements in our metadata, with those of the extras; none where lme runs uninstalled."""
    try:
        return requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        return []


def _bounded(package: str) -> str:
    """`package` with the bounds in our metadata; without, where lme runs uninstalled."""
    for requirement in declared():
        bounded = requirement.partition(";")[0].strip()
        if re.split(r"[<>=!~\[ ]", bounded, maxsplit=1)[0] == package:
            return bounded
    return package
