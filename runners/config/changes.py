"""Changed keys: those with other values than in the files of the chosen options."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omegaconf import DictConfig, OmegaConf

from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten

GROUPS = ("robot", "map", "guide", "planner", "ablation", "sim")  # the groups that an episode depends on
HAVE_COLUMNS = ("map.subset", "map.worlds")  # records hold these in columns of their own


def changed_keys(config: DictConfig, choices: Mapping[str, str], catalogue: Catalogue) -> dict[str, Any]:
    """Dotted keys and values of a composed config that differ from the files of its `choices`.

    Values that a file interpolates, such as the guide's parameters, are left out: what they follow is recorded.
    """
    changes = {}
    for group in GROUPS:
        if group not in choices or group not in config:
            continue
        written = dict(flatten(catalogue.values(f"{group}/{choices[group]}"), f"{group}."))
        interpolated = tuple(
            key for key, value in written.items() if isinstance(value, str) and "${" in value
        )
        node: Any = OmegaConf.to_container(config[group], resolve=True)
        for key, value in flatten(node, f"{group}."):
            known = key in written and written[key] == value
            if not known and key not in HAVE_COLUMNS and not key.startswith(interpolated):
                changes[key] = value
    return changes


def in_words(changes: Mapping[str, Any]) -> str:
    """ "robot.v_max=1, sim.latency=0.1"; empty where nothing is changed."""
    return ", ".join(f"{key}={_shown(value)}" for key, value in changes.items())


def _shown(value: Any) -> str:
    """A value as text without ", ", which separates the keys."""
    return str(value).replace(", ", ",")
