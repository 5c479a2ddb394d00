"""The score S (paper Eq. 7) and the eight trained parameters (§III.F)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import njit

from lme.errors import InputError, nearest
from lme.inputs.guarded_file import read_yaml
from lme.types import Floats

CRITERIA = ("a_close", "a_dev", "c_o", "c_t", "a_mount", "c_h")  # the paper's criteria in the order of w1…w6
THRESHOLDS = ("d1", "d2")  # of subgoal maintenance


@dataclass(frozen=True, slots=True)
class Parameters:
    """Weights (C,), one per criterion in their order, and the thresholds d1 [m] and d2 of subgoal maintenance."""

    weights: Floats
    d1: float
    d2: float

    @classmethod
    def from_mapping(cls, values: Mapping[str, float], criteria: Sequence[str]) -> Parameters:
        """Take the weight of each criterion by name, then d1 and d2.

        Raises InputError if a name is missing or unknown, a value is negative or NaN, or a weight is infinite.
        """
        names = [*criteria, *THRESHOLDS]
        for name, value in values.items():
            if name not in names:
                raise InputError(
                    f"parameter {name!r} is unknown: {nearest(name, names)}must be one of {', '.join(names)}"
                )
            if math.isnan(value) or value < 0 or (math.isinf(value) and name not in THRESHOLDS):
                finite = "" if name in THRESHOLDS else " and finite"
                raise InputError(f"parameter {name} is {value:g}: must be at least 0{finite}")
        missing = [name for name in names if name not in values]
        if missing:
            raise InputError(
                f"parameter {missing[0]} is missing: must be given for each of {', '.join(names)}"
            )
        return cls(
            np.array([float(values[name]) for name in criteria]), float(values["d1"]), float(values["d2"])
        )


@njit(cache=True)
def score(features: Floats, weights: Floats) -> Floats:
    """S of Eq. 7 for (C, N) features and (C,) weights: (N,).

    The sum is taken in the order of the criteria, because a matrix product may round equal candidates differently.
    """
    scores = np.empty(features.shape[1])
    for j in range(len(scores)):
        scores[j] = weights[0] * features[0, j]
        for i in range(1, len(weights)):
            scores[j] += weights[i] * features[i, j]
    return scores


@njit(cache=True)
def rank(features: Floats, weights: Floats, candidates: int, reachable: int) -> tuple[Floats, int, bool]:
    """S of all N points, index of the best candidate, and whether no candidate is reachable.

    The first points are the candidates. reachable: row of the (C, N) features that is 0 where a point is not
    reachable.
    """
    scores = score(features, weights)
    new = int(np.argmax(scores[:candidates]))
    return scores, new, not np.any(features[reachable, :candidates] != 0.0)


def read_parameters(path: Path, criteria: Sequence[str]) -> dict[str, float]:
    """Read the parameters of a weight file: one weight per criterion, d1 [m] and d2.

    Raises InputError, naming the file, if it cannot be read or if a parameter is missing, unknown, not a
    number, negative or NaN.
    """
    content = read_yaml(path)
    values = content.get("parameters") if isinstance(content, dict) else None
    if not isinstance(values, dict):
        raise InputError(f"weights file {path}: must hold a mapping `parameters` of names to numbers")
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"weights file {path}: parameters.{name} is {value!r:.80}: must be a number")
    try:
        parameters = {str(name): float(value) for name, value in values.items()}
        Parameters.from_mapping(parameters, criteria)
    except (InputError, OverflowError) as error:
        raise InputError(f"weights file {path}: {error}") from error
    return parameters
