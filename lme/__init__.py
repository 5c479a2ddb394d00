"""Local-Minimum Escaper: mapless mobile-robot navigation by subgoals from local observations alone.

A guide decides where to go next, a planner how to get there; a navigator is one of each. `LocalMinimumEscaper`
is the paper's policy alone, for your own robot or stack; `Lme` is the same policy as a guide.

    robot = lme.load_robot("jackal")
    escaper = lme.LocalMinimumEscaper(robot, lme.load_parameters("published"))
    decision = escaper.decide(observation)  # an lme.Observation; decision.subgoal in the robot frame [m]

To drive in simulation: a task of `Barn`, a `Navigator`, a `FastSimulator` and `run_episode`; or `evaluate`, which is
`lme eval` as a function. docs/python.md describes every name, `examples/` uses them. Frames follow REP-103: x ahead,
y left, angles counter-clockwise. Units are metres, seconds and radians. Invalid input raises `InputError`.

Names are imported on first use: Numba alone takes a second.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from lme import numba_cache
from lme.envs import discovery

if TYPE_CHECKING:
    from lme.episode import run_episode as run_episode
    from lme.errors import InputError as InputError
    from lme.evaluation import evaluate as evaluate
    from lme.guides.lme import Lme as Lme
    from lme.navigator import Navigator as Navigator
    from lme.planners.simple import Simple as Simple
    from lme.policies.lme.escaper import EscaperConfig as EscaperConfig
    from lme.policies.lme.escaper import LocalMinimumEscaper as LocalMinimumEscaper
    from lme.policies.lme.reasons import reason as reason
    from lme.presets import load_parameters as load_parameters
    from lme.presets import load_robot as load_robot
    from lme.robots import Footprint as Footprint
    from lme.robots import Lidar as Lidar
    from lme.robots import Robot as Robot
    from lme.sim.fast import FastSimulator as FastSimulator
    from lme.types import Guidance as Guidance
    from lme.types import LaserScan as LaserScan
    from lme.types import Observation as Observation
    from lme.types import Pose as Pose
    from lme.types import Twist as Twist
    from lme.worlds.barn import Barn as Barn

__version__ = "0.2.0"

_MODULES = {
    "Barn": "lme.worlds.barn",
    "EscaperConfig": "lme.policies.lme.escaper",
    "FastSimulator": "lme.sim.fast",
    "Footprint": "lme.robots",
    "Guidance": "lme.types",
    "InputError": "lme.errors",
    "LaserScan": "lme.types",
    "Lidar": "lme.robots",
    "Lme": "lme.guides.lme",
    "LocalMinimumEscaper": "lme.policies.lme.escaper",
    "Navigator": "lme.navigator",
    "Observation": "lme.types",
    "Pose": "lme.types",
    "Robot": "lme.robots",
    "Simple": "lme.planners.simple",
    "Twist": "lme.types",
    "evaluate": "lme.evaluation",
    "load_parameters": "lme.presets",
    "load_robot": "lme.presets",
    "reason": "lme.policies.lme.reasons",
    "run_episode": "lme.episode",
}
__all__ = ["__version__", *_MODULES]

numba_cache.choose()
discovery.register_with_gymnasium()


def __getattr__(name: str) -> Any:
    """A public name, from the module that defines it."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
