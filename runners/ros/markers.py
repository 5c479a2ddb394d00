"""Markers of a decision for RViz and Foxglove, as plain data.

They show candidates by score, subgoal, path, sectors, A and B, and people with their motion in the next second.
Colours are those of the explainer page: viridis for scores, Okabe and Ito's for sectors and marks.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from lme.guides.lme.explanation import Explanation
from lme.guides.lme.surmount import sector_points
from lme.types import Floats, Guidance, Observation

_VIRIDIS = np.array(
    [
        (0.267, 0.005, 0.329),
        (0.254, 0.265, 0.530),
        (0.164, 0.471, 0.558),
        (0.135, 0.659, 0.518),
        (0.478, 0.821, 0.318),
        (0.993, 0.906, 0.144),
    ]
)
_SECTORS = np.array([(0.902, 0.624, 0.0), (0.337, 0.706, 0.914), (0.835, 0.369, 0.0), (0.8, 0.475, 0.655)])
_SUBGOAL = np.array([0.835, 0.369, 0.0])
_TARGET = np.array([0.0, 0.620, 0.451])
_PATH = np.array([0.0, 0.447, 0.698])
_PERSON = np.array([0.8, 0.475, 0.655])
_INK = np.array([0.1, 0.1, 0.1])
_CLIP = (0.05, 0.95)  # otherwise a few extreme scores would use up the scale
_DOT, _LINE, _MARK, _LETTER = 0.04, 0.03, 0.16, 0.25  # [m]


class Shape(IntEnum):
    """Values of `type` in visualization_msgs/Marker."""

    LINE_STRIP = 4
    SPHERES = 7
    POINTS = 8
    TEXT = 9


class Marker(NamedTuple):
    """A marker in the base frame.

    points: (N, 2) [m]. colours: (N, 3), or (1, 3) for all: red, green, blue from 0 to 1. size: of a point, the width
    of a line, or the height of a letter [m].
    """

    group: str
    number: int
    shape: Shape
    points: Floats
    colours: Floats
    size: float
    text: str = ""


def markers(observation: Observation, guidance: Guidance, explanation: Explanation | None) -> list[Marker]:
    """Return the markers of one decision. A guide that cannot explain has fewer."""
    all_markers = [] if explanation is None else [*_explanation_markers(explanation)]
    if guidance.path is not None and len(guidance.path) > 1:
        all_markers.append(Marker("path", 0, Shape.LINE_STRIP, guidance.path, _PATH[None], _LINE))
    all_markers += _people(observation.pedestrians)
    all_markers.append(_mark("target", observation.target, _TARGET))
    all_markers.append(_mark("subgoal", guidance.subgoal, _SUBGOAL))
    return all_markers


def _explanation_markers(explanation: Explanation) -> Iterator[Marker]:
    yield Marker("candidates", 0, Shape.POINTS, explanation.candidates, _shades(explanation.scores), _DOT)
    # Each sector as a line through its points, and a single point as a ball.
    for k, sector in enumerate(explanation.sectors):
        points = sector_points(explanation.view.points, sector)
        shape = Shape.LINE_STRIP if len(points) > 1 else Shape.SPHERES
        yield Marker("sectors", k, shape, points, _SECTORS[None, k % len(_SECTORS)], _LINE)
    blockage = explanation.view.blockage
    if blockage is not None:
        for k, (name, point) in enumerate((("A", blockage.A), ("B", blockage.B))):
            yield Marker("A and B", k, Shape.SPHERES, point[None], _INK[None], _MARK / 2)
            yield Marker("letters", k, Shape.TEXT, point[None], _INK[None], _LETTER, name)


def _people(pedestrians: Floats) -> Iterator[Marker]:
    """Yield a mark for each person (P, 4), and a line to the person's position a second later."""
    for k, (x, y, vx, vy) in enumerate(pedestrians):
        displacement = np.array([(x, y), (x + vx, y + vy)])
        yield Marker("people", k, Shape.SPHERES, displacement[:1], _PERSON[None], 2.0 * _MARK)
        yield Marker("people in a second", k, Shape.LINE_STRIP, displacement, _PERSON[None], _LINE)


def _mark(group: str, point: Floats, colour: Floats) -> Marker:
    return Marker(group, 0, Shape.SPHERES, point[None], colour[None], _MARK)


def _shades(scores: Floats) -> Floats:
    """Return the (N, 3) colours of (N,) scores."""
    low, high = np.quantile(scores, _CLIP)
    share = np.clip((scores - low) / (high - low), 0.0, 1.0) if high > low else np.full(len(scores), 0.5)
    stops = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.column_stack([np.interp(share, stops, channel) for channel in _VIRIDIS.T])
