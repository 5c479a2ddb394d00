"""Networks that can be learned. To add one, add a line here and a class like those in `dclp.py`."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from runners.config.instantiate import configured
from runners.config.schema import LearnConfig

if TYPE_CHECKING:
    import torch
    from torch import Tensor, nn

    from lme.robots import Robot

Arrays = Mapping[str, NDArray[np.float32]]
_OF_GUIDES = "ppo"  # the only learner of guides
_PLANNERS = {  # by the planner's class: an option of the group, and the network's class
    "lme.planners.dclp.Dclp": ("dclp", "runners.learning.dclp.DclpNetwork"),
    "lme.planners.drl_vo.DrlVo": ("drl_vo_small", "runners.learning.drl_vo.DrlVoNetwork"),
}
_GUIDES = {
    "lme.guides.learned_subgoal.LearnedSubgoal": (
        "learned_subgoal",
        "runners.learning.subgoal.SubgoalNetwork",
    ),
}


class Distribution(Protocol):
    """Distributions that a network gives for B scenes: `MixtureBatch`, or `ChoiceBatch` if it chooses."""

    def with_min_sigma(self, sigma: float) -> Distribution:
        """Return the same distributions with no standard deviation below `sigma`."""

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw numbers, with B as first axis. generator: on the CPU."""

    def log_density(self, raw: Tensor) -> Tensor:
        """Return the logarithm of the density of drawn numbers: (B,)."""

    def actions(self, raw: Tensor) -> Tensor:
        """Return the answers that these numbers mean to the interface."""


class Learnable(Protocol):
    """Network in torch, a `torch.nn.Module`, that a planner or a guide runs in onnxruntime.

    Its interface has `features`; `__call__` takes these arrays as float32 with a batch axis in front.
    A network with normalisation starts in the mode `eval`; only a learner that fits it switches to `train` and back.
    """

    def __call__(self, *features: Tensor) -> Distribution:
        """Return the distribution of the answers."""

    def weights(self, sharpness: float = 1.0) -> dict[str, NDArray[np.float32]]:
        """Return the arrays that a file holds. sharpness: factor on the logits of the components."""

    def load(self, weights: Arrays) -> None:
        """Set the network's arrays."""

    def trained_for(self, config: Any, robots: Iterable[Robot]) -> None:
        """Store the range of robots that the network is trained for, from the robots of lowest and highest values."""

    @staticmethod
    def interface(config: Any, robot: Robot) -> Any:
        """Return the network's inputs for a robot, and the meaning of its output. config: planner's or guide's."""

    @staticmethod
    def critic(actions: int) -> nn.Module:
        """Return a network that maps the features, and (B, actions) numbers unless `actions` is 0, to values (B,)."""

    def mirror(self, features: tuple[Tensor, ...], actions: Tensor) -> tuple[tuple[Tensor, ...], Tensor]:
        """Return features and actions with left and right swapped."""

    def to(self, device: torch.device) -> Any:
        """Move to a device; a method of torch."""

    def eval(self) -> Any:
        """Normalise with the statistics of the training so far; a method of torch."""

    def train(self) -> Any:
        """Normalise with the statistics of the batch; a method of torch."""

    def parameters(self) -> Iterator[nn.Parameter]:
        """Yield the parameters; a method of torch."""

    def state_dict(self) -> dict[str, Any]:
        """Return the state; a method of torch."""

    def load_state_dict(self, state_dict: Mapping[str, Any]) -> Any:
        """Load a state; a method of torch."""

    @staticmethod
    def read(path: Path) -> Arrays:
        """Read the arrays in a file. Raises InputError."""

    @staticmethod
    def write(weights: Arrays, file: IO[bytes]) -> None:
        """Write the arrays to a file."""


def learns_guide(config: LearnConfig) -> bool:
    """Return whether the network is the guide's rather than the planner's."""
    return str(config.guide["_target_"]) in _GUIDES


def learned_part(config: LearnConfig) -> str:
    """Return the config group whose option has the network, guide or planner."""
    return "guide" if learns_guide(config) else "planner"


def check_learnable(config: LearnConfig, choices: Mapping[str, str]) -> None:
    """Raise InputError unless guide or planner has a network that the learner can learn. choices: by group."""
    if not learns_guide(config) and str(config.planner["_target_"]) not in _PLANNERS:
        known = ", ".join(option for option, _ in _PLANNERS.values())
        guides = ", ".join(option for option, _ in _GUIDES.values())
        raise InputError(
            f"planner is {choices['planner']}: has no network that can be learned; must be one of {known}, "
            f"or guide one of {guides}"
        )
    if learns_guide(config) and choices["learner"] != _OF_GUIDES:
        raise InputError(
            f"learner is {choices['learner']}: must be {_OF_GUIDES}, by which guide={choices['guide']} learns"
        )
    if learns_guide(config) and config.guides:
        raise InputError(
            f"guides is {config.guides}: must be {{}} where the network of guide={choices['guide']} is learned"
        )


def learned_config(config: LearnConfig) -> Any:
    """Return the Config of the planner or guide, without the weights that are to be learned. Raises InputError."""
    part = learned_part(config)
    return configured({**getattr(config, part), "weights": None}, part)[1]


def network_class(config: LearnConfig) -> type[Learnable]:
    """Return the class of the network. Imports torch."""
    networks = {**_PLANNERS, **_GUIDES}
    module, _, name = networks[str(getattr(config, learned_part(config))["_target_"])][1].rpartition(".")
    return cast("type[Learnable]", getattr(importlib.import_module(module), name))
