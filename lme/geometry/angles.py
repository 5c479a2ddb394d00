"""Angles on the circle."""

import math


def wrap_angle(angle: float) -> float:
    """The same direction in (−π, π] [rad]; exact for any finite angle."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped <= -math.pi else wrapped
