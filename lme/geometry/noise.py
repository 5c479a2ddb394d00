"""Noise on lidar ranges."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Ranges = NDArray[np.float32]


@njit(cache=True)
def add_noise(ranges: Ranges, noise: Ranges, std: float, range_max: float) -> None:
    """Add Gaussian noise to every return, in place; beams without a return stay at range_max.

    ranges (B,) [m]; noise (B,) standard normal; std, range_max [m].
    """
    for i in range(len(ranges)):
        if ranges[i] < np.float32(range_max):
            ranges[i] = min(max(ranges[i] + std * noise[i], 0.0), range_max)
