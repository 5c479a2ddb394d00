"""Ablations: `conf/ablation/*.yaml` and a user's own. Each sets keys of the config and has a label for tables."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from lme.config.composer import SHIPPED
from lme.errors import InputError
from lme.inputs.resources import overlaid
from runners.config.catalogue import Catalogue

GROUP = "ablation"
SEVERAL = "+"  # joins the names of ablations that are chosen together


def settings(choice: str, catalogue: Catalogue) -> dict[str, Any]:
    """Return what an ablation, or several joined by +, sets in the whole config. Names without a file set nothing."""
    merged: dict[str, Any] = {}
    for name in choice.split(SEVERAL):
        if catalogue.has(f"{GROUP}/{name}"):
            merged = overlaid(merged, catalogue.option(f"{GROUP}/{name}").settings)
    return merged


@cache
def labels(folders: tuple[Path, ...] = SHIPPED) -> Mapping[str, str]:
    """Return the text that tables add to a system's name, such as "without memory", by ablation; read once.

    Raises InputError for a label that is not text.
    """
    catalogue = Catalogue(folders)
    found = {name: _label(name, catalogue) for name in catalogue.options(GROUP)}
    return {name: label for name, label in found.items() if label}


def describe_ablation(choice: str, known: Mapping[str, str]) -> str:
    """Return "without c_o and without c_t" for "no_c_o+no_c_t"; empty if one has no label. known: labels by name."""
    names = choice.split(SEVERAL)
    return " and ".join(known[name] for name in names) if known.keys() >= set(names) else ""


def _label(name: str, catalogue: Catalogue) -> str:
    node = settings(name, catalogue).get("system")
    label = node.get("ablated", "") if isinstance(node, dict) else ""
    if not isinstance(label, str):
        raise InputError(f"{catalogue.file(f'{GROUP}/{name}')}: system.ablated is {label!r}: must be text")
    return label
