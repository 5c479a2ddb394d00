"""Parameters of a tracked run: its config, and short names for what users search for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from runners.config.flatten import flatten
from runners.records.episode_record import RunLabels

LABELS = ("system", "robot", "map", "ablation")


def parameters(config: Mapping[str, Any], labels: RunLabels | None = None) -> dict[str, Any]:
    """Return the parameters by dotted key, with labels such as system=LME, robot=jackal, map=barn, ablation=none."""
    return dict(flatten(config)) | {key: getattr(labels, key) for key in LABELS if labels is not None}
