"""A stand-in for the bearing that needs no trigonometry."""

import math

from numba import njit

_TINY = 1e-300  # keeps 0 / 0 out


@njit(cache=True, error_model="numpy")
def diamond(x: float, y: float) -> float:
    """Rises with the bearing of (x, y), from −2 just above −π over 0 ahead to 2 at π; 0 for (0, 0).

    Free of branches, so that loops over it become vector instructions. A y of −0 counts as negative.
    """
    part = y / max(abs(x) + abs(y), _TINY)
    return part if x >= 0.0 else math.copysign(2.0, y) - part
