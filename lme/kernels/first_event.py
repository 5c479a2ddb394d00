"""What ends a motion: contact or arrival."""

from numba import njit

from lme.kernels.collision import sweep_box
from lme.kernels.motion import first_within


@njit(cache=True, error_model="numpy")
def first_event(travel, goal, tolerance, box, circles, edges):
    """How many of the poses are passed, least clearance [m], contact, arrival.

    travel (K, 3); goal (2,) with its tolerance [m]; box (half_length, half_width, rounding) [m] of what collides;
    circles (C, 3) and edges (E, 4). The motion ends with the first pose in contact or within the tolerance, and
    contact on arrival counts as contact only.
    """
    arrival = first_within(travel, goal, tolerance)
    passed = travel[: arrival + 1] if arrival >= 0 else travel
    clearance, contact = sweep_box(passed, box[0], box[1], box[2], circles, edges)
    if contact >= 0:
        return contact + 1, clearance, True, False
    return len(passed), clearance, False, arrival >= 0
