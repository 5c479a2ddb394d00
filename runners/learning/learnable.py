"""The networks that can be learned, by planner. To add one, add a line here and a class like those in `dclp.py`."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from runners.config.instantiate import configured

if TYPE_CHECKING:
    from torch import Tensor, nn

    from lme.robots import Robot
    from runners.learning.mixture import MixtureBatch
    from runners.workers.lessons import Interface

Arrays = Mapping[str, NDArray[np.float32]]
_NETWORKS = {  # by the planner's class: an option and the network
    "lme.planners.dclp.Dclp": ("dclp", "runners.learning.dclp.DclpNetwork"),
    "lme.planners.drl_vo.DrlVo": ("drl_vo_small", "runners.learning.drl_vo.DrlVoNetwork"),
}


class Learnable(Protocol):
    """A network in torch, a `torch.nn.Module`, that a planner drives with in numpy or by onnxruntime.

    The planner has an `interface` with `features`; `__call__` takes its arrays as float32 with a batch axis in front.
    A network with norms starts in the mode `eval`; only a learner that fits them switches to `train` and back.
    """

    def __call__(self, *features: Tensor) -> MixtureBatch:
        """The distribution of the actions."""

    def weights(self, sharpness: float = 1.0) -> dict[str, NDArray[np.float32]]:
        """The arrays that the planner's file holds. sharpness: of the draw of components, a factor on their logits."""

    def load(self, weights: Arrays) -> None:
        """Set these arrays."""

    def trained_for(self, planner: Any, robots: Iterable[Robot]) -> None:
        """Store the robots for which the network is trained: those with the lowest and the highest values."""

    @staticmethod
    def interface(planner: Any, robot: Robot) -> Interface:
        """The network's inputs for a robot, and the meaning of its output. planner: its Config."""

    @staticmethod
    def critic(actions: int) -> nn.Module:
        """A network from the features, and a tensor (B, actions) unless `actions` is 0, to values (B,)."""

    def mirror(self, features: tuple[Tensor, ...], actions: Tensor) -> tuple[tuple[Tensor, ...], Tensor]:
        """Features and actions with left and right swapped."""

    def eval(self) -> Any:
        """Of torch: norms with the statistics of the training so far."""

    def train(self) -> Any:
        """Of torch: norms with the statistics of the batch."""

    def parameters(self) -> Iterator[nn.Parameter]:
        """Of torch."""

    def state_dict(self) -> dict[str, Any]:
        """Of torch."""

    def load_state_dict(self, state_dict: Mapping[str, Any]) -> Any:
        """Of torch."""

    @staticmethod
    def read(path: Path) -> Arrays:
        """The arrays in a planner's file. Raises InputError."""

    @staticmethod
    def write(weights: Arrays, file: IO[bytes]) -> None:
        """Write a planner's file."""


def check_learnable(planner: Mapping[str, Any], name: str) -> None:
    """Raise InputError for a planner without a network. name: its option."""
    if str(planner["_target_"]) not in _NETWORKS:
        known = ", ".join(option for option, _ in _NETWORKS.values())
        raise InputError(f"planner is {name}: has no network that can be learned; must be one of {known}")


def planner_config(planner: Mapping[str, Any]) -> Any:
    """The Config of a planner, without its weights, which are to be learned. Raises InputError."""
    return configured({**planner, "weights": None}, "planner")[1]


def network_class(planner: Mapping[str, Any]) -> type[Learnable]:
    """The class of a planner's network. Imports torch."""
    module, _, name = _NETWORKS[planner["_target_"]][1].rpartition(".")
    found: type[Learnable] = getattr(importlib.import_module(module), name)
    return found
