"""People of a world: their destinations, and the velocities that a model of walking makes of them.

Nothing here is random: the people and their paths are drawn together with the world. The models are ORCA and the
social force of Moussaïd et al. Both take people's places (P, 2) [m] and velocities (P, 2) [m/s], wanted velocities
(P, 2) [m/s], traits (P, 5) of radius [m], wanted and greatest speed [m/s], whether they see the robot, and when they
start [s]; others (1 + O, 5) of x, y, vx, vy, radius: the robot and other moving discs; circles (C, 3) and edges (E, 4),
which are static; dt [s] to the next decision. They return the new velocities (P, 2) [m/s].
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lme.geometry.orca import before_point, beside_disc, best_velocity
from lme.types import Floats, Ints
from lme.worlds.movers import REPEATS, Mover

PERIOD = 0.1  # [s] between two decisions of a person
HASTE = 1.3  # greatest speed of a person, relative to the wanted one (Helbing & Molnár 1995)

_RADIUS, _SPEED, _FASTEST, _SEES_ROBOT, _STARTS = range(5)  # of the traits
# Of a plan: the next waypoint, the direction along the path, seconds without progress.
_LEG, _SIGN, _STUCK = range(3)
_BACK_AND_FORTH, _CYCLE = REPEATS.index("back_and_forth"), REPEATS.index("cycle")

_REACHED = 0.3  # [m] from a waypoint
_ARRIVAL = 1.0  # [s] within which a person comes to rest at the last waypoint
_PATIENCE = 5.0  # [s] ASSUMED: a person without progress for this long turns round
_CRAWL = 0.1  # [m/s] slower motion is no progress

_HORIZON = 3.0  # [s] ASSUMED: how far ahead people foresee encounters
_GAP = 0.1  # [m] ASSUMED: gap that people leave between bodies; without it ORCA lets them pass in contact
_WALL_HORIZON = 0.5  # [s] ASSUMED: they come near walls at most by their clearance in this time
_NEIGHBOURS = 10.0  # [m] people farther away do not count

_RELAXATION = 0.54  # [s] this and the next constants: Moussaïd et al. 2009
_STRENGTH, _GAMMA, _N, _N_TURN, _LAMBDA = 4.5, 0.35, 2.0, 3.0, 2.0  # A [m/s²], γ, n, n′, λ
_WALL_STRENGTH, _WALL_REACH = 3.0, 0.1  # a [m/s²], b [m]


def traits_of(person: Mover) -> tuple[float, ...]:
    """Return the traits (5,) of a person."""
    assert person.radius is not None
    return person.radius, person.speed, HASTE * person.speed, person.sees_robot, person.start_after


@njit(cache=True, error_model="numpy")
def new_velocities(positions, velocities, plans, how, where, time, elapsed):
    """New velocities (P, 2) [m/s] of people, whose plans (P, 3) are brought up to date.

    how: whether each follows ORCA (P,), traits (P, 5), waypoints (V, 2), legs (P, 2) and repeats (P,). where: circles
    (C, 3), edges (E, 4) and others (1 + O, 5). elapsed: since the last decision [s].
    """
    is_orca, traits, waypoints, legs, repeats = how
    circles, edges, others = where
    preferred = next_waypoints(positions, velocities, traits, waypoints, legs, repeats, plans, time, elapsed)
    # Both models run only if both are in use.
    chosen = np.empty_like(velocities)
    if is_orca.any():
        chosen = orca(positions, velocities, preferred, traits, others, circles, edges, PERIOD)
    if not is_orca.all():
        forced = social_force(positions, velocities, preferred, traits, others, circles, edges, PERIOD)
        for i in range(len(is_orca)):
            if not is_orca[i]:
                chosen[i] = forced[i]
    return chosen


@njit(cache=True, error_model="numpy")
def next_waypoints(
    positions: Floats,
    velocities: Floats,
    traits: Floats,
    waypoints: Floats,
    legs: Ints,
    repeats: Ints,
    plans: Floats,
    time: float,
    elapsed: float,
) -> Floats:
    """Advance the plans (P, 3) in place and return the wanted velocities (P, 2) [m/s].

    waypoints (W, 2): those of all people; those of person i are the rows from legs[i, 0] to
    legs[i, 1] − 1. elapsed: since the last call [s].
    A person who makes no progress for `_PATIENCE` turns round, so that two people in a narrow passage do not block
    each other for ever.
    """
    preferred = np.zeros_like(positions)
    for i in range(len(positions)):
        path, plan = waypoints[legs[i, 0] : legs[i, 1]], plans[i]
        if time < traits[i, _STARTS]:
            continue
        # Count the time without progress, other than at the end of the path, and turn round after `_PATIENCE`.
        is_slow = math.hypot(velocities[i, 0], velocities[i, 1]) < _CRAWL
        is_last = _is_last(plan, len(path), repeats[i])
        distance = _distance(positions[i], path[int(plan[_LEG])])
        plan[_STUCK] = plan[_STUCK] + elapsed if is_slow and not (is_last and distance < _REACHED) else 0.0
        if plan[_STUCK] > _PATIENCE and len(path) > 1:
            plan[_SIGN], plan[_STUCK] = -plan[_SIGN], 0.0
            _advance(plan, len(path), repeats[i])
        # Skip the waypoints that have been reached.
        for _ in range(len(path)):
            if (
                _is_last(plan, len(path), repeats[i])
                or _distance(positions[i], path[int(plan[_LEG])]) > _REACHED
            ):
                break
            _advance(plan, len(path), repeats[i])
        # Walk straight to the next waypoint, and slow down before the last one.
        target = path[int(plan[_LEG])]
        distance = _distance(positions[i], target)
        speed = traits[i, _SPEED]
        if _is_last(plan, len(path), repeats[i]):
            speed = min(speed, distance / _ARRIVAL)
        if distance > 0.0:
            preferred[i, 0] = speed * (target[0] - positions[i, 0]) / distance
            preferred[i, 1] = speed * (target[1] - positions[i, 1]) / distance
    return preferred


@njit(cache=True, error_model="numpy")
def _is_last(plan, count, repeat):
    """Return whether the person stays at the next waypoint."""
    return count == 1 or (repeat != _BACK_AND_FORTH and repeat != _CYCLE and plan[_LEG] == count - 1)


@njit(cache=True, error_model="numpy")
def _advance(plan, count, repeat):
    """Choose the waypoint after the next one."""
    leg = plan[_LEG] + plan[_SIGN]
    if repeat == _CYCLE:
        leg = leg % count
    elif leg < 0.0 or leg >= count:
        plan[_SIGN] = -plan[_SIGN]
        leg = min(max(leg + 2.0 * plan[_SIGN], 0.0), count - 1.0)
    plan[_LEG] = leg


@njit(cache=True, error_model="numpy")
def _distance(position, target):
    return math.hypot(target[0] - position[0], target[1] - position[1])


@njit(cache=True, error_model="numpy")
def orca(
    positions: Floats,
    velocities: Floats,
    preferred: Floats,
    traits: Floats,
    discs: Floats,
    circles: Floats,
    edges: Floats,
    dt: float,
) -> Floats:
    """Optimal reciprocal collision avoidance (van den Berg et al. 2011): each does half of every evasion."""
    new_velocities = np.empty_like(velocities)
    people, count = len(positions), len(discs)
    lines = np.empty((len(circles) + len(edges) + people + count, 4))
    for i in range(people):
        radius, fastest = traits[i, _RADIUS], traits[i, _FASTEST]
        # Walls give hard half-planes, which come first in `lines`.
        hard = _walls(positions[i], radius, fastest, circles, edges, _WALL_HORIZON, lines)
        size = hard
        # People, the robot if this person sees it, and other discs give soft half-planes.
        for j in range(people):
            relative = positions[j] - positions[i]
            if j != i and math.hypot(relative[0], relative[1]) <= _NEIGHBOURS:
                reach = radius + traits[j, _RADIUS] + _GAP
                beside_disc(relative, velocities[i], velocities[j], reach, _HORIZON, dt, 0.5, lines[size])
                size += 1
        for j in range(count):
            relative = discs[j, :2] - positions[i]
            if (j > 0 or traits[i, _SEES_ROBOT] > 0.0) and math.hypot(
                relative[0], relative[1]
            ) <= _NEIGHBOURS:
                reach = radius + discs[j, 4] + _GAP
                beside_disc(relative, velocities[i], discs[j, 2:4], reach, _HORIZON, dt, 0.5, lines[size])
                size += 1
        # The velocity in all half-planes that is nearest to the wanted one.
        vx, vy = best_velocity(lines[:size], hard, fastest, (preferred[i, 0], preferred[i, 1]))
        new_velocities[i, 0], new_velocities[i, 1] = vx, vy
    return new_velocities


@njit(cache=True, error_model="numpy")
def social_force(
    positions: Floats,
    velocities: Floats,
    preferred: Floats,
    traits: Floats,
    discs: Floats,
    circles: Floats,
    edges: Floats,
    dt: float,
) -> Floats:
    """The social force model (Helbing & Molnár 1995, DOI 10.1103/PhysRevE.51.4282), with the interaction that Moussaïd
    et al. measured (2009, DOI 10.1098/rspb.2009.0405). Walls are never entered, whatever the forces.
    """
    new_velocities = np.empty_like(velocities)
    people = len(positions)
    lines = np.empty((len(circles) + len(edges), 4))
    for i in range(people):
        # Relaxation towards the preferred velocity: (v_preferred − v) / τ.
        fx = (preferred[i, 0] - velocities[i, 0]) / _RELAXATION
        fy = (preferred[i, 1] - velocities[i, 1]) / _RELAXATION
        for j in range(people):
            if j != i:
                push_x, push_y = _interaction(positions[j] - positions[i], velocities[i] - velocities[j])
                fx, fy = fx + push_x, fy + push_y
        for j in range(len(discs)):
            if j > 0 or traits[i, _SEES_ROBOT] > 0.0:
                push_x, push_y = _interaction(discs[j, :2] - positions[i], velocities[i] - discs[j, 2:4])
                fx, fy = fx + push_x, fy + push_y
        radius, fastest = traits[i, _RADIUS], traits[i, _FASTEST]
        # Repulsion by the nearest wall: a exp(−(d − r) / b), straight away from it.
        x, y = _nearest_wall(positions[i], circles, edges)
        distance = math.hypot(x, y)
        if 0.0 < distance < math.inf:
            push = _WALL_STRENGTH * math.exp(-(distance - radius) / _WALL_REACH)
            fx, fy = fx - push * x / distance, fy - push * y / distance
        # One Euler step, then the nearest velocity that enters no wall.
        hard = _walls(positions[i], radius, fastest, circles, edges, dt, lines)
        accelerated = (velocities[i, 0] + dt * fx, velocities[i, 1] + dt * fy)
        vx, vy = best_velocity(lines[:hard], hard, fastest, accelerated)
        new_velocities[i, 0], new_velocities[i, 1] = vx, vy
    return new_velocities


@njit(cache=True, error_model="numpy")
def _interaction(relative, velocity):
    """Acceleration (x, y) [m/s²] by a person at `relative` [m]; velocity: one's own relative to theirs [m/s]."""
    distance = math.hypot(relative[0], relative[1])
    if distance == 0.0 or distance > _NEIGHBOURS:
        return 0.0, 0.0
    # Direction of interaction: t = D / |D| with D = λ Δv + e, e towards the person.
    ex, ey = relative[0] / distance, relative[1] / distance
    along_x, along_y = _LAMBDA * velocity[0] + ex, _LAMBDA * velocity[1] + ey
    length = math.hypot(along_x, along_y)
    if length == 0.0:
        return 0.0, 0.0
    tx, ty = along_x / length, along_y / length
    # Angle from the direction of interaction to the person.
    theta = math.atan2(tx * ey - ty * ex, tx * ex + ty * ey)
    # Deceleration along t and evasion across it: A exp(−d / B − (n B θ)²) with B = γ |D|.
    reach = _GAMMA * length
    slowing = _STRENGTH * math.exp(-distance / reach - (_N_TURN * reach * theta) ** 2)
    sideways = _STRENGTH * math.exp(-distance / reach - (_N * reach * theta) ** 2)
    side = 1.0 if theta >= 0.0 else -1.0  # away from the person; straight ahead, to the right
    return -slowing * tx + side * sideways * ty, -slowing * ty - side * sideways * tx


