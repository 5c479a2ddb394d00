"""Tracks from scan to scan: their table, the filter on a row, their points, their births and their ends.

A row of the table is a track: something that moves or, while CONFIRMED is 0, something that may turn out to move. The
covariance is the same in every direction, and so in every frame: variances of position and velocity, and their
covariance. LEGS is the share of the scans in which a track looked like legs. A group of points is followed until there
is evidence that it moves and does not stand; then its track is confirmed.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from lme.geometry.frames import to_robot
from lme.perception.people.clusters import FEWEST, LEGS_RADIUS, UNKNOWN, middle_of, runs_of
from lme.perception.people.interface import Tracks
from lme.perception.people.registration import beam_towards, into, passed_through
from lme.types import Floats, Pose

COLUMNS = 19
X, Y, VX, VY, PP, PV, VV, R, RR, AGE, HIDDEN, EVIDENCE, CONFIRMED, NAME, STILL, SEEN, BX, BY, LEGS = range(
    COLUMNS
)
ANCHORS = 12  # points of a track when it was first seen
MOST = 160  # rows

_NEWEST = 0.1  # share of the newest scan in LEGS
_FIRST_SPEED = 1.0  # [m/s] standard deviation before the first step
_REACH = 0.1  # [m] beyond a track's radius at which a point may belong to it, besides the uncertainty
_ON_CIRCLE = 0.1  # [m] from a track's circle at which a moved point may belong to it; half of this for others
_FASTEST_TURN = 3.0  # [m/s] change of velocity of a person who turns round
_SLACK = 0.1  # [m] a beam that ends this much before a track hides it
_BLINK = 0.35  # [s] for which a track may be missed in an empty place: legs far away return little
_ONE_STEP = 0.25  # [m] a track that does not leave a place by more than this stands
_MIN_FRACTION = 0.25  # of points that show motion; a lesser share counts as none
_QUIET = 0.01  # [m] noise of a range; with more of it, more evidence is needed
_TRAVEL_DEVIATIONS = 12.0  # standard deviations of a range that a track must have come
_MIN_TRAVEL = 0.06  # [m] that it must have come in any case


def new_table() -> tuple[Floats, Floats]:
    """Create a table without tracks, and their points when they were first seen, for `advance`."""
    return np.zeros((MOST, COLUMNS)), np.full((MOST, ANCHORS, 2), np.nan)


def shown(rows: Floats, max_hidden: float, scan: tuple[Any, ...], base: Pose) -> Tracks:
    """Return the confirmed tracks that were seen within `max_hidden` [s] and that nothing hides in a scan.

    rows (T, COLUMNS); scan: see `in_sight`; base: frame of the result.
    """
    rows = rows[(rows[:, CONFIRMED] > 0.0) & (rows[:, HIDDEN] <= max_hidden) & in_sight(rows, *scan)]
    covariance = np.zeros((len(rows), 4, 4))
    for k in (0, 1):
        covariance[:, k, k], covariance[:, k + 2, k + 2] = rows[:, PP], rows[:, VV]
        covariance[:, k, k + 2] = covariance[:, k + 2, k] = rows[:, PV]
    turn = Pose(0.0, 0.0, base.yaw)
    return Tracks(
        rows[:, NAME].astype(np.int64),
        np.hstack([to_robot(rows[:, [X, Y]], base), to_robot(rows[:, [VX, VY]], turn)]),
        rows[:, R].copy(),
        rows[:, AGE].copy(),
        covariance,
    )


@njit(cache=True, error_model="numpy")
def predict(table, count, dt, acceleration):
    """Move every track on by `dt` [s]."""
    for n in range(count):
        row = table[n]
        row[X] += dt * row[VX]
        row[Y] += dt * row[VY]
        # P ← F P Fᵀ + Q of the constant-velocity model with white noise of the acceleration.
        row[PP] += dt * (2.0 * row[PV] + dt * row[VV]) + acceleration * dt**3 / 3.0
        row[PV] += dt * row[VV] + acceleration * dt**2 / 2.0
        row[VV] += acceleration * dt
        row[AGE] += dt
        row[HIDDEN] += dt


@njit(cache=True, error_model="numpy")
def begin(row, middle, name):
    """Begin a track at a measured middle, see `middle_of`."""
    row[:] = 0.0
    row[X], row[Y], row[R], row[PP], row[RR] = middle
    row[BX], row[BY] = row[X], row[Y]
    row[VV], row[NAME], row[SEEN] = _FIRST_SPEED**2, name, 1.0


@njit(cache=True, error_model="numpy")
def correct(row, middle):
    """Correct a track by a measured middle, see `middle_of`."""
    x, y, radius, variance, spread = middle
    dx, dy = x - row[X], y - row[Y]
    # Kalman update of position and velocity, the same along both axes.
    total = row[PP] + variance
    gain, speed_gain = row[PP] / total, row[PV] / total
    row[X] += gain * dx
    row[Y] += gain * dy
    row[VX] += speed_gain * dx
    row[VY] += speed_gain * dy
    row[VV] -= speed_gain * row[PV]
    row[PV] *= 1.0 - gain
    row[PP] *= 1.0 - gain
    # The radius has a filter of its own.
    radius_gain = row[RR] / (row[RR] + spread)
    row[R] += radius_gain * (radius - row[R])
    row[RR] = max((1.0 - radius_gain) * row[RR], 1e-4)
    # Running share of the scans in which it looked like legs.
    is_legs = 1.0 if spread >= UNKNOWN and row[R] < LEGS_RADIUS else 0.0
    row[LEGS] += _NEWEST * (is_legs - row[LEGS])
    row[HIDDEN] = 0.0
    row[SEEN] += 1.0


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
