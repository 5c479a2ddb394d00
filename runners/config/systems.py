"""Systems and ablations, whose names tables show: `conf/system/*.yaml`, `conf/ablation/*.yaml`, and a user's own.

A system is a named pair of guide and planner; its published figures are in `conf/published.yaml`. An ablation sets
keys of the config.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from lme.config.composer import SHIPPED
from lme.errors import InputError, nearest
from lme.inputs.resources import overlaid
from runners.config.catalogue import Catalogue, shipped
from runners.config.instantiate import unknown_key

PAIR = ("guide", "planner")  # the groups that a system chooses
ABLATION = "ablation"
SEVERAL = "+"  # joins the names of ablations that are chosen together
_MOST_VALUES = 3  # of an ablation without a label, in tables


@dataclass(slots=True)
class System:
    """A named pair. label: its name in tables.

    global_planner: whether the guide plans on a map. published: robots and [mean, deviation] of each metric, by map.
    """

    label: str
    guide: str
    planner: str
    global_planner: bool = False
    published: Mapping[str, Any] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """Label without its settings in brackets."""
        return self.label.partition(" (")[0]


def systems(folders: tuple[Path, ...] = SHIPPED) -> Mapping[str, System]:
    """Return every named pair of the config folders by the name of its file.

    Raises InputError for a file that does not describe a pair.
    """
    return {name: _system(name, folders) for name in Catalogue(folders).options("system")}


def system_of(guide: str, planner: str, folders: tuple[Path, ...], chosen: str = "") -> dict[str, System]:
    """Return the first system with this pair by its name, `chosen` before all others; {} if there is none.

    Only files that can have the pair are read: a user's own, and shipped ones whose text chooses both.
    """
    catalogue = Catalogue(folders)
    names = catalogue.options("system")
    for name in [*(name for name in names if name == chosen), *names]:
        file = catalogue.file(f"system/{name}")
        text = file.read_text(encoding="utf-8") if file.is_relative_to(SHIPPED[0]) else None
        if text is None or (f"/guide: {guide}\n" in text and f"/planner: {planner}\n" in text):
            system = _system(name, folders)
            if (system.guide, system.planner) == (guide, planner):
                return {name: system}
    return {}


def label(guide: str, planner: str, system: System | None, changed: bool = False) -> str:
    """Return a pair's name in tables: the label of its system, or "guide+planner" without one.

    changed: whether its settings differ from those of its files. A label that names settings, such as
    "DWA (textbook)", then ends with "(changed)".
    """
    if system is None:
        return f"{guide}+{planner}"
    return f"{system.name} (changed)" if changed and system.name != system.label else system.label


def check_names(names: Iterable[str], folders: tuple[Path, ...]) -> None:
    """Raise InputError for a row of a table that is not a named pair, and for a user's own file without a pair."""
    known = Catalogue(folders).options("system")
    for name in names:
        if name not in known:
            raise InputError(f"table: {name}: {nearest(name, known)}must be one of {', '.join(known)}")
    for name in Catalogue(folders[1:]).options("system"):
        _system(name, folders)


@cache
def _system(name: str, folders: tuple[Path, ...]) -> System:
    """Read one system; once, so that all jobs of a sweep have the same."""
    catalogue = Catalogue(folders)
    file, option = catalogue.file(f"system/{name}"), catalogue.option(f"system/{name}")
    node = option.values.get("system")
    if not isinstance(node, dict):
        raise InputError(f"{file}: must hold a mapping `system` with a label")
    for key in node:
        if key != "label":
            raise InputError(f"{file}: {unknown_key(f'system.{key}', ['label'])}")
    if not isinstance(node.get("label"), str):
        raise InputError(f"{file}: system.label is {node.get('label')!r}: must be the name in tables")
    guide, planner = (option.choices.get(group) for group in PAIR)
    if not (isinstance(guide, str) and isinstance(planner, str)):
        raise InputError(f"{file}: must choose guide and planner, by `override /guide: NAME` in its defaults")
    on_map = catalogue.has(f"guide/{guide}") and "global_map" in catalogue.values(f"guide/{guide}")
    published = shipped().values("published").get(name, {})
    return System(node["label"], guide, planner, on_map, published)


def system_settings(choice: str, catalogue: Catalogue) -> dict[str, Any]:
    """Return what a system sets in the whole config besides its pair. A name without a file sets nothing."""
    name = f"system/{choice}"
    return catalogue.option(name).settings if catalogue.has(name) else {}


def own_label(label: str | None, choice: str, catalogue: Catalogue) -> str | None:
    """Return the name that a user gives a system; None if it is that of the chosen system, or if there is none."""
    return None if label == system_settings(choice, catalogue).get("system", {}).get("label") else label


def ablation_settings(choice: str, catalogue: Catalogue) -> dict[str, Any]:
    """Return what an ablation, or several joined by +, sets in the whole config. Names without a file set nothing."""
    merged: dict[str, Any] = {}
    for name in choice.split(SEVERAL):
        if catalogue.has(f"{ABLATION}/{name}"):
            merged = overlaid(merged, catalogue.option(f"{ABLATION}/{name}").settings)
    return merged


def ablation_labels(
    folders: tuple[Path, ...] = SHIPPED, choices: Iterable[str] | None = None
) -> Mapping[str, str]:
    """Return the text that tables add to a system's name, such as "without memory", by ablation.

    An ablation without a label is named by what it sets: "with c_t=0.0".

    choices: ablations, or several joined by +, whose labels are needed; None for all. Raises InputError for a label
    that is not text.
    """
    known = Catalogue(folders).options(ABLATION)
    names = known if choices is None else [name for choice in choices for name in choice.split(SEVERAL)]
    labels = {name: _label(name, folders) for name in names if name in known}
    return {name: label for name, label in labels.items() if label}


def describe_ablation(choice: str, known: Mapping[str, str]) -> str:
    """Return "without c_o and without c_t" for "no_c_o+no_c_t"; empty if one has no label. known: labels by name."""
    names = choice.split(SEVERAL)
    return " and ".join(known[name] for name in names) if known.keys() >= set(names) else ""


@cache  # read once, so that all jobs of a sweep have the same
def _label(name: str, folders: tuple[Path, ...]) -> str:
    catalogue = Catalogue(folders)
    node = ablation_settings(name, catalogue).get("system", {})
    label = node.get("ablated", "") if isinstance(node, dict) else ""
    if not isinstance(label, str):
        raise InputError(f"{catalogue.file(f'{ABLATION}/{name}')}: system.ablated is {label!r}: must be text")
    # A file that sets parameters alone has no room for a label; nor has every other one.
    values = [
        f"{key.name.removeprefix(f'{ABLATION}.')}={key.value}"
        for key in catalogue.keys(f"{ABLATION}/{name}")
        if not key.name.startswith("system.")
    ]
    if label or not values:
        return label
    return f"with {', '.join(values) if len(values) <= _MOST_VALUES else name}"
