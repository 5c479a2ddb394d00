"""Observations and actions as Gymnasium's spaces describe them."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from lme.errors import InputError
from lme.robots import Lidar
from lme.types import Floats

Arrays = dict[str, NDArray[np.float32]]

MOST_PEOPLE = 16  # in an observation


def observation_space(lidar: Lidar, people: bool) -> spaces.Dict[Any]:
    """scan [m], target [m], twist [m/s, rad/s] and limits (v_max, ω_max, α_v, α_ω), float32; and `people_rows`."""
    space = spaces.Dict(
        scan=spaces.Box(0.0, lidar.range_max, (lidar.num_beams,), np.float32),
        target=spaces.Box(-np.inf, np.inf, (2,), np.float32),
        twist=spaces.Box(-np.inf, np.inf, (2,), np.float32),
        limits=spaces.Box(0.0, np.inf, (4,), np.float32),
    )
    if people:
        space["people"] = spaces.Box(-np.inf, np.inf, (MOST_PEOPLE, 5), np.float32)
    return space


def action_space() -> spaces.Box[Any]:
    """v and ω, each as a share of the robot's limit."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def arrays(ranges: NDArray[np.float32], target: Any, twist: Any, limits: Any, range_max: float) -> Arrays:
    """New arrays as in the space, of one robot or of many. The range of a beam without a return becomes range_max."""
    return {
        "scan": np.minimum(ranges, np.float32(range_max)),
        "target": np.array(target, dtype=np.float32),
        "twist": np.array(twist, dtype=np.float32),
        "limits": np.array(limits, dtype=np.float32),
    }


def people_rows(pedestrians: Floats) -> NDArray[np.float32]:
    """(MOST_PEOPLE, 5) of people (P, 4) in the robot frame [m, m/s]: those who are nearest, and 1; then rows of 0."""
    rows = np.zeros((MOST_PEOPLE, 5), np.float32)
    nearest = np.argsort(np.hypot(pedestrians[:, 0], pedestrians[:, 1]), kind="stable")[:MOST_PEOPLE]
    rows[: len(nearest), :4] = pedestrians[nearest]
    rows[: len(nearest), 4] = 1.0
    return rows


def commands(actions: Any, limits: Floats) -> Floats:
    """Velocity commands (..., 2) [m/s, rad/s] of actions (..., 2), cut off at ±1. limits (..., 4).

    Raises InputError for actions of another shape and for NaN.
    """
    given = np.asarray(actions, dtype=np.float64)
    shape = (*limits.shape[:-1], 2)
    if given.shape != shape or np.isnan(given).any():
        raise InputError(f"the action is {given.tolist()}: must be numbers in [-1, 1], of shape {shape}")
    return np.asarray(np.clip(given, -1.0, 1.0) * limits[..., :2])
