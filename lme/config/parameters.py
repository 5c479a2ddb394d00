"""The parameters of a guide: a weight set, multiplied, and with those of an ablation in their place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from lme.errors import InputError, nearest
from lme.guides.lme.weight_files import PUBLISHED, learned_parameters


def parameters(
    weights: str,
    ablation: Mapping[str, float],
    criteria: Iterable[str] = (),
    scale: Mapping[str, float] | None = None,
    weight_set: str = PUBLISHED,
) -> dict[str, float]:
    """Return the parameters of a weight set, multiplied by `scale`, with those of the ablation in their place.

    weights: a name in `conf/weight_set/` or `outputs/weights/`, the directory of a training run, or the path of
    a YAML with a mapping `parameters`; the paper's set stands for the guide's own. criteria: names of criteria besides
    those of the guide's own set. scale: factors by name; an ablation replaces what they give. weight_set: the guide's
    own. Raises InputError naming the file where it is missing or malformed, and for a scale of no parameter or a
    factor that is negative or not finite.
    """
    learned = learned_parameters(weights, weight_set, criteria)
    factors = scale or {}
    for name, factor in factors.items():
        if name not in learned:
            names = sorted(learned)
            raise InputError(
                f"scale.{name}: no such key; {nearest(name, names)}scale holds: {', '.join(names)}"
            )
        if not (math.isfinite(factor) and factor >= 0):
            raise InputError(f"scale.{name} is {factor:g}: must be a number, at least 0 and finite")
    return {**learned, **{name: learned[name] * factor for name, factor in factors.items()}, **ablation}
