"""The learned parameters: by name, from a training run, or from a file."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path

from lme.errors import InputError
from lme.policy.score import CRITERIA
from lme.policy.weights import read_parameters
from lme.resources import resource_dir

WEIGHTS = "weights.yaml"  # in the directory of a training run
REGISTERED = Path("outputs") / "weights"


def parameters(weights: str, ablation: Mapping[str, float], criteria: Iterable[str] = ()) -> dict[str, float]:
    """The parameters of a weight set, with those of the ablation in their place.

    weights: a name in `conf/weight_set/` or `outputs/weights/`, the directory of a training run, or the path of
    a YAML with a mapping `parameters`. criteria: names of criteria beside the paper's six.
    Raises InputError naming the file where it is missing or malformed.
    """
    return {**read_parameters(find(weights), (*CRITERIA, *criteria)), **ablation}


def find(weights: str) -> Path:
    """The weight file that `weights` names. Raises InputError where there is none."""
    shipped = {path.stem: path for path in sorted((resource_dir("conf") / "weight_set").glob("*.yaml"))}
    if weights in shipped:
        return shipped[weights]
    path = Path(weights)
    if path.is_file():
        return path
    if path.is_dir():
        return _of_run(path)
    registered = {path.stem: path for path in sorted(REGISTERED.glob("*.yaml"))}
    if weights in registered:
        return registered[weights]
    known = [*shipped, *registered]
    close = difflib.get_close_matches(weights, known, 1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise InputError(
        f"weights is {weights!r}: {hint}must be one of {', '.join(known)}, the directory of a training run, "
        "or the path of a weight file"
    )


def _of_run(directory: Path) -> Path:
    if not (directory / WEIGHTS).is_file():
        raise InputError(
            f"weights is {directory}: holds no {WEIGHTS}; must be the directory of a finished lme train "
            f"(finish it with lme train resume={directory})"
        )
    return directory / WEIGHTS
