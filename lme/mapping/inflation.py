"""Costs around an occupied cell of a costmap, as in the inflation layer of ROS costmap_2d."""

from __future__ import annotations

import math

import numpy as np

from lme.grids.obstacle_grid import HIGHEST, INSCRIBED, TOUCHING
from lme.types import Ints


def inflation_stamp(
    cell_size: float, touching: float, inscribed: float, inflation_radius: float, cost_scaling_factor: float
) -> Ints:
    """Costs around one occupied cell: (K, 3) rows (di, dj, cost).

    Costs are `TOUCHING` up to a distance of `touching` [m] and `INSCRIBED` up to `inscribed` [m]. From there to the
    inflation radius [m] they are HIGHEST · exp(−cost_scaling_factor · (distance − inscribed)).
    """
    reach = max(inscribed, inflation_radius)
    cells = math.floor(reach / cell_size + 1e-9)
    di, dj = np.mgrid[-cells : cells + 1, -cells : cells + 1]
    distance = np.hypot(di, dj) * cell_size - 1e-9
    fading = np.floor(HIGHEST * np.exp(-cost_scaling_factor * np.maximum(distance - inscribed, 0.0)))
    cost = np.where(distance <= touching, TOUCHING, np.where(distance <= inscribed, INSCRIBED, fading))
    rows = np.column_stack([di.ravel(), dj.ravel(), cost.astype(np.int64).ravel()])
    return np.ascontiguousarray(rows[(distance.ravel() <= reach) & (rows[:, 2] > 0)])
