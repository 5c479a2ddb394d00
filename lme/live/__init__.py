"""Driving a real robot: from the messages of its sensors to observations, and from decisions to safe commands.

Nothing here imports ROS. Messages are any objects with the fields of their ROS type. `LiveDriver` does it all; the
names below, which are its arguments and its answer, are imported on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lme.live.config import LiveConfig as LiveConfig
    from lme.live.config import ScanConfig as ScanConfig
    from lme.live.driver import LiveDriver as LiveDriver
    from lme.live.frames import FramesConfig as FramesConfig
    from lme.live.step import LiveState as LiveState
    from lme.live.step import LiveStep as LiveStep

_MODULES = {
    "FramesConfig": "lme.live.frames",
    "LiveConfig": "lme.live.config",
    "LiveDriver": "lme.live.driver",
    "LiveState": "lme.live.step",
    "LiveStep": "lme.live.step",
    "ScanConfig": "lme.live.config",
}
__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    """Return a public name, imported from the module that defines it."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)
