"""Bubbles of free space along a path: their radii, the forces on them, insertion and deletion.

A bubble's radius is the distance that the robot's inner disc may move from its centre in any direction: the
distance to the nearest obstacle point minus the disc's radius, limited by a ceiling. It is negative if the disc
does not fit. Points are separate arrays x (M,) and y (M,), so that the search for the nearest one is vectorised.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.types import Bools, Floats

_ROUNDING = 1e-9  # [m] tolerance for rounding of distances
_OVERSHOOT = 0.75  # a step overshoots if the force reverses and keeps more than this share


@njit(cache=True, error_model="numpy", fastmath={"nnan", "ninf", "nsz", "reassoc"})
def _nearest_square(xs, ys, x, y):
    """Squared distance to the nearest point. Products are not fused, so the result is that of plain arithmetic."""
    min_square = 1e300
    for i in range(len(xs)):
        dx, dy = xs[i] - x, ys[i] - y
        min_square = min(min_square, dx * dx + dy * dy)
    return min_square


@njit(cache=True, error_model="numpy")
def _radius(x, y, space):
    """Radius of the bubble at (x, y)."""
    xs, ys, inner, ceiling = space
    return min(math.sqrt(_nearest_square(xs, ys, x, y)) - inner, ceiling)


@njit(cache=True, error_model="numpy")
def bubble_radii(centres: Floats, xs: Floats, ys: Floats, inner: float, ceiling: float) -> Floats:
    """Radii of the bubbles at the (N, 2) centres [m]: (N,); `inner` is the radius of the robot's disc [m]."""
    radii = np.empty(len(centres))
    for i in range(len(centres)):
        radii[i] = _radius(centres[i, 0], centres[i, 1], (xs, ys, inner, ceiling))
    return radii


@njit(cache=True, error_model="numpy")
def relax(
    centres: Floats,
    radii: Floats,
    xs: Floats,
    ys: Floats,
    shape: tuple[float, float, float],
    forces: tuple[float, float, float, float],
    rounds: tuple[int, int],
) -> None:
    """Move the bubbles by the forces of Quinlan & Khatib 1993, in place, except the first and the last.

    centres (N, 2) [m], radii (N,) [m]; shape: (radius of the inner disc, greatest radius, least spacing) [m];
    forces: (internal gain, external gain, radius below which obstacles repel [m], least effective force);
    rounds: (passes along the band, halvings of a step that overshoots).
    """
    inner, ceiling, spacing = shape
    space = (xs, ys, inner, ceiling)
    for _ in range(rounds[0]):
        for i in range(1, len(centres) - 1):
            # A bubble is moved in place, so the next one already feels its new position.
            previous = (centres[i - 1, 0], centres[i - 1, 1])
            following = (centres[i + 1, 0], centres[i + 1, 1])
            bubble = (centres[i, 0], centres[i, 1], radii[i])
            new_bubble = _move_bubble(previous, bubble, following, space, spacing, forces, rounds[1])
            centres[i, 0], centres[i, 1], radii[i] = new_bubble


@njit(cache=True, error_model="numpy")
def _move_bubble(previous, bubble, following, space, spacing, forces, halvings):
    """Move one bubble a step along its force, and halve the step while it overshoots."""
    # Direction across the band: normal to the line through both neighbours.
    tx, ty = following[0] - previous[0], following[1] - previous[1]
    length = math.sqrt(tx * tx + ty * ty)
    if length < 1e-9:
        return bubble
    normal = (-ty / length, tx / length)  # no force along the band: it would only bunch bubbles
    force = _force(previous, bubble, following, normal, space, spacing, forces)
    if abs(force) < forces[3]:
        return bubble
    # Step by half of the radius times the force, and by no more than the radius.
    reach = max(bubble[2], spacing)
    step = min(max(0.5 * reach * force, -reach), reach)
    for k in range(halvings + 1):
        x, y = bubble[0] + step * normal[0], bubble[1] + step * normal[1]
        new_bubble = (x, y, _radius(x, y, space))
        if k == halvings or step == 0.0:
            break
        # The step overshoots if the force there points back and is still strong.
        new_force = _force(previous, new_bubble, following, normal, space, spacing, forces)
        if new_force * force >= 0.0 or abs(new_force) <= _OVERSHOOT * abs(force):
            break
        step *= 0.5
    return new_bubble


@njit(cache=True, error_model="numpy")
def _force(previous, bubble, following, normal, space, spacing, forces):
    """Contraction and repulsion across the band, along `normal`.

    Contraction: the sum of the unit vectors to both neighbours. Repulsion: `influence` minus the radius, times
    the gradient of the radius, by central differences over one radius to either side.
    """
    internal, external, influence, _ = forces
    x, y, radius = bubble
    pull = _pull(x, y, previous, normal) + _pull(x, y, following, normal)
    if radius >= influence:
        return internal * pull
    # Repulsion: (influence − r) ∂r/∂n, with the derivative by central differences.
    h = max(radius, spacing)
    left = _radius(x + h * normal[0], y + h * normal[1], space)
    right = _radius(x - h * normal[0], y - h * normal[1], space)
    return internal * pull + external * (influence - radius) * (left - right) / (2.0 * h)


@njit(cache=True, error_model="numpy")
def _pull(x, y, neighbour, normal):
    """Component along the normal of the unit vector to a neighbour."""
    dx, dy = neighbour[0] - x, neighbour[1] - y
    return (dx * normal[0] + dy * normal[1]) / max(math.sqrt(dx * dx + dy * dy), 1e-9)


