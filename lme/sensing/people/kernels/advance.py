"""Brings all tracks up to a scan."""

import math

from numba import njit

from lme.sensing.people.kernels.births import match_groups
from lme.sensing.people.kernels.clusters import runs_of
from lme.sensing.people.kernels.matching import claims, correct_confirmed
from lme.sensing.people.kernels.scans import passed_through
from lme.sensing.people.kernels.table import BX, BY, CONFIRMED, HIDDEN, NAME, STILL, X, Y

_BLINK = 0.35  # [s] for which a track may be missed in an empty place: legs far away return little
_ONE_STEP = 0.25  # [m] who does not leave a place by more stands


@njit(cache=True, error_model="numpy")
def advance(table, anchors, count, names, sight, view, when, settings):
    """Corrects, begins and ends tracks; their number, and that of the names given so far.

    table (MOST, COLUMNS), anchors (MOST, ANCHORS, 2): the first `count` rows are tracks. sight: the scan; its owners
    are filled in. view: the lidar's pose, both free ranges (B,) and the beams' angles, see `passed_through`. when:
    noise of a range [m], margin [m], whether the registration is trusted, and time since the last scan [s].
    """
    row_of = claims(table, count, sight, settings)
    correct_confirmed(table, count, row_of, sight.points, view[0], when, settings)
    for i in range(len(row_of)):
        sight.owner[i] = -1 if row_of[i] < 0 else int(table[row_of[i], NAME])
    loose = sight.hits & (row_of < 0)
    group, groups = runs_of(sight.points, loose, sight.moved, view[0], settings)
    count, names = match_groups(table, anchors, count, names, sight, group, groups, view, when, settings)
    return kept_tracks(table, anchors, count, view, when, settings), names


@njit(cache=True, error_model="numpy")
def kept_tracks(table, anchors, count, view, when, settings):
    """Drop tracks whose place is empty, that are hidden or stand for too long; the number of the rest."""
    kept = 0
    for n in range(count):
        row = table[n]
        if _ends(row, view, when, settings):
            continue
        if kept < n:
            table[kept] = row
            anchors[kept] = anchors[n]
        kept += 1
    return kept


@njit(cache=True, error_model="numpy")
def _ends(row, view, when, settings):
    _, margin, _, dt = when
    if row[CONFIRMED] == 0.0:
        return row[HIDDEN] > 1.5 * dt
    row[STILL] += dt
    if math.sqrt((row[X] - row[BX]) ** 2 + (row[Y] - row[BY]) ** 2) > _ONE_STEP:
        row[STILL], row[BX], row[BY] = 0.0, row[X], row[Y]
    if row[HIDDEN] > settings.coasting or row[STILL] > settings.standing:
        return True
    if row[HIDDEN] > max(1.5 * dt, _BLINK):
        return passed_through(row[:2].reshape(1, 2), view, margin)[0] == 1
    return False
