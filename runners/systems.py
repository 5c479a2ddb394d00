"""Named pairs of guide and planner, with their published figures: `conf/system/*.yaml`."""

from __future__ import annotations

from typing import Any

import yaml

from lme.resources import resource_dir


def systems() -> list[dict[str, Any]]:
    """Every named pair: {guide, planner, label, global_planner, published}."""
    files = sorted((resource_dir("conf") / "system").glob("*.yaml"))
    return [yaml.safe_load(path.read_text(encoding="utf-8"))["system"] for path in files]


def label(guide: str, planner: str) -> str:
    """The pair's own name, or "guide+planner" where it has none."""
    for system in systems():
        if (system["guide"], system["planner"]) == (guide, planner):
            return str(system["label"])
    return f"{guide}+{planner}"
