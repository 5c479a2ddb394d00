"""The criteria of LME+ (docs/understand/lme_plus.md).

Each takes (N, 2) candidates in the robot frame and a `Perception`, and returns (N,) unweighted values: a time [s], an
angle [rad] or a yes or no, of which larger is better. The first line of each docstring is shown in explainer pages.
They are compiled, and `ranked` computes all of them in one call.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from lme.geometry.straight_ways import reachable
from lme.guides.lme.criteria import distances_to, turns
from lme.guides.lme.score import rank
from lme.guides.lme_plus.travel import BEYOND, Field
from lme.guides.lme_plus.travel_grid import cost_to_go_at, turns_at
from lme.types import Floats, Pose

TIGHT = 0.75  # share of the margin that is kept if there is no other way
NARROW_SHARE = 0.5  # share of the margin that is kept if the fastest way is a narrow passage


class Perception(NamedTuple):
    """Input of the criteria.

    points: (M, 2) known obstacle points in the robot frame [m]. pose: of the robot in the frame of `field`. box:
    footprint. margin: distance that straight ways and turns keep [m]. v_max [m/s].
    """

    points: Floats
    pose: Pose
    field: Field
    box: tuple[float, float, float]
    margin: float
    v_max: float

    def plain(self) -> tuple[Any, ...]:
        """Return the same values in plain tuples, which Numba recognises faster than named ones."""
        times, narrow, robot_time, grid, *places = self.field
        field = times, narrow, robot_time, (*grid,), *places
        return self.points, (*self.pose,), field, self.box, self.margin, self.v_max


Criterion = Callable[[Floats, Perception], Floats]


@njit(cache=True, error_model="numpy")
def a_reach(candidates: Floats, sight: Perception) -> Floats:
    """Time to reach: minus the time of the straight way to the candidate at full speed [s]. Nearer is better."""
    return -distances_to(candidates, np.zeros(2)) / sight.v_max


@njit(cache=True, error_model="numpy")
def a_dev(candidates: Floats, sight: Perception) -> Floats:
    """Directional deviation: minus the turns to the candidate and from there to the fastest way on [rad].

    The first turn is Eq. 3 of the paper, as in LME.
    """
    field = sight.field
    return -turns(candidates) - turns_at(field.times, candidates, sight.pose, field.grid, field.target)


@njit(cache=True, error_model="numpy")
def a_rest(candidates: Floats, sight: Perception) -> Floats:
    """Rest of the way: minus the expected time from the candidate to the target, around all that is known [s]."""
    field = sight.field
    ends = field.robot_time, BEYOND, field.here, field.target, field.v_max
    return -cost_to_go_at(field.times, candidates, sight.pose, field.grid, *ends)


@njit(cache=True, error_model="numpy")
def c_o(candidates: Floats, sight: Perception) -> Floats:
    """Collision-free reachability: 1 if the footprint can turn to the candidate and drive straight there, else 0.

    If there is no such candidate, those that can be reached with the margin times `TIGHT` have 1/2.
    """
    return reachable(candidates, sight.points, sight.box, sight.margin, sight.margin, TIGHT)


CRITERIA: Mapping[str, Criterion] = {"a_reach": a_reach, "a_dev": a_dev, "a_rest": a_rest, "c_o": c_o}


@njit(cache=True, error_model="numpy")
def ranked(
    pool: Floats, sight: Perception | tuple[Any, ...], weights: Floats, candidates: int
) -> tuple[Floats, Floats, int, bool]:
    """Compute the criteria (C, N) of (N, 2) points, their S (N,), the best candidate, and whether none is reachable.

    The first points are the candidates. sight: `Perception.plain`. See `lme.guides.lme.score.rank`.
    """
    points, pose, field, box, margin, v_max = sight
    named_sight = Perception(points, pose, Field(*field), box, margin, v_max)
    # One row per criterion, in the order of `CRITERIA`.
    features = np.empty((4, len(pool)))
    features[0], features[1] = a_reach(pool, named_sight), a_dev(pool, named_sight)
    features[2], features[3] = a_rest(pool, named_sight), c_o(pool, named_sight)
    scores, new, blocked = rank(features, weights, candidates, 3)
    return features, scores, new, blocked
