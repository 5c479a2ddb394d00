"""Names in outputs/weights/: NAME.yaml for learned parameters, NAME.onnx for networks."""

from __future__ import annotations

import os
from collections.abc import Container
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from lme.errors import InputError
from lme.guides.lme.weight_files import REGISTERED
from lme.inputs.guarded_file import YAML_BYTES, SafeLoader, check_structure, read_text


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


def read_key(path: Path, key: str) -> Any:
    """Return the value of a key in a YAML file; None if there is no such file or key."""
    content: Any = None
    with suppress(OSError, ValueError, yaml.YAMLError):
        text = read_text(path, YAML_BYTES)
        check_structure(text)
        content = yaml.load(text, Loader=SafeLoader)
    return content.get(key) if isinstance(content, dict) else None