@njit(cache=True, error_model="numpy")
def mend(
    centres: Floats,
    radii: Floats,
    xs: Floats,
    ys: Floats,
    shape: tuple[float, float, float],
    joint: tuple[float, float],
    capacity: int,
) -> tuple[Floats, Floats, int]:
    """Delete redundant bubbles, and insert bubbles between neighbours that do not join.

    joint: (overlap, least radius [m]). Two bubbles larger than the least radius join if the distance of their
    centres is at most `overlap` times the sum of their radii. Bubbles are inserted half-way, down to the least
    spacing, at which any two bubbles larger than the least radius join; shape as in `relax`.
    Returns centres (K, 2), radii (K,), K ≤ max(N, capacity), and the length of the chain: the number of joined
    bubbles from the first one on.
    """
    space = (xs, ys, shape[0], shape[1])
    # Thin the band first, then fill the gaps that are left.
    sparse, sparse_radii = _without_redundant(centres, radii, joint)
    bubbles, chain = _filled(sparse, sparse_radii, space, shape[2], joint, max(len(sparse), capacity))
    return bubbles[:, :2].copy(), bubbles[:, 2].copy(), chain


@njit(cache=True, error_model="numpy")
def _filled(centres, radii, space, spacing, joint, size):
    """Return the band with inserted bubbles, rows of x, y, radius, and the length of its chain."""
    bubbles, waiting = np.empty((size, 3)), np.empty((size, 3))  # `waiting` is a stack
    top = len(centres)
    # Push the bubbles in reverse, so that the start of the band is on top.
    waiting[:top, :2], waiting[:top, 2] = centres[::-1], radii[::-1]
    count, chain, torn = 0, 0, False
    while top > 0:
        x, y, radius = waiting[top - 1]
        if count > 0:
            # Compare the top of the stack with the last bubble of the band.
            px, py, previous_radius = bubbles[count - 1]
            gap = math.sqrt((x - px) ** 2 + (y - py) ** 2)
            is_joined = _join(gap, previous_radius, radius, joint)
            is_near = gap <= spacing + _ROUNDING
            if not is_joined and not is_near and count + top < size:
                # The gap is too wide: push a bubble half-way, which is looked at next.
                mx, my = 0.5 * (x + px), 0.5 * (y + py)
                waiting[top, 0], waiting[top, 1], waiting[top, 2] = mx, my, _radius(mx, my, space)
                top += 1
                continue
            torn = torn or not (is_joined or (is_near and min(previous_radius, radius) > joint[1]))
        chain += not torn
        bubbles[count] = waiting[top - 1]
        count, top = count + 1, top - 1
    return bubbles[:count], chain


@njit(cache=True, error_model="numpy")
def _without_redundant(centres, radii, joint):
    """Keep both ends of the band, and the bubbles whose neighbours would not join without them."""
    sparse, sparse_radii = centres.copy(), radii.copy()
    count = 1
    for i in range(1, len(centres)):
        if i + 1 < len(centres):
            dx, dy = centres[i + 1, 0] - sparse[count - 1, 0], centres[i + 1, 1] - sparse[count - 1, 1]
            if _join(math.sqrt(dx * dx + dy * dy), sparse_radii[count - 1], radii[i + 1], joint):
                continue
        sparse[count, 0], sparse[count, 1], sparse_radii[count] = centres[i, 0], centres[i, 1], radii[i]
        count += 1
    return sparse[:count], sparse_radii[:count]


@njit(cache=True, error_model="numpy")
def _join(gap, radius, next_radius, joint):
    """Return whether two bubbles of these radii join at the distance `gap`."""
    return min(radius, next_radius) > joint[1] and gap <= joint[0] * (radius + next_radius)


@njit(cache=True, error_model="numpy")
def covered(points: Floats, centres: Floats, radii: Floats, tolerance: float) -> bool:
    """Return whether each of the (P, 2) points lies in some bubble, or within `tolerance` [m] of a centre."""
    for k in range(len(points)):
        inside = False
        for i in range(len(centres)):
            dx, dy = points[k, 0] - centres[i, 0], points[k, 1] - centres[i, 1]
            if dx * dx + dy * dy <= (max(radii[i], tolerance) + _ROUNDING) ** 2:
                inside = True
                break
        if not inside:
            return False
    return True


@njit(cache=True, error_model="numpy")
def hidden(
    points: Floats,
    ranges: NDArray[np.float32],
    angles: tuple[float, float],
    limits: tuple[float, float],
    slack: float,
) -> Bools:
    """Return whether the scan cannot see each of the (P, 2) points, in the lidar's frame: (P,).

    ranges (B,) [m], angles: (angle_min, angle_increment) [rad], limits: (range_min, range_max) [m]. A point is
    hidden if it is outside the field of view, more than `slack` [m] behind a return or beyond range_max, or if
    its beam's range is NaN or below range_min.
    """
    is_hidden = np.ones(len(points), np.bool_)
    beams_in_turn = 2.0 * math.pi / abs(angles[1])
    for k in range(len(points)):
        # Bearing in the direction of the scan, and the beam that covers it, modulo a full turn.
        offset = math.atan2(points[k, 1], points[k, 0]) - angles[0]
        if angles[1] < 0.0:
            offset = -offset
        beam_position = offset / abs(angles[1]) + 0.5  # in beams; the first beam covers 0 to 1
        beam = math.floor(beam_position - math.floor(beam_position / beams_in_turn) * beams_in_turn)
        if beam < len(ranges) and ranges[beam] >= limits[0]:
            # The beam reaches up to its return plus the slack, and at most to range_max.
            distance = math.sqrt(points[k, 0] ** 2 + points[k, 1] ** 2)
            is_hidden[k] = distance > min(ranges[beam] + slack, limits[1])
    return is_hidden
