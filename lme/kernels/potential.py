"""Repulsion of an artificial potential field (Khatib 1986) from scan points."""

import math

import numpy as np
from numba import njit

from lme.types import Floats


@njit(cache=True, error_model="numpy")
def repulsion(
    points: Floats, radius: float, influence: float, closest: float, spread: float
) -> tuple[float, float]:
    """Force of the scan points on a disc for a gain η of 1, in the robot frame [1/m³]: (x, y).

    points (M, 2), radius of the disc [m]. A point at clearance ρ pushes straight away with the gradient of FIRAS
    (Khatib 1986), (1/ρ − 1/influence) / ρ². The force is 0 beyond `influence` [m] and constant below `closest` [m].
    A point's push is divided among the points within `spread` [rad] of its bearing, which count less if they are
    farther off or weaker. A post therefore counts as one obstacle, and a wall as one for every `spread` of its
    width, at any lidar resolution.
    """
    bearings, pushes, normals = _near(points, radius, influence, closest)
    crowds = _crowds(bearings, pushes, spread)
    along, across = 0.0, 0.0
    for i in range(len(pushes)):
        push = pushes[i] / crowds[i]
        along -= push * normals[i, 0]
        across -= push * normals[i, 1]
    return along, across


@njit(cache=True, error_model="numpy")
def _near(points, radius, influence, closest):
    """Bearings, pushes and directions of the points within the influence, sorted by bearing."""
    bearings, pushes = np.empty(len(points)), np.empty(len(points))
    normals = np.empty((len(points), 2))
    count = 0
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        away = max(math.sqrt(x * x + y * y), 1e-12)
        clearance = max(away - radius, closest)
        if clearance >= influence:
            continue
        normals[count, 0], normals[count, 1] = x / away, y / away
        bearings[count] = math.atan2(y, x)
        pushes[count] = (1.0 / clearance - 1.0 / influence) / (clearance * clearance)
        count += 1
    order = np.argsort(bearings[:count])
    return bearings[order], pushes[order], normals[order]


@njit(cache=True, error_model="numpy")
def _crowds(bearings, pushes, spread):
    """Weighted number of points that share each point's push, itself included; also across ±π."""
    n = len(bearings)
    crowds = np.ones(n)
    for i in range(n):
        for k in range(i + 1, i + n):
            j = k if k < n else k - n
            apart = bearings[j] - bearings[i] + (0.0 if k < n else 2.0 * math.pi)
            if apart >= spread:
                break
            near, ratio = 1.0 - apart / spread, pushes[j] / pushes[i]
            crowds[i] += near * min(1.0, ratio)
            crowds[j] += near * min(1.0, 1.0 / ratio)
    return crowds
