"""Ray casting of lidar beams against the edges of a grid."""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.kernels.edge_grid import EdgeGrid, first_hit
from lme.kernels.raycast import beam_table
from lme.types import Pose


def cast_grid(
    lidar_pose: Pose, angles: tuple[float, float, int], range_max: float, grid: EdgeGrid
) -> NDArray[np.float32]:
    """Distance along each beam to the first edge of a grid, or range_max if none is nearer: (B,) [m].

    The result is that of `lme.kernels.raycast.cast`, which describes the parameters.
    """
    x, y, yaw = lidar_pose
    angle_min, increment, num_beams = angles
    table = beam_table(increment, num_beams)
    ranges: NDArray[np.float32] = _cast_grid(
        float(x), float(y), yaw + angle_min, float(range_max), table, *grid
    )
    return ranges


@njit(cache=True, error_model="numpy")
def _cast_grid(x, y, heading, range_max, table, frame, starts, edges):
    """heading: of the first beam in the world [rad]."""
    ranges = np.empty(table.shape[1], np.float32)
    turn = (math.cos(heading), math.sin(heading))
    for i in range(len(ranges)):
        ranges[i] = first_hit(x, y, turn, (table[0, i], table[1, i]), range_max, frame, starts, edges)
    return ranges
