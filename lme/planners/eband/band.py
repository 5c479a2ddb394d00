"""Elastic band: bubbles of free space along a path, moved by repulsion from obstacles and by contraction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lme.errors import require
from lme.planners.eband.kernels import bubble_radii, covered, mend, relax
from lme.planners.polyline import project, stretch
from lme.types import Floats

_CAPACITY = 256  # [bubbles] useful bands have far fewer


@dataclass(slots=True)
class BandConfig:
    """Bubbles and forces."""

    horizon: float = 2.0  # [m] length of path that becomes a band
    spacing: float = 0.05  # [m] least distance of inserted bubbles
    min_radius: float = 0.1  # [m] smaller bubbles do not join: the passage is too narrow
    max_radius: float = 1.0  # [m] of a bubble
    overlap: float = 0.7  # [-] greatest distance of joined bubbles, as a share of the sum of their radii
    internal_gain: float = 1.0  # [-] of the contraction
    external_gain: float = 2.0  # [1/m] of the repulsion
    influence: float = 0.55  # [m] smaller bubbles are repelled
    min_force: float = 0.15  # [-] smaller forces have no effect
    iterations: int = 3  # passes along the band in each control period
    recursion: int = 4  # halvings of a step that overshoots

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

    centres: (N, 2) [m], the first at the robot. radii: (N,) [m]. chain: number of bubbles, from the first one
    on, that are joined one to the next; less than N if the band is torn.
    """

    def __init__(self, config: BandConfig, inner: float) -> None:
        """inner: radius of the inscribed disc of the robot's outline [m]."""
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
        """Return whether some neighbours do not join even after insertion of bubbles."""
        return self.chain < len(self.centres)

    def update(self, path: Floats, robot: Floats, points: Floats, *, planned: bool) -> None:
        """Update the band for the robot's position and the path, then apply the forces.

        path (K, 2), K ≥ 1, robot (2,), points (M, 2): odometry frame [m]. The band keeps its route even if the
        path changes, so that the robot does not oscillate between two paths of equal length. A torn band is
        rebuilt if the path is `planned` around obstacles, and otherwise left to the forces. A path to another
        end always gives a new band.
        """
        if self._leads_elsewhere(path) or (self.torn and planned and self._differs(path)):
            self._path, self.centres = path, robot[None]
        elif self._fits(path, robot):
            self._path = path
        self._advance(robot)
        self._deform(np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1]))

    def _leads_elsewhere(self, path: Floats) -> bool:
        """Return whether there is no band, or the path has another end."""
        return len(self.centres) == 0 or math.dist(path[-1], self._path[-1]) > self._config.spacing

    def _differs(self, path: Floats) -> bool:
        """Return whether the path differs from the path of the band within the horizon."""
        spacing = self._config.spacing
        old = np.vstack([self._path[:1], stretch(self._path, 0.0, math.inf, spacing)])
        new = stretch(path, 0.0, self._config.horizon, spacing)
        return not covered(new, old, np.zeros(len(old)), spacing)

    def _fits(self, path: Floats, robot: Floats) -> bool:
        """Return whether the path runs through the bubbles to the band's end."""
        reach = self._config.spacing
        start = project(path, robot[0], robot[1])[0]
        end, distance, _ = project(path, *self.centres[-1])
        samples = stretch(path, start, end, reach)
        return distance <= max(self.radii[-1], reach) and covered(samples, self.centres, self.radii, reach)

    def _advance(self, robot: Floats) -> None:
        """Drop the bubbles that the robot has passed, and extend the band along the path."""
        num_passed = project(self.centres, robot[0], robot[1])[2]
        start = project(self._path, robot[0], robot[1])[0]
        end = project(self._path, *self.centres[-1])[0] if len(self.centres) > 1 else start
        ahead = stretch(self._path, end, start + self._config.horizon, self._config.spacing)
        self.centres = np.vstack([robot, self.centres[num_passed + 1 :], ahead])
        if math.dist(self.centres[-1], self._path[-1]) <= self._config.spacing:
            self.centres[-1] = self._path[-1]

    def _deform(self, xs: Floats, ys: Floats) -> None:
        """Move the bubbles by the forces of the points (xs, ys) and of their neighbours."""
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
