"""Registers the environments with Gymnasium, whichever of the two is imported first, without importing Gymnasium."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

_GYMNASIUM = "gymnasium"
_REGISTRATION = "lme.gym.registration"


def register_with_gymnasium() -> None:
    """Register the environments now if Gymnasium is there, else as soon as it is imported.

    `gym.make("lme:lme/Barn-v0")` imports `lme`, but not again if it is already imported.
    """
    if sys.modules.get(_GYMNASIUM):
        importlib.import_module(_REGISTRATION)
    else:
        sys.meta_path.insert(0, _Watcher())


class _Watcher:
    """Waits on Python's import path for Gymnasium, and leaves the loading to its usual loader."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name != _GYMNASIUM:
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        if spec is not None and spec.loader is not None:
            load = spec.loader.exec_module

            def load_and_register(module: ModuleType) -> None:
                load(module)
                importlib.import_module(_REGISTRATION)

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec
