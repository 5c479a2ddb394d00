"""The table of tracks: its columns, and the constant-velocity filter on a row.

A row is a track: something that moves or, while CONFIRMED is 0, something that may turn out to move. The covariance
is the same in every direction, and so in every frame: variances of position and velocity, and their covariance. LEGS
is the share of the scans in which a track looked like legs.
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
