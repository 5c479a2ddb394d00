"""Motion of pedestrians and doors: the poses of all movers of a world over time, and those whom the lidar sees.

Scripted and recorded movers follow their paths; people walk according to `lme.simulation.walkers`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.simulation.walkers import HASTE, Walkers
from lme.types import Floats, LaserScan, Pose
from lme.worlds.movers import REPEATS, Mover
from lme.worlds.world import World

_BACK_AND_FORTH = REPEATS.index("back_and_forth")
_CYCLE = REPEATS.index("cycle")
_SLACK = 0.1  # [m] a beam that ends this much before a person is hidden from it; more than a lidar's noise


class Crowd:
    """All movers of a world, each at the start of its path until `advance` is called.

    poses: (M, 3) of the movers, in the world. present: (M,) whether they are in the world; only recorded movers come
    and go. circles: (C, 3) discs that are present; edges: (E, 4) sides of polygons, both as in `World` and in the
    order of the movers. top_speed: the greatest speed of any point of a mover [m/s]. velocities: (M, 2) of the
    movers' origins in the last step, in the world [m/s].
    """

    def __init__(
        self, movers: Sequence[Mover], world: World | None = None, robot_radius: float = 0.0
    ) -> None:
        """world: people walk around its walls. robot_radius: of the disc that represents the robot [m]."""
        self._movers = tuple(movers)
        self._discs = np.array(
            [i for i, mover in enumerate(movers) if mover.radius is not None], dtype=np.int64
        )
        self._pack_paths(movers)
        self._pack_outlines(movers)
        self.top_speed = max(map(_top_speed, movers), default=0.0)
        self._time = 0.0
        self._progress = np.zeros(len(movers))
        self._begun = np.zeros(len(movers), dtype=np.bool_)
        self.poses = np.array([mover.path[0] for mover in movers]).reshape(-1, 3)
        self.velocities = np.zeros((len(movers), 2))
        spans = [(0.0, math.inf) if mover.times is None else mover.times[[0, -1]] for mover in movers]
        self._spans = np.array(spans).reshape(-1, 2)
        self._come_and_go = any(mover.times is not None for mover in movers)
        self.present = np.ones(len(movers), dtype=np.bool_)
        self._every_circle = np.empty((len(self._discs), 3))
        self._every_circle[:, 2] = [movers[i].radius for i in self._discs]
        self.edges = np.empty((len(self._owner), 4))
        walkers = [i for i, mover in enumerate(movers) if mover.walks]
        self._walkers = Walkers(movers, walkers, world or World(), robot_radius) if walkers else None
        self._place()

    def __len__(self) -> int:
        return len(self.poses)

    def among(self, circles: Floats, edges: Floats) -> tuple[Floats, Floats]:
        """Return static circles (C, 3) and edges (E, 4), followed by those of the movers at their current poses."""
        if not len(self):
            return circles, edges
        return np.vstack([circles, self.circles]), np.vstack([edges, self.edges])

    @property
    def people(self) -> tuple[Floats, Floats]:
        """Discs (C, 3) and their velocities (C, 2), in the order of `circles` [m, m/s]."""
        return self.circles, self.disc_velocities

    @property
    def disc_velocities(self) -> Floats:
        """Velocities (C, 2) of the discs, in the order of `circles` [m/s]."""
        return self._present_rows(self.velocities[self._discs])

    def advance(self, robot: Pose, dt: float) -> None:
        """Advance by `dt` [s]. Movers react to the pose of the robot's base at the start of the step."""
        if not len(self):
            return
        if self._walkers is not None:
            self._walkers.decide(self, robot, dt)
        state = (self._progress, self._begun, self.poses, self.velocities)
        _advance(self._rules, self._first, self._waypoints, state, robot[0], robot[1], self._time, dt)
        if self._walkers is not None:
            self._walkers.walk(self.poses, self.velocities, dt)
        self._time += dt
        self._place()

    def go_on(self, former: Crowd) -> None:
        """Continue from another crowd: take over its time, and the state of the movers that are in both."""
        self._time = former._time
        indices = {mover: i for i, mover in enumerate(former._movers)}
        pairs = [(i, indices[mover]) for i, mover in enumerate(self._movers) if mover in indices]
        for j, k in pairs:
            self._progress[j], self._begun[j] = former._progress[k], former._begun[k]
            self.poses[j], self.velocities[j] = former.poses[k], former.velocities[k]
        if self._walkers is not None and former._walkers is not None:
            self._walkers.go_on(former._walkers, dict(pairs))
        self._place()

    def _pack_paths(self, movers: Sequence[Mover]) -> None:
        """Store waypoints (W, 4) [x, y, yaw, arrival time] of all movers and their rules (M, 6)."""
        timed = [_timed(mover) for mover in movers]
        self._waypoints = np.vstack([np.empty((0, 4)), *timed])
        self._first = np.cumsum([0, *map(len, timed)])
        self._rules = np.array([_rules(mover) for mover in movers]).reshape(-1, 6)

    def _pack_outlines(self, movers: Sequence[Mover]) -> None:
        """Store the sides (E, 4) of all polygons in their movers' frames, and the movers' indices (E,)."""
        outlines = [(i, mover.outline) for i, mover in enumerate(movers) if mover.outline is not None]
        sides = [np.hstack([outline, np.roll(outline, -1, axis=0)]) for _, outline in outlines]
        self._sides = np.vstack([np.empty((0, 4)), *sides])
        self._owner = np.repeat([i for i, _ in outlines], [len(side) for side in sides]).astype(np.int64)

    def _place(self) -> None:
        """Move the shapes to the current poses."""
        self._every_circle[:, :2] = self.poses[self._discs, :2]
        if self._come_and_go:
            self.present = (self._spans[:, 0] <= self._time) & (self._time <= self._spans[:, 1])
        self.circles = self._present_rows(self._every_circle)
        _turn_sides(self._sides, self._owner, self.poses, self.edges)

    def _present_rows(self, rows: Floats) -> Floats:
        """Select from the rows, one for each disc, those of the discs that are present."""
        return rows[self.present[self._discs]] if self._come_and_go else rows


