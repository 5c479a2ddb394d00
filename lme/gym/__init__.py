"""Environments for reinforcement learning: one robot, or many moved by one compiled call.

    import gymnasium as gym
    env = gym.make("lme:lme/Barn-v0", robot="jackal", map_config={"subset": "fresh"})
    envs = gym.make_vec("lme:lme/Barn-v0", num_envs=64)

docs/howto/environments.md describes them. `Fleet` needs no Gymnasium; names are imported on first use.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from lme.errors import InputError

if TYPE_CHECKING:
    from lme.gym.envs import NavigationEnv as NavigationEnv
    from lme.gym.envs import NavigationVectorEnv as NavigationVectorEnv
    from lme.gym.episodes import Reward as Reward
    from lme.gym.fleet import Fleet as Fleet
    from lme.gym.spaces import FlatObservation as FlatObservation
    from lme.gym.spaces import flattened as flattened

_MODULES = {
    "FlatObservation": "lme.gym.spaces",
    "Fleet": "lme.gym.fleet",
    "NavigationEnv": "lme.gym.envs",
    "NavigationVectorEnv": "lme.gym.envs",
    "Reward": "lme.gym.episodes",
    "flattened": "lme.gym.spaces",
}
__all__ = [*_MODULES]


def __getattr__(name: str) -> Any:
    """Return a public name from its module. Raises InputError if that module needs Gymnasium, which is missing."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        module = importlib.import_module(_MODULES[name])
    except ModuleNotFoundError as error:
        if error.name != "gymnasium":
            raise
        from lme.requirements import install

        raise InputError(f"lme.gym.{name} needs Gymnasium: {install('gymnasium')}") from None
    return getattr(module, name)
