"""Named pairs of guide and planner, with their published figures: `conf/system/*.yaml`, and a user's own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from lme.config.composer import SHIPPED
from lme.errors import InputError, nearest
from runners.config.catalogue import Catalogue
from runners.config.instantiate import fill_dataclass


@dataclass(slots=True)
class System:
    """A named pair. label: its name in tables.

    global_planner: whether it plans on a map. published: by map, the robots and [mean, deviation] of each metric.
    """

    label: str
    guide: str
    planner: str
    global_planner: bool = False
    published: dict[str, Any] | None = field(default=None)

    @property
    def name(self) -> str:
        """The label without what it says of its settings in brackets."""
        return self.label.partition(" (")[0]


@cache
def systems(folders: tuple[Path, ...] = SHIPPED) -> Mapping[str, System]:
    """Every named pair of the config folders by the name of its file; read once.

    Raises InputError for a file that does not describe a pair.
    """
    catalogue = Catalogue(folders)
    return {name: _read(catalogue, name) for name in catalogue.options("system")}


def label(guide: str, planner: str, known: Iterable[System], changed: bool = False) -> str:
    """What tables call a pair: the label of the first of the `known` that is this pair, or "guide+planner".

    changed: whether its settings are not those of its files. A label that names them, such as
    "DWA (textbook)", then says "(changed)".
    """
    for system in known:
        if (system.guide, system.planner) == (guide, planner):
            return f"{system.name} (changed)" if changed and system.name != system.label else system.label
    return f"{guide}+{planner}"


def check_names(names: Iterable[str], folders: tuple[Path, ...]) -> None:
    """Raise InputError for a row of a table that is not a named pair."""
    known = systems(folders)
    for name in names:
        if name not in known:
            raise InputError(f"table: {name}: {nearest(name, known)}must be one of {', '.join(known)}")


def _read(catalogue: Catalogue, name: str) -> System:
    file = catalogue.file(f"system/{name}")
    node = catalogue.values(f"system/{name}").get("system")
    if not isinstance(node, dict):
        raise InputError(f"{file}: must hold a mapping `system` with label, guide and planner")
    try:
        system: System = fill_dataclass(System, node, "system")
    except InputError as error:
        raise InputError(f"{error} (in {file})") from error
    return system
