"""An elastic band: a chain of bubbles of free space that obstacles push aside and tension shortens."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.kernels.band import bubble_radii, covered, mend, relax
from lme.kernels.polyline import project, stretch
from lme.types import Floats

_CAPACITY = 256  # bubbles; a band of any use has far fewer


@dataclass(slots=True)
class BandConfig:
    """Bubbles and forces."""

    horizon: float = 2.0  # [m] of the path that becomes a band
    spacing: float = 0.05  # [m] bubbles are put in down to this distance
    min_radius: float = 0.1  # [m] smaller bubbles do not join: no passage
    max_radius: float = 1.0  # [m] of a bubble
    overlap: float = 0.7  # [-] joined bubbles lie at most this share of the sum of their radii apart
    internal_gain: float = 1.0  # [-] of the contraction
    external_gain: float = 2.0  # [1/m] of the repulsion
    influence: float = 0.55  # [m] smaller bubbles are repelled
    min_force: float = 0.15  # [-] smaller ones move nothing
    iterations: int = 3  # times along the band in each control period
    recursion: int = 4  # halvings of a step that has gone too far

    def __post_init__(self) -> None:
        for key in ("horizon", "spacing", "max_radius"):
            require(f"planner.{key}", getattr(self, key), above=0.0)
        require("planner.min_radius", self.min_radius, at_least=0.0, at_most=self.max_radius)
        require("planner.overlap", self.overlap, above=0.0, at_most=1.0)
        for key in ("internal_gain", "external_gain", "influence", "min_force", "recursion"):
            require(f"planner.{key}", getattr(self, key), at_least=0.0)
        require("planner.iterations", self.iterations, at_least=1)


class Band:
    """Bubbles from the robot along a path, in the odometry frame (Quinlan & Khatib 1993, §3).

    centres: (N, 2) [m], the first at the robot. radii: (N,) [m]. chain: how many bubbles from the first one on
    are joined one to the next; less than N where the band is torn.
    """

    def __init__(self, config: BandConfig, inner: float) -> None:
        """`inner`: radius of the disc inside the robot's outline that must fit everywhere [m]."""
        self._config = config
        self._inner = inner
        self.reset()

    def reset(self) -> None:
        """Forget the band."""
        self.centres: Floats = np.empty((0, 2))
        self.radii: Floats = np.empty(0)
        self.chain = 0
        self._path: Floats = np.empty((0, 2))

    @property
    def torn(self) -> bool:
        """Whether some neighbours do not join, however many bubbles are put between them."""
        return self.chain < len(self.centres)

    def update(self, path: Floats, robot: Floats, points: Floats, *, planned: bool) -> None:
        """Follow the robot and the path, then let the obstacles and the tension act.

        path (K, 2), K ≥ 1, robot (2,), points (M, 2): odometry frame [m]. For as long as it can, a band goes on
        to where it led, whatever other way the path takes by now: two ways of equal length must not make the
        robot waver. A torn band is made anew if the path is `planned` around obstacles, and otherwise left to
        the forces; a new end of the path makes a new band in any case.
        """
        if self._leads_elsewhere(path) or (self.torn and planned and self._differs(path)):
            self._path, self.centres = path, robot[None]
        elif self._fits(path, robot):
            self._path = path
        self._advance(robot)
        self._deform(np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1]))

    def _leads_elsewhere(self, path: Floats) -> bool:
        """Whether there is no band to the path's end."""
        return len(self.centres) == 0 or math.dist(path[-1], self._path[-1]) > self._config.spacing

    def _differs(self, path: Floats) -> bool:
        """Whether the path would make another band than the one that the band was made from."""
        spacing = self._config.spacing
        old = np.vstack([self._path[:1], stretch(self._path, 0.0, math.inf, spacing)])
        new = stretch(path, 0.0, self._config.horizon, spacing)
        return not covered(new, old, np.zeros(len(old)), spacing)

    def _fits(self, path: Floats, robot: Floats) -> bool:
        """Whether the path runs through the bubbles to the band's end."""
        reach = self._config.spacing
        start = project(path, robot[0], robot[1])[0]
        end, off, _ = project(path, *self.centres[-1])
        between = stretch(path, start, end, reach)
        return off <= max(self.radii[-1], reach) and covered(between, self.centres, self.radii, reach)

    def _advance(self, robot: Floats) -> None:
        """Drop the bubbles that the robot has passed, and go on along the path; from the robot alone, afresh."""
        passed = project(self.centres, robot[0], robot[1])[2]
        start = project(self._path, robot[0], robot[1])[0]
        end = project(self._path, *self.centres[-1])[0] if len(self.centres) > 1 else start
        ahead = stretch(self._path, end, start + self._config.horizon, self._config.spacing)
        self.centres = np.vstack([robot, self.centres[passed + 1 :], ahead])
        if math.dist(self.centres[-1], self._path[-1]) <= self._config.spacing:
            self.centres[-1] = self._path[-1]

    def _deform(self, xs: Floats, ys: Floats) -> None:
        """Let the forces move the bubbles among the points (xs, ys)."""
        config = self._config
        shape = (self._inner, config.max_radius, config.spacing)
        forces = (config.internal_gain, config.external_gain, config.influence, config.min_force)
        self.radii = bubble_radii(self.centres, xs, ys, self._inner, config.max_radius)
        self._mend(xs, ys, shape)
        relax(self.centres, self.radii, xs, ys, shape, forces, (config.iterations, config.recursion))
        self._mend(xs, ys, shape)

    def _mend(self, xs: Floats, ys: Floats, shape: tuple[float, float, float]) -> None:
        joint = (self._config.overlap, self._config.min_radius)
        self.centres, self.radii, self.chain = mend(self.centres, self.radii, xs, ys, shape, joint, _CAPACITY)
