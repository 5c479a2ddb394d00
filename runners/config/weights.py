"""Weight sets that guides take, and the scale of their parameters in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lme.errors import InputError
from lme.guides.lme.weight_files import PUBLISHED
from runners.config.flatten import flatten

PARAMETERS = "${parameters:}"  # the parameters of a guide, by the key `weights`
TIMES = "\u00d7"  # escaped, since × looks like the letter x


def own_weights(guide: Mapping[str, Any]) -> str | None:
    """Return the weight set of a guide's unresolved config; None if its parameters do not follow a weight set."""
    return guide.get("weight_set", PUBLISHED) if guide.get("parameters") == PARAMETERS else None


def takes_weights(node: Mapping[str, Any]) -> bool:
    """Return whether an unresolved config interpolates the key `weights`."""
    return any(value in (PARAMETERS, "${weights}") for _, value in flatten(node))


def check_scale(scale: Mapping[str, float], guide: Mapping[str, Any]) -> None:
    """Raise InputError for factors if the guide's config has no parameters to multiply."""
    if scale and "parameters" not in guide:
        raise InputError(
            f"scale is {dict(scale)}: {guide['_target_']} has no parameters to multiply; must be {{}}"
        )


def scale_in_words(scale: Mapping[str, float]) -> str:
    """Return a scale as a table shows it, "a_close × 0.5", separated by commas; empty if it changes nothing."""
    return ", ".join(f"{name} {TIMES} {float(factor):.12g}" for name, factor in scale.items() if factor != 1)


def scale_from_words(text: str) -> dict[str, float]:
    """Return the scale of a text from `scale_in_words`."""
    pairs = [part.split(f" {TIMES} ") for part in text.split(", ") if part]
    return {name: float(factor) for name, factor in pairs}
