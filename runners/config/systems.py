"""Named pairs of guide and planner, with their published figures: `conf/system/*.yaml`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any

import yaml

from lme.errors import InputError, nearest
from lme.resources import resource_dir


@cache
def systems() -> Mapping[str, Mapping[str, Any]]:
    """Every named pair by its file's name: {guide, planner, label, global_planner, published}; read once.

    One without a planner is not implemented: there are its published figures, and no more.
    """
    files = sorted((resource_dir("conf") / "system").glob("*.yaml"))
    return {path.stem: yaml.safe_load(path.read_text(encoding="utf-8"))["system"] for path in files}


def label(guide: str, planner: str) -> str:
    """The pair's own name, or "guide+planner" where it has none."""
    for system in systems().values():
        if (system["guide"], system["planner"]) == (guide, planner):
            return str(system["label"])
    return f"{guide}+{planner}"


def check_names(names: Iterable[str]) -> None:
    """Raise InputError for a row of a table that is no named pair."""
    known = systems()
    for name in names:
        if name not in known:
            raise InputError(f"table: {name}: {nearest(name, known)}must be one of {', '.join(known)}")


def check_implemented(system: Mapping[str, Any]) -> None:
    """Raise InputError for the `system` node of a pair of which there are published figures only."""
    if system and system["planner"] is None:
        raise InputError(
            f"system is {system['label']}: published figures are all there is of it, for tables; "
            f"must be one of {', '.join(name for name, each in systems().items() if each['planner'])}"
        )
