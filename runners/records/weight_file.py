"""Weight file of a training: a YAML file that `lme eval weights=…` and the library load."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from lme.errors import InputError
from lme.guides.lme.weight_files import REGISTERED, WEIGHTS, shipped_weights
from runners.config.schema import TrainConfig
from runners.config.space import PARAMETERS
from runners.records import registered_name
from runners.records.atomic_write import write_atomically
from runners.records.registered_name import read_key
from runners.records.versions import versions

_PACKAGES = ("numpy", "numba", "optuna")


def write_weights(
    config: TrainConfig,
    values: Mapping[str, float],
    metadata: Mapping[str, Any],
    run_dir: Path,
    name: str,
    note: str,
) -> Path:
    """Write `weights.yaml` into `run_dir`, and as outputs/weights/NAME.yaml if a guide can load it.

    values: those of the best trial, by dotted config key. metadata: further entries of the file.
    note: what follows "Written by lme train" in its first line. Returns the path of the first file. Raises OSError.
    """
    parameters = best_parameters(config, values)
    content = {
        "name": name,
        "parameters": parameters,
        **({"settings": other_settings} if (other_settings := _other_settings(values)) else {}),
        "robot": config.robot.name,
        **metadata,
        "seed": config.seed,
        "versions": versions(*_PACKAGES),
    }
    text = f"# Written by lme train{note}\n{yaml.safe_dump(content, sort_keys=False, allow_unicode=True)}"
    for path in (run_dir / WEIGHTS, *([REGISTERED / f"{name}.yaml"] if parameters else [])):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, text)
    return run_dir / WEIGHTS


def best_parameters(config: TrainConfig, values: Mapping[str, float]) -> dict[str, float]:
    """Return the guide's parameters with the values found; {} for a guide without parameters."""
    searched = {
        key.removeprefix(PARAMETERS): value for key, value in values.items() if key.startswith(PARAMETERS)
    }
    fixed = {name: float(value) for name, value in config.guide.get("parameters", {}).items()}
    return fixed | searched


def check_name(name: str, study: str) -> None:
    """Raise InputError unless `name` is free, or holds weights of the same study. study: its fingerprint."""
    registered_name.check_name(name, ".yaml", "a weight set", shipped_weights())
    path = REGISTERED / f"{name}.yaml"
    if path.exists() and read_key(path, "study") != study:
        raise InputError(f"name is {name!r}: {path} holds the weights of another study; choose another name")


def settings(values: Mapping[str, float]) -> list[str]:
    """Return the overrides that set the values found for keys that are not parameters of the guide."""
    return [f"{key}={value!r}" for key, value in _other_settings(values).items()]


def _other_settings(values: Mapping[str, float]) -> dict[str, float]:
    return {key: value for key, value in values.items() if not key.startswith(PARAMETERS)}
