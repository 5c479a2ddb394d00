"""Births of tracks: groups of points are followed until there is evidence that they move and do not stand."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.perception.people.clusters import FEWEST, LEGS_RADIUS, middle_of
from lme.perception.people.registration import beam_towards, into, passed_through
from lme.perception.people.table import (  # fmt: skip
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
)

_MIN_FRACTION = 0.25  # of points that show motion; a lesser share counts as none
_QUIET = 0.01  # [m] noise of a range; with more of it, more evidence is needed
_TRAVEL_DEVIATIONS = 12.0  # standard deviations of a range that a track must have come
_MIN_TRAVEL = 0.06  # [m] that it must have come in any case
_MISSING_VOTES = 3  # of scans in which a beam without a return is free: surfaces flicker
_FLICKER = 0.1  # share of standing points missed before; if a lidar misses more, missing returns are ignored
_FADING = 0.98  # share of the counts that is kept from scan to scan
CELLS = 512  # along a side
_CELL = 0.1  # [m]


@njit(cache=True, error_model="numpy")
def match_groups(table, anchors, count, names, sight, group, groups, view, when, settings):
    """Correct unconfirmed tracks by the nearest group of points, and begin a track for every other group."""
    lidar, (noise, _, trusted, dt) = view[0], when
    points, movers, old = sight.points, sight.movers, count
    is_matched = np.zeros(old, np.bool_)
    for g in range(groups):
        members = np.flatnonzero(group == g)
        if len(members) < FEWEST:
            continue
        # Each group that is no part of a confirmed track goes to the nearest unconfirmed one, or begins a track.
        middle = middle_of(points, members, lidar, (0.0, 0.0, 0.0), noise, settings)
        if _in_confirmed(table, old, middle):
            continue
        best = _nearest(table, old, is_matched, middle, dt, settings)
        if best < 0:
            if count < MOST:
                begin(table[count], middle, names)
                _anchor(anchors[count], points, members)
                movers[names % len(movers)] = False
                sight.owner[members] = names
                count, names = count + 1, names + 1
            continue
        is_matched[best] = True
        row = table[best]
        sight.owner[members] = int(row[NAME])
        correct(row, middle)
        # Confirm the track when there is enough evidence of motion.
        if trusted and 2 * sight.stands[members].sum() <= len(members):
            moved_fraction = sight.moved[members].sum() / len(members)
            if _judge(row, anchors[best], moved_fraction, middle[3], view, when, settings):
                row[CONFIRMED] = 1.0
                movers[int(row[NAME]) % len(movers)] = True
    # Evidence fades while a track has no group.
    for n in range(old):
        if table[n, CONFIRMED] == 0.0 and not is_matched[n]:
            table[n, EVIDENCE] *= 0.5
    return count, names


@njit(cache=True, error_model="numpy")
def _nearest(table, count, is_matched, middle, dt, settings):
    """Index of the nearest row that is unconfirmed, still free and may have come so far; −1 if there is none."""
    best, min_distance = -1, math.inf
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] > 0.0 or is_matched[n]:
            continue
        distance = math.sqrt((middle[0] - row[X]) ** 2 + (middle[1] - row[Y]) ** 2)
        # Greatest way: at the greatest speed after one sighting, later by the uncertainty of the filter.
        reach = 0.1 + (settings.fastest * dt if row[SEEN] < 2.0 else 2.0 * math.sqrt(row[PP]) + 0.5 * dt)
        if distance < reach and distance < min_distance:
            best, min_distance = n, distance
    return best


@njit(cache=True, error_model="numpy")
def _in_confirmed(table, count, middle):
    """Return whether a group is a part of a track that was seen in this scan."""
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] > 0.0 and row[HIDDEN] == 0.0:
            distance = math.sqrt((middle[0] - row[X]) ** 2 + (middle[1] - row[Y]) ** 2)
            if distance < max(row[R], 0.4 if row[R] < LEGS_RADIUS else 0.0):
                return True
    return False


@njit(cache=True, error_model="numpy")
def _anchor(anchor, points, members):
    """Keep some of a group's points; NaN fills the rest."""
    anchor[:] = np.nan
    step = max(len(members) / ANCHORS, 1.0)
    for k in range(min(len(members), ANCHORS)):
        anchor[k] = points[members[int(k * step)]]


