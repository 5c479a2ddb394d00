"""Intersection of a ray and an edge, the same arithmetic for every kernel that casts planar beams."""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy", inline="always")
def ray_to_edge(start_x, start_y, end_x, end_y, dx, dy):
    """Distance from the origin along the ray (dx, dy), of length 1, to an edge; inf if the ray misses it [m].

    Rays of another length, such as the horizontal parts of rays in space, are for `lme.simulation.mid360.raycast3d`.
    A hit is decided by the sides of the ray on which the two ends lie, so that no ray slips through a shared corner. A
    ray that runs along an edge has both ends on the same side, unless they differ by rounding.
    """
    across_start, across_end = start_x * dy - start_y * dx, end_x * dy - end_y * dx
    along_start, along_end = start_x * dx + start_y * dy, end_x * dx + end_y * dy
    distance = (start_x * end_y - start_y * end_x) / (across_start - across_end)
    # Where the ray's line and the edge's are one but for rounding, both terms are nothing but rounding errors.
    distance = min(max(distance, min(along_start, along_end)), max(along_start, along_end))
    return distance if ((across_start > 0.0) != (across_end > 0.0)) & (distance >= 0.0) else np.inf
