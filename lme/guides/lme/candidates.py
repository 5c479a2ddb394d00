"""Candidate points (paper §III.C, Fig. 2a): random positions in the lidar's field of view."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lme.errors import argument_error, require
from lme.types import Floats

DISTRIBUTIONS = ("polar", "area")


@dataclass(slots=True)
class CandidateConfig:
    """Number, range and distribution of candidates. The paper says only: random, within lidar range."""

    number: int
    max_range: float
    distribution: str
    target: bool

    def __post_init__(self) -> None:
        require("number", self.number, at_least=1, at_most=100_000)
        require("max_range", self.max_range, above=0.0)
        if self.distribution not in DISTRIBUTIONS:
            raise argument_error(
                f"distribution is {self.distribution!r}: must be one of {', '.join(DISTRIBUTIONS)}"
            )


def sample(
    rng: np.random.Generator, config: CandidateConfig, max_range: float, bearing_min: float, fov: float
) -> Floats:
    """Draw candidates in the sector [bearing_min, bearing_min + fov] up to `max_range`.

    Returns (config.number, 2) positions in the robot frame [m].
    """
    uniform = rng.random((config.number, 2))
    return _spread(uniform, max_range, bearing_min, fov, config.distribution == "area")


@njit(cache=True)
def _spread(uniform: Floats, max_range: float, bearing_min: float, fov: float, by_area: bool) -> Floats:
    """Map (N, 2) uniform numbers to the sector: the first to range, the second to bearing."""
    points = np.empty(uniform.shape)
    for i in range(len(uniform)):
        distance = max_range * (math.sqrt(uniform[i, 0]) if by_area else uniform[i, 0])
        bearing = bearing_min + fov * uniform[i, 1]
        points[i, 0] = distance * math.cos(bearing)
        points[i, 1] = distance * math.sin(bearing)
    return points