@njit(cache=True, error_model="numpy")
def _judge(row, anchor, moved_fraction, variance, view, timing, settings):
    """Return whether a track is where nothing was, or has left a place that is empty now, and has come some way.

    moved_fraction: fraction of its points that have moved; variance: of its middle [m²].
    """
    old, (noise, margin, _, _) = anchor[: _filled(anchor)], timing
    # Share of the points where it was first seen that the scan now sees through.
    vacated = (passed_through(old, view, margin) == 1).sum() / len(old)
    row[EVIDENCE] = (
        row[EVIDENCE] + moved_fraction + vacated
        if moved_fraction + vacated >= _MIN_FRACTION
        else 0.5 * row[EVIDENCE]
    )
    travel = math.sqrt((row[X] - row[BX]) ** 2 + (row[Y] - row[BY]) ** 2)
    # A noisier lidar must show more evidence and a longer way.
    min_evidence = settings.evidence * max(noise / _QUIET, 1.0)
    min_travel = max(_TRAVEL_DEVIATIONS * noise, _MIN_TRAVEL) + 2.0 * math.sqrt(variance)
    return row[EVIDENCE] >= min_evidence and travel >= min_travel


@njit(cache=True, error_model="numpy")
def _filled(anchor):
    count = 0
    while count < len(anchor) and not math.isnan(anchor[count, 0]):
        count += 1
    return count


@njit(cache=True, error_model="numpy")
def weigh(points, hits, view, margin, votes):
    """Add what an earlier scan says about each point (B, 2) with a hit (B,) to `votes` (B, 2).

    votes: number of scans that saw through its place, and of those that did if a beam without a return is free. view:
    of the earlier scan, see `passed_through`.
    """
    lidar, sure_ranges, free_ranges, angles = view
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for i in range(len(points)):
        if not hits[i]:
            continue
        # The earlier beam towards the point; it saw through the place if it ended behind it.
        x, y = into(points[i, 0], points[i, 1], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(free_ranges))
        if beam < 0:
            continue
        distance = math.sqrt(x * x + y * y)
        if sure_ranges[beam] > distance + margin:
            votes[i, 0] += 1
        elif free_ranges[beam] > distance + margin:
            votes[i, 1] += 1


@njit(cache=True, error_model="numpy")
def flickered(votes, stands, counts):
    """Update the numbers of standing points, and of those that a beam without a return missed before.

    votes (B, 2): see `weigh`; stands (B,): whether a point stands. The former `counts` fade.
    """
    standing, missing = _FADING * counts[0], _FADING * counts[1]
    for i in range(len(votes)):
        if stands[i]:
            standing += 1.0
            missing += votes[i, 1] > 0
    return standing, missing


@njit(cache=True, error_model="numpy")
def moved_points(votes, stands, counts):
    """Return whether each point (B,) has moved, by the votes of earlier scans; not where something stood before (B,).

    counts: numbers of points that stand and that were missed before, see `flickered`.
    """
    trusted = counts[1] <= _FLICKER * counts[0]
    has_moved = np.zeros(len(votes), np.bool_)
    for i in range(len(votes)):
        has_moved[i] = (votes[i, 0] > 0 or (trusted and votes[i, 1] >= _MISSING_VOTES)) and not stands[i]
    return has_moved


@njit(cache=True, error_model="numpy")
def remember(stood, points, hits, owner, movers, time):
    """Note in `stood` (CELLS, CELLS) the time at which something returned that is not known to move.

    points (B, 2), hits (B,), owner (B,): of a scan taken at `time` [s], with the track of each point.
    """
    for i in range(len(points)):
        if hits[i] and (owner[i] < 0 or not movers[owner[i] % len(movers)]):
            column, row = _cell(points[i, 0]), _cell(points[i, 1])
            stood[row % CELLS, column % CELLS] = time


@njit(cache=True, error_model="numpy")
def recall(stood, points, hits, since):
    """Return whether each point (B, 2) is where something stood after a time [s]: (B,)."""
    stands = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        if hits[i]:
            column, row = _cell(points[i, 0] - 0.5 * _CELL), _cell(points[i, 1] - 0.5 * _CELL)
            # Any of the four cells around the point.
            for k in range(2):
                for m in range(2):
                    stands[i] |= stood[(row + k) % CELLS, (column + m) % CELLS] >= since
    return stands


@njit(cache=True, error_model="numpy", inline="always")
def _cell(x):
    return math.floor(x / _CELL)
