"""Requirements in lme's package metadata, for `lme doctor`."""

from __future__ import annotations

import re

from packaging.requirements import Requirement

from lme.requirements import declared

_FOR_DEVELOPERS = {"dev", "docs"}
_EXTRA = re.compile(r'extra == "([\w-]+)"')


def needed() -> list[Requirement]:
    """Return the requirements of every installation; none if lme is not installed."""
    return [each for each in map(Requirement, declared()) if each.marker is None]


def optional() -> dict[str, list[Requirement]]:
    """Return the packages of each extra by its name, without the extras for developers."""
    marked = [(each, str(each.marker)) for each in map(Requirement, declared()) if each.marker is not None]
    named = [(found[1], each) for each, marker in marked if (found := _EXTRA.search(marker))]
    extras = dict.fromkeys(extra for extra, _ in named if extra not in _FOR_DEVELOPERS)
    return {extra: [each for name, each in named if name == extra] for extra in extras}
