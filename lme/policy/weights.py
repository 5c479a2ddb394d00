"""Weight files: the learned parameters as YAML, `parameters: {a_close: 1.51, …}` and what else is told of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lme.errors import InputError
from lme.policy.score import Parameters
from lme.yaml_entry import read_yaml


def read_parameters(path: Path, criteria: Sequence[str]) -> dict[str, float]:
    """The parameters in a weight file: one per criterion, d1 [m] and d2.

    Raises InputError naming the file where it cannot be read, and where a parameter is missing, unknown, no
    number, negative or NaN.
    """
    content = read_yaml(path)
    values = content.get("parameters") if isinstance(content, dict) else None
    if not isinstance(values, dict):
        raise InputError(f"weights file {path}: must hold a mapping `parameters` of names to numbers")
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"weights file {path}: parameters.{name} is {value!r}: must be a number")
    parameters = {str(name): float(value) for name, value in values.items()}
    try:
        Parameters.from_mapping(parameters, criteria)
    except InputError as error:
        raise InputError(f"weights file {path}: {error}") from error
    return parameters
