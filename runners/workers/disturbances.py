"""Delay, slip, noise and gait that a training draws for each of its worlds."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError, require
from runners.config.build import simulator, with_disturbances

if TYPE_CHECKING:
    from runners.config.schema import TrainConfig

_DISTURBANCES = 0x6469  # seeds the draw separately from the episode


def disturbed(config: TrainConfig, world: int) -> TrainConfig:
    """The config with the disturbances drawn for a world; the same for every candidate."""
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, world, _DISTURBANCES]))
    drawn = {
        key: float(rng.uniform(*bounds)) for key, bounds in asdict(config.disturbances).items() if bounds
    }
    return with_disturbances(config, drawn)


def check_disturbances(config: TrainConfig) -> None:
    """Raise InputError for a range that is not one, or a disturbance that the simulator does not have or refuses."""
    highest = {}
    for key, bounds in asdict(config.disturbances).items():
        if bounds is None:
            continue
        if len(bounds) != 2:
            raise InputError(f"disturbances.{key} is {bounds}: must be [lowest, highest] or null")
        if key not in config.sim:
            raise InputError(f"disturbances.{key}: this simulator has no {key}; choose sim=fast, or null")
        require(f"disturbances.{key}[0]", bounds[0], at_least=0.0)
        require(f"disturbances.{key}[1]", bounds[1], at_least=bounds[0])
        highest[key] = bounds[1]
    simulator(with_disturbances(config, highest))
