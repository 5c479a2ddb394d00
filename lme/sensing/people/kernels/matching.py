"""Gives scan points to tracks, and corrects the tracks by them."""

import math

import numpy as np
from numba import njit

from lme.sensing.people.kernels.clusters import FEWEST
from lme.sensing.people.kernels.middle import LEGS_RADIUS, middle_of
from lme.sensing.people.kernels.scans import beam_towards, into
from lme.sensing.people.kernels.table import CONFIRMED, LEGS, PP, RR, R, X, Y, correct

_REACH = 0.1  # [m] beyond its radius that a point may be of a track, besides the uncertainty
_ON_CIRCLE = 0.1  # [m] from the circle of a track that a point may be that has moved; half of it for others
_FASTEST_TURN = 3.0  # [m/s] change of velocity of who turns round
_SLACK = 0.1  # [m] a beam that ends this much before a track hides it


@njit(cache=True, error_model="numpy")
def claims(table, count, sight, settings):
    """The row of the confirmed track of each point; −1: of none. What stood there before is of none."""
    points, hits, moved, stands = sight.points, sight.hits, sight.moved, sight.stands
    owner, score = np.full(len(points), -1, np.int64), np.full(len(points), math.inf)
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] == 0.0:
            continue
        unsure = min(2.0 * math.sqrt(row[PP]), 0.3)
        reach = max(row[R] + _REACH + unsure, settings.joint if row[R] < LEGS_RADIUS else 0.0)
        for i in range(len(points)):
            dx, dy = points[i, 0] - row[X], points[i, 1] - row[Y]
            if not hits[i] or stands[i] or abs(dx) > reach or abs(dy) > reach:
                continue
            away = math.sqrt(dx * dx + dy * dy)
            off = abs(away - row[R])
            own = off < (_ON_CIRCLE if moved[i] else 0.5 * _ON_CIRCLE) + unsure
            worth = max(away - row[R], 0.0) + 0.3 * off
            if away < reach and own and worth < score[i]:
                owner[i], score[i] = n, worth
    return owner


@njit(cache=True, error_model="numpy")
def correct_confirmed(table, count, row_of, points, lidar, when, settings):
    """Correct each confirmed track by its points, unless they are too far from where it is expected."""
    noise, _, _, dt = when
    for n in range(count):
        row = table[n]
        if row[CONFIRMED] == 0.0:
            continue
        own = np.flatnonzero(row_of == n)
        if len(own) < FEWEST:
            continue
        found = middle_of(points, own, lidar, (row[R], row[RR] + 1e-4, row[LEGS]), noise, settings)
        away = math.sqrt((found[0] - row[X]) ** 2 + (found[1] - row[Y]) ** 2)
        if away < 3.0 * math.sqrt(row[PP] + found[3]) + _FASTEST_TURN * dt:
            correct(row, found)


@njit(cache=True, error_model="numpy")
def in_sight(table, lidar, points, hits, angles):
    """Which tracks (T,) the scan shows: the beam towards the middle does not end before the front."""
    shown = np.ones(len(table), np.bool_)
    cos, sin = math.cos(lidar[2]), math.sin(lidar[2])
    for n in range(len(table)):
        x, y = into(table[n, X], table[n, Y], lidar, cos, sin)
        beam = beam_towards(x, y, angles, len(points))
        if beam < 0:
            shown[n] = False
        elif hits[beam]:
            reach = math.sqrt(points[beam, 0] ** 2 + points[beam, 1] ** 2)
            shown[n] = reach > math.sqrt(x * x + y * y) - table[n, R] - _SLACK
    return shown
