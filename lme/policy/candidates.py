"""Candidate points (paper §III.C, Fig. 2a): random positions inside the lidar's view."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lme.errors import InputError
from lme.robots import require
from lme.types import Floats

DISTRIBUTIONS = ("polar", "area")


@dataclass(slots=True)
class CandidateConfig:
    """How many candidates, how far, how spread. The paper says only: randomly, within lidar range."""

    number: int = 300
    max_range: float = 5.0  # [m]
    distribution: str = "polar"  # "polar": uniform in range and bearing; "area": uniform per square metre
    target: bool = True  # the target itself is one more candidate when in view and free

    def __post_init__(self) -> None:
        require("guide.candidates.number", self.number, at_least=1)
        require("guide.candidates.max_range", self.max_range, above=0.0)
        if self.distribution not in DISTRIBUTIONS:
            raise InputError(
                f"guide.candidates.distribution is {self.distribution!r}: must be one of {', '.join(DISTRIBUTIONS)}"
            )


def sample(
    rng: np.random.Generator, config: CandidateConfig, max_range: float, bearing_min: float, fov: float
) -> Floats:
    """Draw candidates in the sector [bearing_min, bearing_min + fov] up to `max_range`.

    Returns (config.number, 2) positions in the robot frame [m].
    """
    uniform = rng.random((2, config.number))
    distance = uniform[0] if config.distribution == "polar" else np.sqrt(uniform[0])
    distance *= max_range
    bearing = bearing_min + fov * uniform[1]
    points = np.empty((config.number, 2))
    np.multiply(distance, np.cos(bearing), out=points[:, 0])
    np.multiply(distance, np.sin(bearing), out=points[:, 1])
    return points
