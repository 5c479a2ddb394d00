"""The side of a robot's outline that is nearest to an obstacle."""

from __future__ import annotations

import math

import numpy as np

from lme.types import Floats, Pose

SIDES = ("front", "front left", "left", "rear left", "rear", "rear right", "right", "front right")
_SAME_M = 1e-3  # [m] points that are this much farther than the nearest one touch, too


def contact_side(pose: Pose, box: tuple[float, float, float], circles: Floats, edges: Floats) -> str:
    """Return which of `SIDES` is nearest to an obstacle; empty if there is no obstacle.

    pose: of the robot. box (half_length, half_width, rounding) [m]; circles (C, 3) solid [x, y, r]; edges (E, 4) thin
    [x0, y0, x1, y1]. Corners lie at 45° of the outline scaled to a square, and each side takes 22.5° to both sides.
    """
    half = np.array([box[0] + box[2], box[1] + box[2]])
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    turned = np.array([[cos, -sin], [sin, cos]])
    position = np.array(pose[:2])
    # Points that may be the nearest: centres of circles, ends of edges, and feet of the box's corners on the edges.
    centres, ends = (circles[:, :2] - position) @ turned, (edges.reshape(-1, 2, 2) - position) @ turned
    start, along = ends[:, :1], ends[:, 1:] - ends[:, :1]
    corners = half * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    length_squares = np.maximum((along**2).sum(axis=2, keepdims=True), 1e-12)
    shares = ((corners - start) * along).sum(axis=2, keepdims=True) / length_squares
    feet = start + np.clip(shares, 0.0, 1.0) * along
    points = np.concatenate([centres, ends.reshape(-1, 2), feet.reshape(-1, 2)])
    if not len(points):
        return ""
    # Distance of each from the box, and the mean of the nearest points of the box.
    on_box = np.clip(points, -half, half)
    distances = np.hypot(*(points - on_box).T)
    distances[: len(circles)] -= circles[:, 2]
    touch = on_box[distances <= distances.min() + _SAME_M].mean(axis=0) / half
    return SIDES[round(math.atan2(touch[1], touch[0]) / (math.pi / 4)) % 8]
