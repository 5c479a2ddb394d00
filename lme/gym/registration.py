"""Gymnasium's ids of the environments, registered without importing Gymnasium, whichever of the two comes first."""

from __future__ import annotations

import importlib.util
import sys
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

NAMESPACE = "lme"
_GYMNASIUM = "gymnasium"

MAPS = {  # name in the id: map set, and the robot that drives there unless another is chosen
    "Barn": ("barn", "jackal"),
    "DynaBarn": ("dynabarn", "jackal"),
    "Social": ("social", "jackal"),
    "Env1": ("env1", "stage"),
    "Env2": ("env2", "stage"),
    "Traps": ("traps", "stage"),
    "Indoor": ("indoor", "turtlebot2"),
    "Real1": ("real1", "turtlebot2"),
    "Real1Dynamic": ("real1_dynamic", "turtlebot2"),
    "Real2": ("real2", "turtlebot2"),
    "Real3": ("real3", "turtlebot2"),
    "Real4": ("real4", "turtlebot2"),
    "Go2A": ("go2_a", "go2"),
    "Go2B": ("go2_b", "go2"),
    "Empty": ("empty", "jackal"),
    "File": ("file", "stage"),  # needs map_config={"path": …}
    "Tracks": ("tracks", "jackal"),  # needs map_config={"path": …}
    "Building": ("building", "turtlebot2"),  # needs map_config={"paths": […]}
}


def register_with_gymnasium() -> None:
    """Register the environments now if Gymnasium has been imported, else as soon as it is.

    `gym.make("lme:lme/Barn-v0")` imports `lme`, but does not run it again if it has been imported before.
    """
    if sys.modules.get(_GYMNASIUM):
        _register()
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
                _register()

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


def _register() -> None:
    from gymnasium.envs.registration import register, registry

    for name, (map_set, robot) in MAPS.items():
        env_id = f"{NAMESPACE}/{name}-v0"
        if env_id not in registry:
            register(
                env_id,
                entry_point="lme.gym.envs:NavigationEnv",
                vector_entry_point="lme.gym.envs:NavigationVectorEnv",
                kwargs={"map": map_set, "robot": robot},
            )
