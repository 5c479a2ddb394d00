"""Registration of the environments with Gymnasium, without importing it, whichever of the two comes first."""

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
    """Register the environments now if Gymnasium has been imported, else as soon as it is.

    `gym.make("lme:lme/Barn-v0")` imports `lme`, but does not run it again if it has been imported before.
    """
    if sys.modules.get(_GYMNASIUM):
        importlib.import_module(_REGISTRATION)
    else:
        sys.meta_path.insert(0, _Watcher())


class _Watcher:
    """Import hook that waits for Gymnasium and leaves the loading itself to the usual loader."""

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
