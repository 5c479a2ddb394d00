"""The criteria of LME+ (docs/lme_plus.md). Each is a time [s], an angle [rad] or a yes or no; larger is better.

Each takes (N, 2) candidates in the robot frame and a `Sight`, and returns (N,) unweighted values. The first line of
each docstring is shown in explainer pages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from lme.kernels.straight_ways import reachable
from lme.policies.distance import distances_to, turns
from lme.policies.lme_plus.travel import Field
from lme.types import Floats, Pose

_ORIGIN = np.zeros(2)
TIGHT = 0.75  # share of the margins that is kept if there is no other way


class Sight(NamedTuple):
    """Input of the criteria.

    points: (M, 2) known obstacle points in the robot frame [m]. pose: of the robot in the frame of `field`. box:
    footprint. margin, turn_margin: distances that straight ways and turns keep [m]. v_max [m/s].
    """

    points: Floats
    pose: Pose
    field: Field
    box: tuple[float, float, float]
    margin: float
    turn_margin: float
    v_max: float


Criterion = Callable[[Floats, Sight], Floats]


def a_reach(candidates: Floats, sight: Sight) -> Floats:
    """Time to reach: minus the time of the straight way to the candidate at full speed [s]. Nearer is better."""
    return -distances_to(candidates, _ORIGIN) / sight.v_max


def a_dev(candidates: Floats, sight: Sight) -> Floats:
    """Directional deviation: minus the angle to turn to face the candidate [rad]. Straight ahead is best.

    Eq. 3 of the paper, as in LME.
    """
    return -turns(candidates)


def a_rest(candidates: Floats, sight: Sight) -> Floats:
    """Rest of the way: minus the expected time from the candidate to the target, around all that is known [s]."""
    return -sight.field.rest(candidates, sight.pose)


def c_o(candidates: Floats, sight: Sight) -> Floats:
    """Collision-free reachability: 1 if the footprint can turn to the candidate and drive straight there, else 0.

    If there is no such candidate, those that can be reached with the margins times `TIGHT` have 1/2.
    """
    return reachable(candidates, sight.points, sight.box, sight.margin, sight.turn_margin, TIGHT)


CRITERIA: Mapping[str, Criterion] = {"a_reach": a_reach, "a_dev": a_dev, "a_rest": a_rest, "c_o": c_o}
