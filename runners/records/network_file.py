"""Files of a learned network: `weights.onnx` and its card, in the run's directory and under its name."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from lme.errors import InputError
from lme.guides.lme.weight_files import NETWORK, REGISTERED, shipped_networks
from runners.records import registered_name
from runners.records.atomic_write import replacing, write_atomically
from runners.records.registered_name import read_key
from runners.records.versions import versions

CARD = "card.yaml"  # in the run's directory; NAME.card.yaml next to the registered network
_PACKAGES = ("numpy", "numba", "torch", "onnxruntime")


def register(run_dir: Path, name: str, about: Mapping[str, Any], use: str) -> list[Path]:
    """Copy the network of a run to outputs/weights/NAME.onnx and write its card next to both.

    about: entries of the card. use: command that drives with the network. Returns the files in `run_dir`.
    Raises OSError.
    """
    content = {"name": name, **about, "versions": versions(*_PACKAGES)}
    text = f"# Written by lme learn; use with: {use}\n{yaml.safe_dump(content, sort_keys=False, allow_unicode=True)}"
    REGISTERED.mkdir(parents=True, exist_ok=True)
    with replacing(REGISTERED / f"{name}.onnx") as draft:
        shutil.copyfile(run_dir / NETWORK, draft)
    for path in (run_dir / CARD, _card(name)):
        write_atomically(path, text)
    return [run_dir / NETWORK, run_dir / CARD]


def check_name(name: str, training: str) -> None:
    """Raise InputError unless `name` is free, or holds a network of the same training. training: its fingerprint."""
    registered_name.check_name(name, ".onnx", "a network", shipped_networks())
    path = REGISTERED / f"{name}.onnx"
    if path.exists() and read_key(_card(name), "training") != training:
        raise InputError(f"name is {name!r}: {path} holds another network; choose another name")


def _card(name: str) -> Path:
    return REGISTERED / f"{name}.{CARD}"