def _timed(mover: Mover) -> Floats:
    """Waypoints with their arrival times: (P, 4). A cycle ends at its first waypoint."""
    if mover.times is not None:
        return np.column_stack([mover.path, mover.times - mover.times[0]])
    path = np.vstack([mover.path, mover.path[:1]]) if mover.repeat == "cycle" else mover.path
    legs = np.diff(path, axis=0)
    times = np.maximum(np.hypot(legs[:, 0], legs[:, 1]) / mover.speed, np.abs(legs[:, 2]) / mover.turn_rate)
    return np.column_stack([path, np.concatenate([[0.0], np.cumsum(times)])])


def _top_speed(mover: Mover) -> float:
    """Greatest speed of any point of the mover [m/s]."""
    if mover.walks:
        return HASTE * mover.speed
    if mover.times is not None:
        return float((np.hypot(*np.diff(mover.path[:, :2], axis=0).T) / np.diff(mover.times)).max())
    turns = np.ptp(mover.path[:, 2]) > 0.0
    return mover.speed + (mover.turn_rate * mover.reach if turns else 0.0)


def _rules(mover: Mover) -> tuple[float, ...]:
    """Rules: start_after, starts_within, trigger x and y (NaN: the mover's own position), waits_within, repeat."""
    if mover.walks:
        return (math.inf, -1.0, math.nan, math.nan, -1.0, 0.0)  # `Walkers` moves them
    starts = math.inf if mover.starts_within is None else mover.starts_within
    waits = -1.0 if mover.waits_within is None else mover.waits_within
    trigger = mover.trigger or (math.nan, math.nan)
    start_after = mover.start_after if mover.times is None else float(mover.times[0])
    return (start_after, starts, *trigger, waits, REPEATS.index(mover.repeat))


@njit(cache=True, error_model="numpy")
def _advance(rules, first, waypoints, state, x, y, time, dt):
    """Advance every mover by one step, with the robot at (x, y).

    Updates progress (M,), has_begun (M,), poses (M, 3) and velocities (M, 2).
    """
    progress, has_begun, poses, velocities = state
    for i in range(len(rules)):
        start_after, starts_within, trigger_x, trigger_y, waits_within, repeat = rules[i]
        path = waypoints[first[i] : first[i + 1]]
        elapsed = dt
        # A mover begins after its start time, once the robot is near its trigger; then it gets the rest of the step.
        if not has_begun[i]:
            near_x = poses[i, 0] if math.isnan(trigger_x) else trigger_x
            near_y = poses[i, 1] if math.isnan(trigger_y) else trigger_y
            elapsed = min(dt, time + dt - start_after)
            has_begun[i] = elapsed > 0.0 and math.hypot(x - near_x, y - near_y) <= starts_within
        if not has_begun[i]:
            continue
        # It waits, without progress, while the robot is close ahead of it.
        dx, dy = x - poses[i, 0], y - poses[i, 1]
        if math.hypot(dx, dy) > waits_within or not _is_ahead(path, progress[i], repeat, dx, dy):
            progress[i] += elapsed
        # Interpolate the pose on the leg; the velocity is the difference quotient over the step.
        leg, part, _ = _leg(path, progress[i], repeat)
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


