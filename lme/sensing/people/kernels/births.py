"""Follows groups of points until there is evidence that they move; then they are tracks."""

import math

import numpy as np
from numba import njit

from lme.sensing.people.kernels.clusters import FEWEST
from lme.sensing.people.kernels.middle import LEGS_RADIUS, middle_of
from lme.sensing.people.kernels.scans import passed_through
from lme.sensing.people.kernels.table import (
    ANCHORS,
    BX,
    BY,
    CONFIRMED,
    EVIDENCE,
    HIDDEN,
    MOST,
    NAME,
    PP,
    SEEN,
    R,
    X,
    Y,
    begin,
    correct,
)  # fmt: skip

_LEAST_SHARE = 0.25  # of points that show motion; less is none
_QUIET = 0.01  # [m] noise of a range; with more of it, more evidence is needed
_WAY = 12.0  # standard deviations of a range that a track must have come
_LEAST_WAY = 0.06  # [m] that it must have come in any case


@njit(cache=True, error_model="numpy")
def match_groups(table, anchors, count, names, sight, group, groups, view, when, settings):
    """Correct what is not confirmed yet by the nearest group of points, and begin a track for every other group."""
    lidar, (noise, _, trusted, dt) = view[0], when
    points, movers, old = sight.points, sight.movers, count
    taken = np.zeros(old, np.bool_)
    for g in range(groups):
        own = np.flatnonzero(group == g)
        if len(own) < FEWEST:
            continue
        found = middle_of(points, own, lidar, (0.0, 0.0, 0.0), noise, settings)
        if _in_confirmed(table, old, found):
            continue
        best = _nearest(table, old, taken, found, dt, settings)
        if best < 0:
            if count < MOST:
                begin(table[count], found, names)
                _anchor(anchors[count], points, own)
                movers[names % len(movers)] = False
                sight.owner[own] = names
                count, names = count + 1, names + 1
            continue
        taken[best] = True
        row = table[best]
        sight.owner[own] = int(row[NAME])
        correct(row, found)
        if trusted and 2 * sight.stands[own].sum() <= len(own):
            moved = sight.moved[own].sum() / len(own)
            if _judge(row, anchors[best], moved, found[3], view, when, settings):
                row[CONFIRMED] = 1.0
                movers[int(row[NAME]) % len(movers)] = True
    for n in range(old):
        if table[n, CONFIRMED] == 0.0 and not taken[n]:
            table[n, EVIDENCE] *= 0.5
    return count, names


@njit(cache=True, error_model="numpy")
def _nearest(table, count, taken, found, dt, settings):
    """The nearest row that is not confirmed and still free, and may have come so far; −1: none."""
    best, least = -1, math.inf
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] > 0.0 or taken[n]:
            continue
        away = math.sqrt((found[0] - row[X]) ** 2 + (found[1] - row[Y]) ** 2)
        reach = 0.1 + (settings.fastest * dt if row[SEEN] < 2.0 else 2.0 * math.sqrt(row[PP]) + 0.5 * dt)
        if away < reach and away < least:
            best, least = n, away
    return best


@njit(cache=True, error_model="numpy")
def _in_confirmed(table, count, found):
    """Whether a group is a part of a track that was seen in this scan."""
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] > 0.0 and row[HIDDEN] == 0.0:
            away = math.sqrt((found[0] - row[X]) ** 2 + (found[1] - row[Y]) ** 2)
            if away < max(row[R], 0.4 if row[R] < LEGS_RADIUS else 0.0):
                return True
    return False


@njit(cache=True, error_model="numpy")
def _anchor(anchor, points, own):
    """Keep some of a group's points; NaN fills the rest."""
    anchor[:] = np.nan
    step = max(len(own) / ANCHORS, 1.0)
    for k in range(min(len(own), ANCHORS)):
        anchor[k] = points[own[int(k * step)]]


@njit(cache=True, error_model="numpy")
def _judge(row, anchor, moved, variance, view, when, settings):
    """Whether a track is where nothing was, or has left a place that is empty now, and has come some way.

    moved: share of its points that have; variance: of its middle [m²].
    """
    old, (noise, margin, _, _) = anchor[: _filled(anchor)], when
    left = (passed_through(old, view, margin) == 1).sum() / len(old)
    row[EVIDENCE] = row[EVIDENCE] + moved + left if moved + left >= _LEAST_SHARE else 0.5 * row[EVIDENCE]
    way = math.sqrt((row[X] - row[BX]) ** 2 + (row[Y] - row[BY]) ** 2)
    enough = settings.evidence * max(noise / _QUIET, 1.0)
    least = max(_WAY * noise, _LEAST_WAY) + 2.0 * math.sqrt(variance)
    return row[EVIDENCE] >= enough and way >= least


@njit(cache=True, error_model="numpy")
def _filled(anchor):
    count = 0
    while count < len(anchor) and not math.isnan(anchor[count, 0]):
        count += 1
    return count
