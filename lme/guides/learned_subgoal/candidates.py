"""The polar grid of candidates around the robot.

Candidate b · len(RANGES) + r lies `RANGES[r]` away at the bearing 2π b / BEARINGS, counter-clockwise from ahead.
"""

from __future__ import annotations

import math

import numpy as np

from lme.types import Floats, Ints

BEARINGS = 48
RANGES = (0.4, 0.8, 1.6, 3.2)  # [m] ASSUMED
CANDIDATES = BEARINGS * len(RANGES)


def bearings() -> Floats:
    """Bearings of the grid [rad], in [0, 2π): (BEARINGS,)."""
    return np.arange(BEARINGS, dtype=np.float64) * (math.tau / BEARINGS)


def candidates() -> Floats:
    """All candidates in the robot frame [m]: (CANDIDATES, 2)."""
    directions = np.column_stack((np.cos(bearings()), np.sin(bearings())))
    grid: Floats = directions[:, None] * np.array(RANGES)[:, None]
    return grid.reshape(CANDIDATES, 2)


def mirrored_bearings() -> Ints:
    """Index that each bearing has with left and right swapped: (BEARINGS,)."""
    return -np.arange(BEARINGS) % BEARINGS
