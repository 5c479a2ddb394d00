"""Locations of the data that ships with the package: `conf/`, `maps/`, `CITATION.cff`, in a checkout or in a wheel."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).resolve().parents[1]


def resource_dir(name: str) -> Path:
    """Folder `name` ("conf" or "maps"): next to the package in a checkout, inside it in a wheel."""
    shipped = _PACKAGE / "_data" / name
    return shipped if shipped.is_dir() else _PACKAGE.parent / name


def citation_file() -> Path:
    """Path of `CITATION.cff`, next to the package in a checkout, inside it in a wheel."""
    shipped = _PACKAGE / "_data" / "CITATION.cff"
    return shipped if shipped.is_file() else _PACKAGE.parent / "CITATION.cff"


def overlaid(base: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Merge the mapping of a YAML, `own`, over that of the one it inherits, mapping by mapping."""
    merged = dict(base)
    for key, value in own.items():
        inherited = merged.get(key)
        if isinstance(inherited, Mapping) and isinstance(value, Mapping):
            value = overlaid(inherited, value)
        merged[key] = value
    return merged
