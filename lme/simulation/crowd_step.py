"""The compiled step of the movers of one world, for a robot alone and for each robot of a fleet."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.simulation.walkers import PERIOD, new_velocities, traits_of
from lme.types import Bools, Floats, Ints
from lme.worlds.movers import ORCA, REPEATS, Mover
from lme.worlds.world import World

_BACK_AND_FORTH, _CYCLE = REPEATS.index("back_and_forth"), REPEATS.index("cycle")
TIME, _DECIDED, _X, _Y = range(4)  # of the clock


class Paths(NamedTuple):
    """Paths and shapes of M movers.

    rules (M, 6): `_rules`. legs (M, 2): first and last + 1 of a mover's rows in the waypoints (W, 4) of x, y, yaw and
    arrival time. spans (M, 2): when the mover is in the world [s]. discs (D,): which movers are discs, with their
    radii (D,) [m]. sides (E, 4): those of all polygons, in the frames of their owners (E,).
    """

    rules: Floats
    legs: Ints
    waypoints: Floats
    spans: Floats
    discs: Ints
    radii: Floats
    sides: Floats
    owners: Ints


class Pedestrians(NamedTuple):
    """The P movers that walk, and what they walk around.

    movers (P,): which ones. is_orca (P,); traits (P, 5): `lme.simulation.walkers`. legs (P, 2): first and last + 1 of
    a person's rows in the waypoints (V, 2). repeats (P,): indices into `REPEATS`. others (O,): movers that are discs
    and do not walk, with their radii (O,) [m]. circles (C, 3) and edges (S, 4): those of the world, which stand.
    """

    movers: Ints
    is_orca: Bools
    traits: Floats
    legs: Ints
    waypoints: Floats
    repeats: Ints
    others: Ints
    radii: Floats
    circles: Floats
    edges: Floats


class CrowdState(NamedTuple):
    """State of M movers, P of which walk; the compiled step changes it in place.

    progress (M,): seconds of motion along the path; has_begun (M,). poses (M, 3) and velocities (M, 2) in the world;
    is_present (M,). circles (D, 3) and edges (E, 4): all shapes at these poses. plans (P, 3) and walks (P, 2): next
    waypoints and velocities of the people. clock (4,): time, time of the people's last decision [s] (negative before
    the first), and where the people last saw the robot, x and y (NaN before the first step).
    """

    progress: Floats
    has_begun: Bools
    poses: Floats
    velocities: Floats
    is_present: Bools
    circles: Floats
    edges: Floats
    plans: Floats
    walks: Floats
    clock: Floats


def paths_of(movers: Sequence[Mover]) -> Paths:
    """Return the paths and shapes of movers."""
    timed = [_timed(mover) for mover in movers]
    spans = [(0.0, math.inf) if mover.times is None else mover.times[[0, -1]] for mover in movers]
    outlines = [(i, mover.outline) for i, mover in enumerate(movers) if mover.outline is not None]
    sides = [np.hstack([outline, np.roll(outline, -1, axis=0)]) for _, outline in outlines]
    discs = [(i, mover.radius) for i, mover in enumerate(movers) if mover.radius is not None]
    return Paths(
        rules=np.array([_rules(mover) for mover in movers], np.float64).reshape(-1, 6),
        legs=_ranges(map(len, timed)),
        waypoints=np.vstack([np.empty((0, 4)), *timed]),
        spans=np.array(spans, np.float64).reshape(-1, 2),
        discs=np.array([i for i, _ in discs], np.int64),
        radii=np.array([radius for _, radius in discs], np.float64),
        sides=np.vstack([np.empty((0, 4)), *sides]),
        owners=np.repeat([i for i, _ in outlines], [len(side) for side in sides]).astype(np.int64),
    )


def people_of(movers: Sequence[Mover], world: World) -> Pedestrians | None:
    """Return the movers that walk, around the walls of a world; None if none does."""
    walkers = [i for i, mover in enumerate(movers) if mover.walks]
    if not walkers:
        return None
    people = [movers[i] for i in walkers]
    others = [
        (i, mover.radius) for i, mover in enumerate(movers) if mover.radius is not None and not mover.walks
    ]
    return Pedestrians(
        movers=np.array(walkers, np.int64),
        is_orca=np.array([mover.motion == ORCA for mover in people]),
        traits=np.array([traits_of(mover) for mover in people]),
        legs=_ranges(len(mover.path) for mover in people),
        waypoints=np.vstack([mover.path[:, :2] for mover in people]),
        repeats=np.array([REPEATS.index(mover.repeat) for mover in people], np.int64),
        others=np.array([i for i, _ in others], np.int64),
        radii=np.array([radius for _, radius in others], np.float64),
        circles=np.ascontiguousarray(world.circles, dtype=np.float64),
        edges=np.ascontiguousarray(world.edges, dtype=np.float64),
    )


def state_at_start(movers: Sequence[Mover], paths: Paths, people: Pedestrians | None) -> CrowdState:
    """Return the state at the start of an episode, each mover at the start of its path."""
    count, num_people = len(movers), 0 if people is None else len(people.movers)
    state = CrowdState(
        progress=np.zeros(count),
        has_begun=np.zeros(count, np.bool_),
        poses=np.array([mover.path[0] for mover in movers], np.float64).reshape(-1, 3),
        velocities=np.zeros((count, 2)),
        is_present=np.ones(count, np.bool_),
        circles=np.column_stack([np.zeros((len(paths.radii), 2)), paths.radii]),
        edges=np.empty((len(paths.sides), 4)),
        plans=np.tile([0.0, 1.0, 0.0], (num_people, 1)),
        walks=np.zeros((num_people, 2)),
        clock=np.array([0.0, -1.0, math.nan, math.nan]),
    )
    place(paths, state)
    return state


def _ranges(lengths: Iterable[int]) -> Ints:
    """First and last + 1 of parts of these lengths, one after another: (N, 2)."""
    ends = np.cumsum(list(lengths), dtype=np.int64)
    return np.column_stack([ends - np.diff(ends, prepend=0), ends]).reshape(-1, 2)


def _timed(mover: Mover) -> Floats:
    """Waypoints with their arrival times: (P, 4). A cycle ends at its first waypoint."""
    if mover.times is not None:
        return np.column_stack([mover.path, mover.times - mover.times[0]])
    path = np.vstack([mover.path, mover.path[:1]]) if mover.repeat == "cycle" else mover.path
    legs = np.diff(path, axis=0)
    times = np.maximum(np.hypot(legs[:, 0], legs[:, 1]) / mover.speed, np.abs(legs[:, 2]) / mover.turn_rate)
    return np.column_stack([path, np.concatenate([[0.0], np.cumsum(times)])])


def _rules(mover: Mover) -> tuple[float, ...]:
    """Rules: start_after, starts_within, trigger x and y (NaN: the mover's own position), waits_within, repeat."""
    if mover.walks:
        return (math.inf, -1.0, math.nan, math.nan, -1.0, 0.0)  # `Pedestrians` move by themselves
    starts = math.inf if mover.starts_within is None else mover.starts_within
    waits = -1.0 if mover.waits_within is None else mover.waits_within
    trigger = mover.trigger or (math.nan, math.nan)
    start_after = mover.start_after if mover.times is None else float(mover.times[0])
    return (start_after, starts, *trigger, waits, REPEATS.index(mover.repeat))


@njit(cache=True, error_model="numpy")
def advance(
    paths: Paths, people: Pedestrians | None, state: CrowdState, robot: tuple[float, float, float], dt: float
) -> None:
    """Advance all movers by `dt` [s]. robot: x, y [m] of its base at the start of the step, and its radius [m].

    Without people, what they need is not compiled.
    """
    x, y, radius = robot
    time = state.clock[TIME]
    if people is not None:
        _decide(paths, people, state, x, y, radius, dt)
    _follow(paths, state, x, y, time, dt)
    if people is not None:
        for k in range(len(people.movers)):
            i = people.movers[k]
            for axis in range(2):
                state.poses[i, axis] += dt * state.walks[k, axis]
                state.velocities[i, axis] = state.walks[k, axis]
    state.clock[TIME] = time + dt
    place(paths, state)


@njit(cache=True, error_model="numpy")
def place(paths: Paths, state: CrowdState) -> None:
    """Move the shapes to the current poses, and find out who is present."""
    time = state.clock[TIME]
    for i in range(len(paths.spans)):
        state.is_present[i] = paths.spans[i, 0] <= time <= paths.spans[i, 1]
    for k in range(len(paths.discs)):
        i = paths.discs[k]
        state.circles[k, 0], state.circles[k, 1] = state.poses[i, 0], state.poses[i, 1]
    # The sides of the polygons, from their movers' frames to the world.
    for k in range(len(paths.sides)):
        i = paths.owners[k]
        x, y, yaw = state.poses[i, 0], state.poses[i, 1], state.poses[i, 2]
        cos, sin = math.cos(yaw), math.sin(yaw)
        for end in (0, 2):
            state.edges[k, end] = x + cos * paths.sides[k, end] - sin * paths.sides[k, end + 1]
            state.edges[k, end + 1] = y + sin * paths.sides[k, end] + cos * paths.sides[k, end + 1]


@njit(cache=True, error_model="numpy")
def present_circles(paths: Paths, state: CrowdState) -> Floats:
    """Discs (C, 3) of the movers that are present."""
    circles = np.empty_like(state.circles)
    count = 0
    for k in range(len(paths.discs)):
        if state.is_present[paths.discs[k]]:
            circles[count] = state.circles[k]
            count += 1
    return circles[:count]


@njit(cache=True, error_model="numpy")
def present_velocities(paths: Paths, state: CrowdState) -> Floats:
    """Velocities (C, 2) of the discs that are present, in the order of `present_circles` [m/s]."""
    velocities = np.empty((len(paths.discs), 2))
    count = 0
    for k in range(len(paths.discs)):
        if state.is_present[paths.discs[k]]:
            velocities[count] = state.velocities[paths.discs[k]]
            count += 1
    return velocities[:count]


@njit(cache=True, error_model="numpy")
def _decide(paths, people, state, x, y, radius, dt):
    """Let the people choose new velocities, every `PERIOD`."""
    time, decided = state.clock[TIME], state.clock[_DECIDED]
    # The robot's velocity is that of the last step.
    before_x = x if math.isnan(state.clock[_X]) else state.clock[_X]
    before_y = y if math.isnan(state.clock[_Y]) else state.clock[_Y]
    state.clock[_X], state.clock[_Y] = x, y
    if decided >= 0.0 and time - decided < PERIOD - 1e-9:
        return
    elapsed = time - decided if decided >= 0.0 else 0.0
    state.clock[_DECIDED] = time
    # First the robot, then the other discs that move and are present.
    discs = np.empty((1 + len(people.others), 5))
    discs[0, 0], discs[0, 1], discs[0, 4] = x, y, radius
    discs[0, 2], discs[0, 3] = (x - before_x) / dt, (y - before_y) / dt
    count = 1
    for k in range(len(people.others)):
        i = people.others[k]
        if state.is_present[i]:
            discs[count, :2], discs[count, 2:4] = state.poses[i, :2], state.velocities[i]
            discs[count, 4] = people.radii[k]
            count += 1
    # Walls, and the polygons that move.
    num_walls = len(people.edges)
    edges = np.empty((num_walls + len(state.edges), 4))
    edges[:num_walls], edges[num_walls:] = people.edges, state.edges
    positions = np.empty((len(people.movers), 2))
    for k in range(len(people.movers)):
        positions[k] = state.poses[people.movers[k], :2]
    where = (people.circles, edges, discs[:count])
    how = (people.is_orca, people.traits, people.waypoints, people.legs, people.repeats)
    state.walks[:] = new_velocities(positions, state.walks, state.plans, how, where, time, elapsed)


@njit(cache=True, error_model="numpy")
def _follow(paths, state, x, y, time, dt):
    """Advance every mover with a path of its own by one step, with the robot at (x, y)."""
    poses, velocities = state.poses, state.velocities
    for i in range(len(paths.rules)):
        start_after, starts_within, trigger_x, trigger_y, waits_within, repeat = paths.rules[i]
        path = paths.waypoints[paths.legs[i, 0] : paths.legs[i, 1]]
        elapsed = dt
        # A mover begins after its start time, once the robot is near its trigger; then it gets the rest of the step.
        if not state.has_begun[i]:
            near_x = poses[i, 0] if math.isnan(trigger_x) else trigger_x
            near_y = poses[i, 1] if math.isnan(trigger_y) else trigger_y
            elapsed = min(dt, time + dt - start_after)
            state.has_begun[i] = elapsed > 0.0 and math.hypot(x - near_x, y - near_y) <= starts_within
        if not state.has_begun[i]:
            continue
        # It waits, without progress, while the robot is close ahead of it.
        dx, dy = x - poses[i, 0], y - poses[i, 1]
        if math.hypot(dx, dy) > waits_within or not _is_ahead(path, state.progress[i], repeat, dx, dy):
            state.progress[i] += elapsed
        # Interpolate the pose on the leg; the velocity is the difference quotient over the step.
        leg, part, _ = _leg(path, state.progress[i], repeat)
        next_point = min(leg + 1, len(path) - 1)
        before_x, before_y = poses[i, 0], poses[i, 1]
        for axis in range(3):
            poses[i, axis] = path[leg, axis] + part * (path[next_point, axis] - path[leg, axis])
        velocities[i, 0], velocities[i, 1] = (poses[i, 0] - before_x) / dt, (poses[i, 1] - before_y) / dt


@njit(cache=True, error_model="numpy")
def _is_ahead(path, progress, repeat, dx, dy):
    """Return whether (dx, dy) from the mover is ahead of it; every point is while it turns on the spot."""
    leg, _, sign = _leg(path, progress, repeat)
    next_point = min(leg + 1, len(path) - 1)
    along_x, along_y = path[next_point, 0] - path[leg, 0], path[next_point, 1] - path[leg, 1]
    return sign * (along_x * dx + along_y * dy) >= 0.0


@njit(cache=True, error_model="numpy")
def _leg(path, progress, repeat):
    """Leg of the path after `progress` seconds of motion, share of the leg done, and direction (±1) along the path."""
    run = path[-1, 3]
    sign = 1.0
    # Fold the time into one cycle, or into one way there and back.
    if run > 0.0 and repeat == _CYCLE:
        progress = progress % run
    elif run > 0.0 and repeat == _BACK_AND_FORTH:
        progress = progress % (2.0 * run)
        if progress >= run:
            progress, sign = 2.0 * run - progress, -1.0
    # Find the leg by the arrival times, and the share of it that is done.
    leg = 0
    while leg < len(path) - 2 and progress >= path[leg + 1, 3]:
        leg += 1
    next_point = min(leg + 1, len(path) - 1)
    length = path[next_point, 3] - path[leg, 3]
    part = min((progress - path[leg, 3]) / length, 1.0) if length > 0.0 else 1.0
    return leg, part, sign
