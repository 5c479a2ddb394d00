"""Files of what was trained, in the run's directory and by name in outputs/weights/; and how `lme eval` drives with it.

`weights.yaml` holds learned parameters, and becomes NAME.yaml. `weights.onnx` is a network, and becomes NAME.onnx with
a card beside it.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Collection, Container, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from lme.errors import InputError
from lme.guides.lme.weight_files import NETWORK, REGISTERED, WEIGHTS, shipped_networks, shipped_weights
from lme.inputs.guarded_file import YAML_BYTES, SafeLoader, check_structure, read_text
from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.quoting import key_of
from runners.config.schema import SystemConfig, TrainConfig
from runners.config.space import PARAMETERS
from runners.config.systems import PAIR
from runners.records.atomic_write import replacing, write_atomically
from runners.records.launch_record import versions

CARD = "card.yaml"  # in the run's directory; NAME.card.yaml next to the registered network
# Parts of the config that drive a robot, and those that are groups: a file can choose their option.
_DRIVES = ("robot", "system", "guide", "planner", "filter", "ablation", "scale", "sim", "cap", "feedback")
_OPTIONS = ("robot", "system", *PAIR, "filter", "sim")


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
    parameters, settings = best_parameters(config, values), other_settings(values)
    content = {
        "name": name,
        "parameters": parameters,
        **({"settings": settings} if settings else {}),
        "robot": config.robot.name,
        **metadata,
        "seed": config.seed,
        "versions": versions("numpy", "numba", "optuna"),
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


def check_weights_name(name: str, study: str) -> None:
    """Raise InputError unless `name` is free, or holds weights of the same study. study: its fingerprint."""
    check_name(name, ".yaml", "a weight set", shipped_weights())
    path = REGISTERED / f"{name}.yaml"
    if path.exists() and _read_key(path, "study") != study:
        raise InputError(f"name is {name!r}: {path} holds the weights of another study; choose another name")


def other_settings(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values found for keys that are not parameters of the guide."""
    return {key: value for key, value in values.items() if not key.startswith(PARAMETERS)}


def settings_words(values: Mapping[str, float]) -> list[str]:
    """Return the overrides that set the values of `other_settings`."""
    return [f"{key}={value!r}" for key, value in other_settings(values).items()]


def register_network(run_dir: Path, name: str, about: Mapping[str, Any], use: str) -> list[Path]:
    """Copy the network of a run to outputs/weights/NAME.onnx and write its card next to both.

    about: entries of the card. use: command that drives with the network. Returns the files in `run_dir`.
    Raises OSError.
    """
    content = {"name": name, **about, "versions": versions("numpy", "numba", "torch", "onnxruntime")}
    text = f"# Written by lme learn; use with: {use}\n{yaml.safe_dump(content, sort_keys=False, allow_unicode=True)}"
    REGISTERED.mkdir(parents=True, exist_ok=True)
    with replacing(REGISTERED / f"{name}.onnx") as draft:
        shutil.copyfile(run_dir / NETWORK, draft)
    for path in (run_dir / CARD, _card(name)):
        write_atomically(path, text)
    return [run_dir / NETWORK, run_dir / CARD]


def check_network_name(name: str, training: str) -> None:
    """Raise InputError unless `name` is free, or holds a network of the same training. training: its fingerprint."""
    check_name(name, ".onnx", "a network", shipped_networks())
    path = REGISTERED / f"{name}.onnx"
    if path.exists() and _read_key(_card(name), "training") != training:
        raise InputError(f"name is {name!r}: {path} holds another network; choose another name")


def _card(name: str) -> Path:
    return REGISTERED / f"{name}.{CARD}"


def check_name(name: str, ending: str, kind: str, shipped: Container[str], key: str = "name") -> None:
    """Raise InputError unless `name` names a file that can be written and that no shipped file hides.

    kind: content of a shipped file, for the message.
    """
    if not name or Path(name).name != name or name.startswith("."):
        raise InputError(f"{key} is {name!r}: must be a plain file name without {ending}")
    folder = next(folder for folder in (REGISTERED, *REGISTERED.parents) if folder.exists())
    if not os.access(folder, os.W_OK):
        raise InputError(
            f"{folder.resolve()}: cannot be written, and {name} belongs there: call lme in another folder"
        )
    if name in shipped:
        raise InputError(f"{key} is {name!r}: {kind} of that name ships with lme; choose another name")


def _read_key(path: Path, key: str) -> Any:
    """Return the value of a key in a YAML file; None if there is no such file or key."""
    content: Any = None
    with suppress(OSError, ValueError, yaml.YAMLError):
        text = read_text(path, YAML_BYTES)
        check_structure(text)
        content = yaml.load(text, Loader=SafeLoader)
    return content.get(key) if isinstance(content, dict) else None


def driven(job: Job[SystemConfig], values: Collection[str]) -> list[str]:
    """Return the words of `lme eval` that choose the driving system, without those of the trained keys `values`.

    An experiment, or a config of the user's own, may have chosen parts of the system instead, so a part is named if
    it is not the default of `lme eval`. The pair is always named if more than a guide's parameters was trained.
    """
    keys = {word: key_of(word) for word in job.overrides}
    trained = {*values, *(PARAMETERS.rstrip(".") for key in values if key.startswith(PARAMETERS))}
    words = [word for word, key in keys.items() if key.partition(".")[0] in _DRIVES and key not in trained]
    defaults = Catalogue(job.folders).groups("eval")
    choices = {
        group: job.choices[group]
        for group in _OPTIONS
        if job.choices.get(group, defaults[group]) != defaults[group]
    }
    if not all(key.startswith(PARAMETERS) for key in values):
        choices |= {group: job.choices[group] for group in PAIR}
    if "system" in {*choices, *keys.values()}:  # it chooses the pair
        choices = {group: option for group, option in choices.items() if group not in PAIR}
    return [*words, *(f"{group}={option}" for group, option in choices.items() if group not in keys.values())]
