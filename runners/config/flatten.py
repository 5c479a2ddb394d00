"""Nested configs as dotted keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any


def flatten(config: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield ("a.b", value) for every leaf of a nested mapping."""
    for key, value in config.items():
        if isinstance(value, Mapping):
            yield from flatten(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def dotted_keys(config: Mapping[str, Any], prefix: str = "") -> set[str]:
    """Return "a" and "a.b" for every mapping and every leaf of a nested mapping."""
    keys = set()
    for name, child in config.items():
        keys.add(f"{prefix}{name}")
        if isinstance(child, dict):
            keys |= dotted_keys(child, f"{prefix}{name}.")
    return keys
