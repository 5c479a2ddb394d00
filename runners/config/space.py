"""Search space: config keys and their ranges, nested in `space` as in the config."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

from lme.errors import InputError, nearest, require
from runners.config.changes import flatten
from runners.config.instantiate import fill_dataclass
from runners.config.schema import SystemConfig, TrainConfig

PARAMETERS = "guide.parameters."

C = TypeVar("C", bound=SystemConfig)


@dataclass(slots=True)
class Range:
    """Lowest and highest value. log: uniform in the logarithm."""

    low: float
    high: float
    log: bool = False


Space = dict[str, Range]  # by dotted config key


def read_space(config: TrainConfig, ablated: Collection[str] = ()) -> Space:
    """Read the ranges of a composed config's `space`, without the parameters and keys that an ablation fixes.

    ablated: dotted keys that the ablation's file sets.

    Raises InputError if there is none, for a key that the config lacks or that holds no number, and for a range that
    is empty or, if logarithmic, not positive.
    """
    fixed = {*ablated, *(f"{PARAMETERS}{name}" for name in config.ablation)}
    space = {key: bounds for key, bounds in _ranges(config.space, "") if key not in fixed}
    if not space:
        raise InputError(
            "space is empty: must hold a range {low, high, log} for at least one key of the config"
        )
    known = dict(flatten(asdict(config)))
    for key, bounds in space.items():
        _check_key(key, known)
        require(f"space.{key}.low", bounds.low, **({"above": 0.0} if bounds.log else {"at_least": 0.0}))
        require(f"space.{key}.high", bounds.high, above=bounds.low)
    return space


def own_values(config: TrainConfig, space: Space) -> dict[str, float]:
    """Return the config's own values of the keys of the space, if they lie in the ranges."""
    known = dict(flatten(asdict(config)))
    return {
        key: float(known[key])
        for key, bounds in space.items()
        if known[key] is not None and bounds.low <= known[key] <= bounds.high
    }


def with_values(config: C, values: Mapping[str, Any]) -> C:
    """Return a copy of a config with other values under these dotted keys."""
    changed = copy.deepcopy(config)
    for key, value in values.items():
        *path, name = key.split(".")
        node: Any = changed
        for part in path:
            node = node[part] if isinstance(node, dict) else getattr(node, part)
        if isinstance(node, dict):
            node[name] = value
        else:
            setattr(node, name, value)
    return changed


def _ranges(node: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Range]]:
    for name, child in node.items():
        key = f"{prefix}{name}"
        if not isinstance(child, Mapping):
            raise InputError(f"space.{key} is {child!r}: must be a range {{low, high, log}}")
        if isinstance(child.get("low", {}), Mapping) and isinstance(child.get("high", {}), Mapping):
            yield from _ranges(child, f"{key}.")
        else:
            yield key, fill_dataclass(Range, child, f"space.{key}")


def _check_key(key: str, known: Mapping[str, Any]) -> None:
    if key not in known:
        raise InputError(
            f"space.{key}: the config has no {key}; {nearest(key, known)}choose the space of what is trained, "
            "space=NAME"
        )
    if isinstance(known[key], bool) or not isinstance(known[key], int | float | None):
        raise InputError(f"space.{key}: {key} is {known[key]!r}: only numbers can be searched")
