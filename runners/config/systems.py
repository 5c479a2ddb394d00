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


@cache
def systems(folders: tuple[Path, ...] = SHIPPED) -> Mapping[str, System]:
    """Return every named pair of the config folders by the name of its file; read once.

    Raises InputError for a file that does not describe a pair.
    """
    catalogue = Catalogue(folders)
    known = {name: _read(catalogue, name) for name in catalogue.options("system")}
    figures = shipped().values("published")
    guides = {system.guide for system in known.values() if catalogue.has(f"guide/{system.guide}")}
    on_maps = {guide for guide in guides if "global_map" in catalogue.values(f"guide/{guide}")}
    for name, system in known.items():
        system.global_planner = system.guide in on_maps
        system.published = figures.get(name, {})
    return known


def label(guide: str, planner: str, known: Iterable[System], changed: bool = False) -> str:
    """Return a pair's name in tables: the label of the first `known` system with this pair, or "guide+planner".

    changed: whether its settings differ from those of its files. A label that names settings, such as
    "DWA (textbook)", then ends with "(changed)".
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
    file, option = catalogue.file(f"system/{name}"), catalogue.option(f"system/{name}")
    node = option.values.get("system")
    if not isinstance(node, dict):
        raise InputError(f"{file}: must hold a mapping `system` with a label")
    for key in node:
        if key != "label":
            raise InputError(f"{unknown_key(f'system.{key}', ['label'])} (in {file})")
    if not isinstance(node.get("label"), str):
        raise InputError(f"{file}: system.label is {node.get('label')!r}: must be the name in tables")
    guide, planner = (option.choices.get(group) for group in PAIR)
    if not (isinstance(guide, str) and isinstance(planner, str)):
        raise InputError(f"{file}: must choose guide and planner, by `override /guide: NAME` in its defaults")
    return System(node["label"], guide, planner)


ABLATION = "ablation"
SEVERAL = "+"  # joins the names of ablations that are chosen together


def ablation_settings(choice: str, catalogue: Catalogue) -> dict[str, Any]:
    """Return what an ablation, or several joined by +, sets in the whole config. Names without a file set nothing."""
    merged: dict[str, Any] = {}
    for name in choice.split(SEVERAL):
        if catalogue.has(f"{ABLATION}/{name}"):
            merged = overlaid(merged, catalogue.option(f"{ABLATION}/{name}").settings)
    return merged


@cache
def ablation_labels(folders: tuple[Path, ...] = SHIPPED) -> Mapping[str, str]:
    """Return the text that tables add to a system's name, such as "without memory", by ablation; read once.

    Raises InputError for a label that is not text.
    """
    catalogue = Catalogue(folders)
    found = {name: _label(name, catalogue) for name in catalogue.options(ABLATION)}
    return {name: label for name, label in found.items() if label}


def describe_ablation(choice: str, known: Mapping[str, str]) -> str:
    """Return "without c_o and without c_t" for "no_c_o+no_c_t"; empty if one has no label. known: labels by name."""
    names = choice.split(SEVERAL)
    return " and ".join(known[name] for name in names) if known.keys() >= set(names) else ""


def _label(name: str, catalogue: Catalogue) -> str:
    node = ablation_settings(name, catalogue).get("system")
    label = node.get("ablated", "") if isinstance(node, dict) else ""
    if not isinstance(label, str):
        raise InputError(f"{catalogue.file(f'{ABLATION}/{name}')}: system.ablated is {label!r}: must be text")
    return label