@njit(cache=True, error_model="numpy")
def _walls(position, radius, fastest, circles, edges, horizon, lines):
    """Write a half-plane for each static obstacle in reach; return their number."""
    count, reach = 0, radius + fastest * horizon
    # Circles first, then edges, each by its nearest point.
    for k in range(len(circles)):
        x, y = _to_circle(position, circles[k])
        if math.hypot(x, y) <= reach:
            before_point(x, y, radius, horizon, lines[count])
            count += 1
    for k in range(len(edges)):
        x, y = _to_edge(position, edges[k])
        if math.hypot(x, y) <= reach:
            before_point(x, y, radius, horizon, lines[count])
            count += 1
    return count


@njit(cache=True, error_model="numpy")
def _nearest_wall(position, circles, edges):
    """Nearest point of all static obstacles, relative to a position: (x, y) [m], infinite if there is none."""
    best_x, best_y = math.inf, math.inf
    for k in range(len(circles)):
        x, y = _to_circle(position, circles[k])
        if math.hypot(x, y) < math.hypot(best_x, best_y):
            best_x, best_y = x, y
    for k in range(len(edges)):
        x, y = _to_edge(position, edges[k])
        if math.hypot(x, y) < math.hypot(best_x, best_y):
            best_x, best_y = x, y
    return best_x, best_y


@njit(cache=True, error_model="numpy")
def _to_circle(position, circle):
    """Nearest point of a disc, relative to a place outside it: (x, y) [m]."""
    dx, dy = circle[0] - position[0], circle[1] - position[1]
    distance = math.hypot(dx, dy)
    fraction = max(distance - circle[2], 0.0) / distance if distance > 0.0 else 0.0
    return fraction * dx, fraction * dy


@njit(cache=True, error_model="numpy")
def _to_edge(position, edge):
    """Nearest point of a segment, relative to a position: (x, y) [m]."""
    ax, ay = edge[2] - edge[0], edge[3] - edge[1]
    square = ax * ax + ay * ay
    fraction = ((position[0] - edge[0]) * ax + (position[1] - edge[1]) * ay) / square if square > 0.0 else 0.0
    fraction = min(max(fraction, 0.0), 1.0)
    return edge[0] + fraction * ax - position[0], edge[1] + fraction * ay - position[1]
