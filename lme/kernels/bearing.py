"""Substitutes for the bearing without trigonometry."""

import math

from numba import njit

BEARING_ERROR = 2e-5  # [rad] upper bound of the error of `bearing`
_TINY = 1e-300  # avoids 0 / 0


@njit(cache=True, error_model="numpy")
def diamond(x: float, y: float) -> float:
    """Diamond angle: increases with the bearing of (x, y), from −2 above −π to 2 at π; 0 for (0, 0).

    It has no branches, so loops over it are vectorised. A y of −0 counts as negative.
    """
    part = y / max(abs(x) + abs(y), _TINY)
    return part if x >= 0.0 else math.copysign(2.0, y) - part


@njit(cache=True, error_model="numpy")
def bearing(x: float, y: float) -> float:
    """atan2(y, x) in [0, 2π] with an error below 1e-5 rad; NaN for (0, 0). Source: Abramowitz & Stegun 4.4.47."""
    ax, ay = abs(x), abs(y)
    z = min(ax, ay) / max(ax, ay)
    zz = z * z
    angle = z * (0.9998660 + zz * (-0.3302995 + zz * (0.1801410 + zz * (-0.0851330 + zz * 0.0208351))))
    angle = math.pi / 2.0 - angle if ay > ax else angle
    angle = math.pi - angle if x < 0.0 else angle
    return 2.0 * math.pi - angle if y < 0.0 else angle
