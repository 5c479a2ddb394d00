"""Wrapping of angles."""

import math


def wrap_angle(angle: float) -> float:
    """The angle wrapped to (−π, π] [rad]; exact for any finite angle."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped <= -math.pi else wrapped
