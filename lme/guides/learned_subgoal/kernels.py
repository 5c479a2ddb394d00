"""The nearest obstacle point in each sector around the base."""

import math

import numpy as np
from numba import njit

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def nearest_by_sector(points: Floats, sectors: int, reach: float) -> Floats:
    """Distance of the nearest point in each sector, `reach` if there is none nearer [m]: (sectors,).

    points (M, 2) in the robot frame [m]. Sector 0 is centred straight ahead, the others follow counter-clockwise.
    """
    found = np.full(sectors, reach)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        k = math.floor(math.atan2(y, x) / math.tau * sectors + 0.5) % sectors
        found[k] = min(found[k], math.hypot(x, y))
    return found
