"""Which obstacle points are those of people, or of other movers."""

import math

import numpy as np
from numba import njit

from lme.types import Bools, Floats

WIDEST = 1.0  # [m] greatest radius of a person or another mover
_SKIN = 0.1  # [m] behind the nearest point of a mover


@njit(cache=True, error_model="numpy")
def movers_among(points: Floats, seen: Floats, people: Floats, most: float) -> tuple[Bools, Floats]:
    """Whether each of the (M, 2) points belongs to a mover, and the movers (P, 5) with their radii [m].

    seen (S, 2): points of the current scan. people (P, 4): x, y, vx, vy of the movers' centres [m, m/s]. A mover's
    radius is the distance to the nearest point of the scan, at most `most`; points up to `_SKIN` farther belong to it.
    """
    movers = np.empty((len(people), 5))
    own = np.zeros(len(points), np.bool_)
    for n in range(len(people)):
        square = most * most
        for m in range(len(seen)):
            square = min(square, (seen[m, 0] - people[n, 0]) ** 2 + (seen[m, 1] - people[n, 1]) ** 2)
        movers[n, :4], movers[n, 4] = people[n], math.sqrt(square)
        for m in range(len(points)):
            dx, dy = points[m, 0] - people[n, 0], points[m, 1] - people[n, 1]
            own[m] = own[m] or math.sqrt(dx * dx + dy * dy) < movers[n, 4] + _SKIN
    return own, movers
