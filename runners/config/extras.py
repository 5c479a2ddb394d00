"""How to install what only some commands need."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, requires

DISTRIBUTION = "lme-nav"  # the name on a package index, where `lme` is another project


def install(package: str) -> str:
    """The command that installs `package`, one of the optional requirements, in a version that fits.

    It names the package itself and not an extra of ours, so it is right in a checkout and from a wheel.
    """
    return f"pip install '{_requirement(package)}'"


def _requirement(package: str) -> str:
    """`package` with the bounds in our metadata; without, where lme runs uninstalled."""
    try:
        declared = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        declared = []
    for requirement in declared:
        bounded = requirement.partition(";")[0].strip()
        if re.split(r"[<>=!~\[ ]", bounded, maxsplit=1)[0] == package:
            return bounded
    return package
