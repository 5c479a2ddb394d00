"""The table of tracks: its columns, and the constant-velocity filter on a row.

A row is a track: what moves, or (CONFIRMED 0) what may turn out to. The
covariance is the same in every direction, so it is the same in every frame: variances of place and velocity, and what
they share. LEGS is the share of the scans in which a track looked like legs.
"""

from numba import njit

from lme.perception.people.clusters import LEGS_RADIUS, UNKNOWN

COLUMNS = 19
X, Y, VX, VY, PP, PV, VV, R, RR, AGE, HIDDEN, EVIDENCE, CONFIRMED, NAME, STILL, SEEN, BX, BY, LEGS = range(
    COLUMNS
)
ANCHORS = 12  # points of a track when it was first seen
MOST = 160  # rows

_NEWEST = 0.1  # share of the newest scan in LEGS
_FIRST_SPEED = 1.0  # [m/s] standard deviation before the first step


@njit(cache=True, error_model="numpy")
def predict(table, count, dt, acceleration):
    """Move every track on by `dt` [s]."""
    for n in range(count):
        row = table[n]
        row[X] += dt * row[VX]
        row[Y] += dt * row[VY]
        row[PP] += dt * (2.0 * row[PV] + dt * row[VV]) + acceleration * dt**3 / 3.0
        row[PV] += dt * row[VV] + acceleration * dt**2 / 2.0
        row[VV] += acceleration * dt
        row[AGE] += dt
        row[HIDDEN] += dt


@njit(cache=True, error_model="numpy")
def begin(row, found, name):
    """Start a track at a middle, see `middle_of`."""
    row[:] = 0.0
    row[X], row[Y], row[R], row[PP], row[RR] = found
    row[BX], row[BY] = row[X], row[Y]
    row[VV], row[NAME], row[SEEN] = _FIRST_SPEED**2, name, 1.0


@njit(cache=True, error_model="numpy")
def correct(row, found):
    """Correct a track by a middle that was found."""
    x, y, radius, variance, spread = found
    dx, dy = x - row[X], y - row[Y]
    total = row[PP] + variance
    gain, speed_gain = row[PP] / total, row[PV] / total
    row[X] += gain * dx
    row[Y] += gain * dy
    row[VX] += speed_gain * dx
    row[VY] += speed_gain * dy
    row[VV] -= speed_gain * row[PV]
    row[PV] *= 1.0 - gain
    row[PP] *= 1.0 - gain
    share = row[RR] / (row[RR] + spread)
    row[R] += share * (radius - row[R])
    row[RR] = max((1.0 - share) * row[RR], 1e-4)
    looks = 1.0 if spread >= UNKNOWN and row[R] < LEGS_RADIUS else 0.0
    row[LEGS] += _NEWEST * (looks - row[LEGS])
    row[HIDDEN] = 0.0
    row[SEEN] += 1.0
