"""Tracks from scan to scan: their prediction, the assignment of scan points, and the correction by them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.perception.people.births import match_groups
from lme.perception.people.clusters import FEWEST, LEGS_RADIUS, middle_of, runs_of
from lme.perception.people.registration import beam_towards, into, passed_through
from lme.perception.people.table import BX, BY, CONFIRMED, HIDDEN, LEGS, NAME, PP, RR, STILL, R, X, Y, correct

_REACH = 0.1  # [m] beyond a track's radius at which a point may belong to it, besides the uncertainty
_ON_CIRCLE = 0.1  # [m] from a track's circle at which a moved point may belong to it; half of this for others
_FASTEST_TURN = 3.0  # [m/s] change of velocity of a person who turns round
_SLACK = 0.1  # [m] a beam that ends this much before a track hides it
_BLINK = 0.35  # [s] for which a track may be missed in an empty place: legs far away return little
_ONE_STEP = 0.25  # [m] a track that does not leave a place by more than this stands


@njit(cache=True, error_model="numpy")
def claims(table, count, sight, settings):
    """Row of the confirmed track of each point, −1 for none. Points where something stood before have none."""
    points, hits, moved, stands = sight.points, sight.hits, sight.moved, sight.stands
    owner, score = np.full(len(points), -1, np.int64), np.full(len(points), math.inf)
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] == 0.0:
            continue
        # Reach of a track: radius and uncertainty, at least the distance between legs if it may be two legs.
        unsure = min(2.0 * math.sqrt(row[PP]), 0.3)
        reach = max(row[R] + _REACH + unsure, settings.joint if row[R] < LEGS_RADIUS else 0.0)
        for i in range(len(points)):
            dx, dy = points[i, 0] - row[X], points[i, 1] - row[Y]
            if not hits[i] or stands[i] or abs(dx) > reach or abs(dy) > reach:
                continue
            # Of several tracks that a point may belong to, the one with the best fit has it.
            distance = math.sqrt(dx * dx + dy * dy)
            residual = abs(distance - row[R])
            on_circle = residual < (_ON_CIRCLE if moved[i] else 0.5 * _ON_CIRCLE) + unsure
            cost = max(distance - row[R], 0.0) + 0.3 * residual
            if distance < reach and on_circle and cost < score[i]:
                owner[i], score[i] = n, cost
    return owner


@njit(cache=True, error_model="numpy")
def correct_confirmed(table, count, row_of, points, lidar, when, settings):
    """Correct each confirmed track by its points, unless they are too far from where it is expected."""
    noise, _, _, dt = when
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] == 0.0:
            continue
        members = np.flatnonzero(row_of == n)
        if len(members) < FEWEST:
            continue
        middle = middle_of(points, members, lidar, (row[R], row[RR] + 1e-4, row[LEGS]), noise, settings)
        # Leave out a middle that neither the uncertainty nor a turn explains.
        distance = math.sqrt((middle[0] - row[X]) ** 2 + (middle[1] - row[Y]) ** 2)
        if distance < 3.0 * math.sqrt(row[PP] + middle[3]) + _FASTEST_TURN * dt:
            correct(row, middle)


@njit(cache=True, error_model="numpy")
def in_sight(table, lidar, points, hits, angles):
    """Return whether the scan shows each track (T,): the beam towards the middle does not end before the front."""
    is_shown = np.ones(len(table), np.bool_)
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for n in range(len(table)):
        # Beam towards the track's middle.
        x, y = into(table[n, X], table[n, Y], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(points))
        if beam < 0:
            is_shown[n] = False
        elif hits[beam]:
            reach = math.sqrt(points[beam, 0] ** 2 + points[beam, 1] ** 2)
            is_shown[n] = reach > math.sqrt(x * x + y * y) - table[n, R] - _SLACK
    return is_shown


@njit(cache=True, error_model="numpy")
def advance(table, anchors, count, names, sight, view, when, settings):
    """Correct, begin and end tracks; return their number, and that of the names given so far.

    table (MOST, COLUMNS), anchors (MOST, ANCHORS, 2): the first `count` rows are tracks. sight: the scan; its owners
    are filled in. view: the lidar's pose, both free ranges (B,) and the beams' angles, see `passed_through`. when:
    noise of a range [m], margin [m], whether the registration is trusted, and time since the last scan [s].
    """
    # Confirmed tracks take the points near their circles and are corrected by them.
    row_of = claims(table, count, sight, settings)
    correct_confirmed(table, count, row_of, sight.points, view[0], when, settings)
    for i in range(len(row_of)):
        sight.owner[i] = -1 if row_of[i] < 0 else int(table[row_of[i], NAME])
    # The other points form groups: unconfirmed tracks, old or new.
    loose = sight.hits & (row_of < 0)
    group, groups = runs_of(sight.points, loose, sight.moved, view[0], settings)
    count, names = match_groups(table, anchors, count, names, sight, group, groups, view, when, settings)
    return kept_tracks(table, anchors, count, view, when, settings), names


@njit(cache=True, error_model="numpy")
def kept_tracks(table, anchors, count, view, when, settings):
    """Drop tracks whose place is empty, or that are hidden or stand for too long; return how many are left."""
    num_kept = 0
    for n in range(count):
        row = table[n]
        if _is_over(row, view, when, settings):
            continue
        # Close the gap that dropped rows leave.
        if num_kept < n:
            table[num_kept] = row
            anchors[num_kept] = anchors[n]
        num_kept += 1
    return num_kept


@njit(cache=True, error_model="numpy")
def _is_over(row, view, timing, settings):
    _, margin, _, dt = timing
    if row[CONFIRMED] == 0.0:
        return row[HIDDEN] > 1.5 * dt
    row[STILL] += dt
    # A track that leaves its place by a step begins to stand anew.
    if math.sqrt((row[X] - row[BX]) ** 2 + (row[Y] - row[BY]) ** 2) > _ONE_STEP:
        row[STILL], row[BX], row[BY] = 0.0, row[X], row[Y]
    if row[HIDDEN] > settings.coasting or row[STILL] > settings.standing:
        return True
    if row[HIDDEN] > max(1.5 * dt, _BLINK):
        return passed_through(row[:2].reshape(1, 2), view, margin)[0] == 1
    return False
