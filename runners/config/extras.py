"""What lme requires by its metadata, and how to install what only some commands need."""

from __future__ import annotations

import re
from importlib.metadata import PackageNotFoundError, requires

from packaging.requirements import Requirement

DISTRIBUTION = "lme-nav"  # the name on a package index, where `lme` is another project
_FOR_DEVELOPERS = {"dev", "docs"}
_EXTRA = re.compile(r'extra == "([\w-]+)"')


def install(package: str) -> str:
    """The command that installs `package`, one of the optional requirements, in a version that fits.

    It names the package itself and not an extra of ours, so it is right in a checkout and from a wheel.
    """
    return f"pip install '{_requirement(package)}'"


def needed() -> list[Requirement]:
    """The requirements of every installation; none where lme runs uninstalled."""
    return [each for each in map(Requirement, _declared()) if each.marker is None]


def optional() -> dict[str, Requirement]:
    """The package behind each extra of ours, by the extra's name, those for developers left out."""
    marked = [(each, str(each.marker)) for each in map(Requirement, _declared()) if each.marker is not None]
    named = [(found[1], each) for each, marker in marked if (found := _EXTRA.search(marker))]
    return {extra: each for extra, each in named if extra not in _FOR_DEVELOPERS}


def _declared() -> list[str]:
    """The requirements in our metadata; none where lme runs uninstalled."""
    try:
        return requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        return []


def _requirement(package: str) -> str:
    """`package` with the bounds in our metadata; without, where lme runs uninstalled."""
    for requirement in _declared():
        bounded = requirement.partition(";")[0].strip()
        if re.split(r"[<>=!~\[ ]", bounded, maxsplit=1)[0] == package:
            return bounded
    return package
