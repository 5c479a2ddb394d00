"""The learned parameters: by name from `conf/weight_set/`, or from a file."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path

import yaml

from lme.errors import InputError
from lme.resources import resource_dir


def parameters(weights: str, ablation: Mapping[str, float]) -> dict[str, float]:
    """The parameters of a weight set, with those of the ablation in their place.

    weights: a name in `conf/weight_set/` or the path of a YAML with a mapping `parameters`.
    Raises InputError naming the file where it is missing or malformed.
    """
    return {**_read(_find(weights)), **ablation}


def _find(weights: str) -> Path:
    shipped = {path.stem: path for path in sorted((resource_dir("conf") / "weight_set").glob("*.yaml"))}
    if weights in shipped:
        return shipped[weights]
    path = Path(weights)
    if path.is_file():
        return path
    close = difflib.get_close_matches(weights, shipped, 1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise InputError(
        f"weights is {weights!r}: {hint}must be one of {', '.join(shipped)}, or the path of a weight file"
    )


def _read(path: Path) -> dict[str, float]:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"weights file {path}: cannot be read ({reason})") from error
    values = content.get("parameters") if isinstance(content, dict) else None
    if not isinstance(values, dict):
        raise InputError(f"weights file {path}: must hold a mapping `parameters` of names to numbers")
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"weights file {path}: parameters.{name} is {value!r}: must be a number")
    return {str(name): float(value) for name, value in values.items()}
