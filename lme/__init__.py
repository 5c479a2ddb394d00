"""Local-Minimum Escaper: mapless mobile-robot navigation by subgoals from local observations alone.

A guide decides where to go next, a planner how to get there; a navigator is one of each. `LocalMinimumEscaper`
is the paper's policy alone, for your own robot or stack; `Lme` is the same policy as a guide.

    robot = lme.load_robot("jackal")
    escaper = lme.LocalMinimumEscaper(robot, lme.load_parameters("published"), lme.load_settings("guide/lme"))
    decision = escaper.decide(observation)  # an lme.Observation; decision.subgoal in the robot frame [m]

Any system of `lme eval` as one object, for another simulator or a robot:

    navigator = lme.load_system("lme_plus", robot)
    command = navigator.act(observation)  # an lme.Twist

To drive in simulation, combine a task of `Barn`, a `Navigator` and a `FastSimulator` in `run_episode`; or call
`evaluate`, which is `lme eval` as a function. docs/reference/python.md describes every name, and `examples/` uses them.
Frames follow REP-103: x ahead, y left, angles counter-clockwise. Units are metres, seconds and radians. Invalid input
raises `InputError`.

Names are imported on first use, since importing Numba alone takes a second.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from lme import numba_cache
from lme.gym import registration

if TYPE_CHECKING:
    from lme.config.presets import load_map_set as load_map_set
    from lme.config.presets import load_parameters as load_parameters
    from lme.config.presets import load_robot as load_robot
    from lme.config.presets import load_settings as load_settings
    from lme.config.presets import load_simulator as load_simulator
    from lme.config.systems import load_system as load_system
    from lme.errors import InputError as InputError
    from lme.evaluation import evaluate as evaluate
    from lme.guides.global_path.guide import GlobalPath as GlobalPath
    from lme.guides.lme.explanation import reason as reason
    from lme.guides.lme.guide import Lme as Lme
    from lme.guides.lme.guide import LocalMinimumEscaper as LocalMinimumEscaper
    from lme.guides.lme_plus.guide import LmePlus as LmePlus
    from lme.guides.tangent_bug.guide import TangentBug as TangentBug
    from lme.guides.target import Target as Target
    from lme.navigation.episode import run_episode as run_episode
    from lme.navigation.navigator import Navigator as Navigator
    from lme.perception.raycast import cast as cast
    from lme.planners.dwa import Dwa as Dwa
    from lme.planners.eband.planner import EBand as EBand
    from lme.planners.min_time.planner import MinTime as MinTime
    from lme.planners.simple import Simple as Simple
    from lme.robots import Footprint as Footprint
    from lme.robots import Lidar as Lidar
    from lme.robots import Robot as Robot
    from lme.simulation.fast import FastSimulator as FastSimulator
    from lme.types import Guidance as Guidance
    from lme.types import LaserScan as LaserScan
    from lme.types import Limits as Limits
    from lme.types import Observation as Observation
    from lme.types import Pose as Pose
    from lme.types import Twist as Twist
    from lme.worlds.barn import Barn as Barn

__version__ = "0.3.0"

_MODULES = {
    "Barn": "lme.worlds.barn",
    "Dwa": "lme.planners.dwa",
    "EBand": "lme.planners.eband.planner",
    "FastSimulator": "lme.simulation.fast",
    "Footprint": "lme.robots",
    "GlobalPath": "lme.guides.global_path.guide",
    "Guidance": "lme.types",
    "InputError": "lme.errors",
    "LaserScan": "lme.types",
    "Lidar": "lme.robots",
    "Limits": "lme.types",
    "Lme": "lme.guides.lme.guide",
    "LmePlus": "lme.guides.lme_plus.guide",
    "LocalMinimumEscaper": "lme.guides.lme.guide",
    "MinTime": "lme.planners.min_time.planner",
    "Navigator": "lme.navigation.navigator",
    "Observation": "lme.types",
    "Pose": "lme.types",
    "Robot": "lme.robots",
    "Simple": "lme.planners.simple",
    "TangentBug": "lme.guides.tangent_bug.guide",
    "Target": "lme.guides.target",
    "Twist": "lme.types",
    "cast": "lme.perception.raycast",
    "evaluate": "lme.evaluation",
    "load_map_set": "lme.config.presets",
    "load_parameters": "lme.config.presets",
    "load_robot": "lme.config.presets",
    "load_settings": "lme.config.presets",
    "load_simulator": "lme.config.presets",
    "load_system": "lme.config.systems",
    "reason": "lme.guides.lme.explanation",
    "run_episode": "lme.navigation.episode",
}
__all__ = ["__version__", *_MODULES]

numba_cache.choose()
registration.register_with_gymnasium()


def __getattr__(name: str) -> Any:
    """Return a public name, imported from the module that defines it."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
