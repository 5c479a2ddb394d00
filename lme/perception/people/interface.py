"""Parameters of the tracker of people, with units and reasons, and its result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from lme.errors import require
from lme.types import Floats, Ints


@dataclass(slots=True, kw_only=True)
class PeopleConfig:
    """Criteria for a person, for motion and for one track. One set serves all robots and lidars."""

    widest: float = 1.3  # [m] of a person or another mover that is tracked: DynaBARN's cylinders are 1 m wide
    joint: float = 0.45  # [m] from leg to leg of a person who walks
    fastest: float = 2.5  # [m/s] of somebody seen for the first time; people run faster than robots drive
    margin: float = 0.04  # [m] by which a beam must pass through an empty place; or 5 times the noise
    guard: float = 0.008  # [rad] to either side that must be empty, too: edges of objects are ragged
    missing: float = 6.0  # [m] a beam without a return is free so far; dark and wet surfaces return nothing
    acceleration: float = 0.5  # [m²/s³] noise of the constant-velocity model: people turn and stop in a step
    legs: float = 0.12  # [m] error of the middle of a person seen as legs, which swing
    surface: float = 0.01  # [m] error of the middle of a round thing
    evidence: float = 0.5  # shares of its points that show motion, summed over scans, before a track counts
    coasting: float = 3.0  # [s] a track is remembered while it is hidden
    standing: float = 3.0  # [s] a track that stays within a step is kept; then it is furniture

    def __post_init__(self) -> None:
        for key in ("widest", "joint", "fastest", "margin", "missing", "acceleration", "legs", "surface"):
            require(f"people.{key}", getattr(self, key), above=0.0)
        for key in ("guard", "evidence", "coasting", "standing"):
            require(f"people.{key}", getattr(self, key), at_least=0.0)

    @property
    def settings(self) -> Settings:
        """The same values as a tuple, for compiled functions."""
        return Settings(*(float(getattr(self, name)) for name in Settings._fields))


class Settings(NamedTuple):
    """The fields of `PeopleConfig` that kernels read, in its units."""

    widest: float
    joint: float
    fastest: float
    legs: float
    surface: float
    evidence: float
    coasting: float
    standing: float


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
