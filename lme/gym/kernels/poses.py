"""Compiled twins of `lme.geometry.frames`, which give exactly the same results. A pose is (x, y, yaw)."""

import math

from numba import njit


@njit(cache=True, error_model="numpy")
def wrapped(angle):
    """Wrap an angle to (−π, π] [rad], as `wrap_angle` does."""
    size = abs(angle)
    part = size % math.tau
    complement = math.tau - part
    if part > complement or (part == complement and 0.5 * (size - part) % math.tau != 0.0):
        part = -complement
    part = math.copysign(1.0, angle) * part
    return math.pi if part <= -math.pi else part


@njit(cache=True, error_model="numpy")
def to_world(x, y, pose):
    """Transform a point from the frame at the pose to its parent frame."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + cos * x - sin * y, pose[1] + sin * x + cos * y


@njit(cache=True, error_model="numpy")
def to_robot(x, y, pose):
    """Transform a point from the parent frame to the frame at the pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    return cos * dx + sin * dy, cos * dy - sin * dx


@njit(cache=True, error_model="numpy")
def relative(pose, frame):
    """Transform a pose from the parent frame to the frame at `frame`."""
    x, y = to_robot(pose[0], pose[1], frame)
    return x, y, wrapped(pose[2] - frame[2])


@njit(cache=True, error_model="numpy")
def compose(pose, child):
    """Transform the pose `child` from the frame at `pose` to its parent frame."""
    x, y = to_world(child[0], child[1], pose)
    return x, y, wrapped(pose[2] + child[2])


@njit(cache=True, error_model="numpy")
def between(a, b, fraction):
    """Interpolate between two poses, turning the shorter way."""
    turn = wrapped(b[2] - a[2])
    x, y = a[0] + fraction * (b[0] - a[0]), a[1] + fraction * (b[1] - a[1])
    return x, y, wrapped(a[2] + fraction * turn)


@njit(cache=True, error_model="numpy")
def rolled(pose, distance, angle):
    """Return the pose after a turn [rad] and a distance [m], as `lme.simulation.substeps.rolled` does."""
    return compose(pose, (distance * math.cos(angle / 2), distance * math.sin(angle / 2), angle))