@njit(cache=True, error_model="numpy")
def _turn_sides(sides, owner, poses, edges):
    """Transform sides (E, 4) from their movers' frames to the world, into `edges` (E, 4)."""
    for i in range(len(sides)):
        x, y, yaw = poses[owner[i]]
        cos, sin = math.cos(yaw), math.sin(yaw)
        for end in (0, 2):
            edges[i, end] = x + cos * sides[i, end] - sin * sides[i, end + 1]
            edges[i, end + 1] = y + sin * sides[i, end] + cos * sides[i, end + 1]


def tracked(crowd: Crowd, scan: LaserScan, lidar: Pose, base: Pose) -> Floats:
    """Positions and velocities over ground of the people in sight, in the robot frame: (P, 4) [m, m/s].

    People are the crowd's discs; doors and other polygons are not tracked. lidar: where the scan was taken;
    base: the robot; both in the world. A person is in sight if the beam through their middle does not end before
    them. Positions and velocities are the true ones.
    """
    angles = (float(scan.angle_min), float(scan.angle_increment))
    limits = (float(scan.range_min), float(scan.range_max), _SLACK)
    poses = (lidar.x, lidar.y, lidar.yaw), (base.x, base.y, base.yaw)  # Numba takes a Pose for another type
    people: Floats = discs_in_sight(crowd.circles, crowd.disc_velocities, scan.ranges, angles, limits, *poses)
    return people


@njit(cache=True, error_model="numpy")
def discs_in_sight(
    discs: Floats,
    velocities: Floats,
    ranges: NDArray[np.float32],
    angles: tuple[float, float],
    limits: tuple[float, float, float],
    lidar: tuple[float, float, float],
    base: tuple[float, float, float],
) -> Floats:
    """Positions and velocities in the frame of `base` of the discs that the scan shows: (P, 4) [m, m/s].

    discs (C, 3) [x, y, r] and their velocities (C, 2), in the world; ranges (B,); angles: angle_min and a positive
    angle_increment [rad]; limits: range_min, range_max, slack [m]; lidar, base: poses in the world. A disc is in
    sight if it is within range_max and the beam nearest to its middle does not end more than the slack before it;
    a beam without a return hides nothing.
    """
    rows, count = np.empty((len(discs), 4)), 0
    cos, sin = math.cos(base[2]), math.sin(base[2])
    for i in range(len(discs)):
        dx, dy = discs[i, 0] - lidar[0], discs[i, 1] - lidar[1]
        # Distance to the near side of the disc, and the range of the beam towards its middle.
        surface = math.sqrt(dx * dx + dy * dy) - discs[i, 2]
        reach = _range_towards(math.atan2(dy, dx) - lidar[2], ranges, angles)
        hidden = limits[0] <= reach < surface - limits[2]
        if reach == -math.inf or hidden or surface >= limits[1]:
            continue
        # Rotate position and velocity into the frame of the base.
        x, y, vx, vy = discs[i, 0] - base[0], discs[i, 1] - base[1], velocities[i, 0], velocities[i, 1]
        rows[count, 0], rows[count, 1] = cos * x + sin * y, cos * y - sin * x
        rows[count, 2], rows[count, 3] = cos * vx + sin * vy, cos * vy - sin * vx
        count += 1
    visible: Floats = rows[:count].copy()
    return visible


@njit(cache=True, error_model="numpy")
def _range_towards(bearing: float, ranges: NDArray[np.float32], angles: tuple[float, float]) -> float:
    """Range of the beam nearest to a bearing in the lidar's frame [m]; −∞ outside the field of view."""
    beam = int(((bearing - angles[0] + 0.5 * angles[1]) % (2.0 * math.pi)) / angles[1])
    return float(ranges[beam]) if beam < len(ranges) else -math.inf
