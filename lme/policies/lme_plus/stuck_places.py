"""Places before which the robot was stuck, which take longer from then on."""

from __future__ import annotations

import numpy as np

from lme.policies.distance import distances_to
from lme.types import Floats

_AFTER = 2.0  # [s] before a place in all, from which it counts
_COST = 10.0  # [-] times as long as the robot was stuck before a place, the way through it takes longer
_SAME = 0.5  # [m] between two places that count as one
_RADIUS = 0.3  # [m] around a place, where the way takes longer


class StuckPlaces:
    """Places on the fastest way in front of which no candidate could be reached, in the carried frame.

    A body that is longer than wide may not get where a disc of its inner radius can. So expected times do not know of
    such places until it has tried. The way through one takes longer by `_COST` times as long as the robot was stuck
    before it. So it takes another way at some time, however much longer that is.

    rows: (S, 6) x, y [m], velocity 0, radius [m] and time per metre [s/m], as `kernels.travel_time` takes people.
    """

    def __init__(self, dt: float) -> None:
        """dt: control period [s]."""
        self._dt = dt
        self.forget()

    def forget(self) -> None:
        """Forget all places, for another target."""
        self._places, self._waited = np.empty((0, 2)), np.empty(0)  # [m], and how long before each [s]
        self.rows: Floats = np.empty((0, 6))

    def wait(self, place: Floats) -> None:
        """Count one control period that the robot is stuck before a place (2,) [m]."""
        away = distances_to(self._places, place)
        if len(away) and away.min() < _SAME:
            self._waited[away.argmin()] += self._dt
        else:
            self._places = np.vstack((self._places, place))
            self._waited = np.append(self._waited, self._dt)
        stuck = self._waited > _AFTER
        slower = _COST * self._waited[stuck] / (2.0 * _RADIUS)
        self.rows = np.column_stack(
            (self._places[stuck], np.zeros((len(slower), 2)), np.full(len(slower), _RADIUS), slower)
        )
