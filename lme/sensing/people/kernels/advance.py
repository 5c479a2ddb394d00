"""Brings all tracks up to a scan."""

import math

from numba import njit

from lme.sensing.people.kernels.births import match_groups
from lme.sensing.people.kernels.clusters import runs_of
from lme.sensing.people.kernels.matching import claims, correct_confirmed
from lme.sensing.people.kernels.scans import passed_through
from lme.sensing.people.kernels.table import AGE, BX, BY, CONFIRMED, HIDDEN, STILL, VX, VY, R, X, Y

_ONE_STEP = 0.25  # [m] who does not leave a place by more stands
_PROBATION = 1.5  # [s] within which a new track must take a step
_SAME_PLACE = 0.3  # share of the radii within which two tracks are one


@njit(cache=True, error_model="numpy")
def advance(table, anchors, count, names, points, hits, moved, view, when, settings):
    """Corrects, begins and ends tracks; their number, and that of the names given so far.

    table (MOST, COLUMNS), anchors (MOST, ANCHORS, 2): the first `count` rows are tracks. points (B, 2), hits (B,),
    moved (B,): of the scan. view: the lidar's pose, both free ranges (B,) and the beams' angles, see
    `passed_through`. when: noise of a range [m], margin [m], whether the registration is trusted, and time since the
    last scan [s].
    """
    owner = claims(table, count, points, hits, moved, settings)
    correct_confirmed(table, count, owner, points, hits, moved, view, when, settings)
    loose = hits & (owner < 0)
    group, groups = runs_of(points, loose, moved, view[0], settings)
    count, names = match_groups(
        table, anchors, count, names, points, moved, group, groups, view, when, settings
    )
    return kept_tracks(table, anchors, count, view, when, settings), names


@njit(cache=True, error_model="numpy")
def kept_tracks(table, anchors, count, view, when, settings):
    """Drop tracks whose place is empty, that are hidden or stand for too long, and doubles; the number of the rest."""
    kept = 0
    for n in range(count):
        row = table[n]
        if _ends(row, view, when, settings) or _is_double(table, kept, row):
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
        row[STILL], row[BX], row[BY], row[CONFIRMED] = 0.0, row[X], row[Y], 2.0
    patience = settings.standing if row[CONFIRMED] > 1.0 else _PROBATION
    if row[HIDDEN] > settings.coasting or row[STILL] > patience:
        return True
    if row[HIDDEN] > 1.5 * dt:
        return passed_through(row[:2].reshape(1, 2), view, margin)[0] == 1
    return False


@njit(cache=True, error_model="numpy")
def _is_double(table, kept, row):
    """Whether an older track is in the same place and goes the same way."""
    if row[CONFIRMED] == 0.0:
        return False
    for m in range(kept):
        other = table[m]
        if other[CONFIRMED] == 0.0:
            continue
        away = math.sqrt((other[X] - row[X]) ** 2 + (other[Y] - row[Y]) ** 2)
        differs = math.sqrt((other[VX] - row[VX]) ** 2 + (other[VY] - row[VY]) ** 2)
        if away < max(_SAME_PLACE * (other[R] + row[R]), 0.3) and differs < 0.7 and other[AGE] >= row[AGE]:
            return True
    return False
