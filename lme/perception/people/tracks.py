"""Result of a tracker of people."""

from __future__ import annotations

from typing import NamedTuple

from lme.types import Floats, Ints


class Tracks(NamedTuple):
    """People in sight, in the robot frame of their scan.

    names (P,): the same number for the same person. pedestrians (P, 4): x, y [m], vx, vy [m/s] over ground, as in
    `Observation`. radius (P,) [m]. age (P,): since first seen [s]. covariance (P, 4, 4) of x, y, vx, vy.
    """

    names: Ints
    pedestrians: Floats
    radius: Floats
    age: Floats
    covariance: Floats
