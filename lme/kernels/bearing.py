"""A substitute for the bearing without trigonometry."""

import math

from numba import njit

_TINY = 1e-300  # avoids 0 / 0


@njit(cache=True, error_model="numpy")
def diamond(x: float, y: float) -> float:
    """Diamond angle: increases with the bearing of (x, y), from −2 above −π to 2 at π; 0 for (0, 0).

    It has no branches, so loops over it are vectorised. A y of −0 counts as negative.
    """
    part = y / max(abs(x) + abs(y), _TINY)
    return part if x >= 0.0 else math.copysign(2.0, y) - part
