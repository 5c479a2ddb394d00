"""Weight files: YAML with the trained parameters, `parameters: {a_close: 1.51, …}`, and their metadata."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lme.errors import InputError
from lme.policies.lme.score import Parameters
from lme.yaml_entry import read_yaml


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
