"""The weight sets that guides take, and the scale of their parameters in words."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from lme.errors import InputError
from lme.guides.lme.score import CRITERIA, THRESHOLDS
from lme.guides.lme.weight_files import own_names, own_weights
from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten

_TAKEN = re.compile(r"\$\{.*(?<!\w\.)\bweights\b")  # of the whole config; not ${planner.weights}
TIMES = "\u00d7"  # a typographic sign that is easily taken for a letter


@cache
def own_weights_of(guide: str, folders: tuple[Path, ...]) -> str | None:
    """The same of an option of the group `guide`, read once; None if the option no longer exists."""
    try:
        return own_weights(Catalogue(folders).values(f"guide/{guide}"))
    except (FileNotFoundError, InputError):
        return None


def parameter_names(guide: Mapping[str, Any]) -> list[str]:
    """The parameters that a guide's config, not resolved, takes from a weight set; none where it takes none."""
    own = own_weights(guide)
    if own is not None:
        return own_names(own)
    return [*CRITERIA, *THRESHOLDS, *(guide.get("criteria") or {})] if takes_weights(guide) else []


def takes_weights(node: Mapping[str, Any]) -> bool:
    """Whether a config, not resolved, interpolates the key `weights`."""
    return any(isinstance(value, str) and _TAKEN.search(value) for _, value in flatten(node))


def check_scale(scale: Mapping[str, float], guide: Mapping[str, Any]) -> None:
    """Raise InputError for factors if the guide's config has no parameters to multiply."""
    if scale and "parameters" not in guide:
        raise InputError(
            f"scale is {dict(scale)}: {guide['_target_']} has no parameters to multiply; must be {{}}"
        )


def scale_in_words(scale: Mapping[str, float]) -> str:
    """A scale as a table shows it: "a_close × 0.5", several with commas between; empty where it changes nothing."""
    return ", ".join(f"{name} {TIMES} {float(factor):.12g}" for name, factor in scale.items() if factor != 1)


def scale_from_words(text: str) -> dict[str, float]:
    """The scale of a text that `scale_in_words` made."""
    pairs = [part.split(f" {TIMES} ") for part in text.split(", ") if part]
    return {name: float(factor) for name, factor in pairs}
