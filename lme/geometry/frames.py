"""Planar geometry: wrapped angles, and transforms of points and poses between frames."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lme.types import Floats, Pose


def wrap_angle(angle: float) -> float:
    """Wrap an angle to (−π, π] [rad]; exact for any finite angle."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped <= -math.pi else wrapped


def to_world(points: Floats, pose: Pose) -> Floats:
    """Transform points (..., 2) [m] from the frame at `pose` to its parent frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = _coordinates(points)
    return _points(pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y)


def to_robot(points: Floats, pose: Pose) -> Floats:
    """Transform points (..., 2) [m] from the parent frame to the frame at `pose`; the inverse of `to_world`."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x, y = _coordinates(points)
    x, y = x - pose[0], y - pose[1]
    return _points(cos * x + sin * y, cos * y - sin * x)


def relative(pose: Pose, frame: Pose) -> Pose:
    """Transform a pose from the parent frame to the frame at `frame`; the inverse of `compose`."""
    dx, dy = pose[0] - frame[0], pose[1] - frame[1]
    cos, sin = math.cos(frame[2]), math.sin(frame[2])
    return Pose(cos * dx + sin * dy, cos * dy - sin * dx, wrap_angle(pose[2] - frame[2]))


def compose(pose: Pose, child: Pose) -> Pose:
    """Transform the pose `child` from the frame at `pose` to its parent frame; yaw in (−π, π] [rad]."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    x = pose[0] + cos * child[0] - sin * child[1]
    y = pose[1] + sin * child[0] + cos * child[1]
    return Pose(x, y, wrap_angle(pose[2] + child[2]))


def between(a: Pose, b: Pose, fraction: float) -> Pose:
    """Interpolate between the poses `a` (fraction 0) and `b` (fraction 1), turning the shorter way."""
    turn = wrap_angle(b.yaw - a.yaw)
    return Pose(
        a.x + fraction * (b.x - a.x), a.y + fraction * (b.y - a.y), wrap_angle(a.yaw + fraction * turn)
    )


def _coordinates(points: Floats) -> Any:
    """Split points (..., 2) into x and y; a single point into two numbers, which Python adds faster than NumPy."""
    return points.T if points.ndim > 1 else points.tolist()


def _points(x: Any, y: Any) -> Floats:
    """Join coordinates to points (..., 2)."""
    points = np.array((x, y))
    return points if points.ndim == 1 else np.ascontiguousarray(points.T)
