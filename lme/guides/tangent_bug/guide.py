"""TangentBug, which passes obstacles by the ends that a range sensor sees."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from lme.errors import require
from lme.geometry.frames import to_robot, to_world
from lme.guides.tangent_bug.kernels import (
    all_ends,
    breaks_before,
    directions,
    first_longer,
    first_on_way,
    free_ways,
    joined,
    sweep,
)
from lme.perception.scan_points import BlindArc
from lme.robots import Robot
from lme.types import Floats, Guidance, Observation

UNITS = directions(720)  # directions of the free distances: every half degree
_REMEMBERED = 5.0  # [m] farther points in the blind arc are forgotten
TOUCHING = 0.98  # greatest disc radius per distance of the point, so the robot is never inside a disc
GRAZING = 6.0  # slope (tan 80°) up to which range steps between beams belong to one wall


@dataclass(slots=True)
class TangentBugConfig:
    """Settings for a robot of finite size with an imperfect sensor."""

    margin: float
    keep: float
    leave_gain: float

    def __post_init__(self) -> None:
        require("margin", self.margin, above=0.0)
        require("keep", self.keep, at_least=0.0)
        require("leave_gain", self.leave_gain, at_least=0.0)


class Mode(StrEnum):
    """The three behaviours of TangentBug."""

    TOWARD = "toward"  # moves to the target with decreasing distance
    FOLLOW = "follow"  # follows the boundary of an obstacle out of a local minimum of the distance
    LEAVE = "leave"  # leaves the boundary for a place nearer to the target than any point of it


class Vertex(NamedTuple):
    """A vertex of the local tangent graph.

    place: (2,) in the robot frame [m], reachable in a straight line. point: (2,) the scan point that it passes.
    """

    place: Floats
    point: Floats


class TangentBug:
    """TangentBug (Kamon, Rimon & Rivlin 1998, IJRR 17(9), 934–953, DOI 10.1177/027836499801700903).

    Toward the target: the robot drives straight, or to the end of the blocking obstacle that gives the shortest
    path, as long as that end is nearer to the target than the robot has ever been. If neither end is, the robot
    is in a local minimum of the distance. It then follows the boundary to one side and records the boundary's
    least distance to the target. It leaves for the first free place in sight that is nearer than this distance.
    Once the robot itself is nearer, it moves toward the target again. An end is a break of the scan: the end of
    the obstacle, or the place where a nearer obstacle hides the rest. The robot passes an end at its radius.

    Guarantee: the robot reaches the target if a path exists. This holds for a point robot with exact motion,
    perfect odometry and a perfect omnidirectional sensor among static obstacles. If no path exists, the paper's
    robot stops after one loop; this one keeps circling, or stands still if it is enclosed.

    Our robots violate these assumptions. They have a size: obstacles are grown by the collision radius and
    `margin`, and narrower passages do not exist. Beams leave gaps: an opening seen at a grazing angle is missed
    until the robot is nearer. The blind arc contains what was seen there before. Sensors have errors and planners
    cut corners: the robot leaves a boundary only for a gain of `leave_gain`, and an end only for one of `keep`.
    """

    Config = TangentBugConfig

    def __init__(self, config: TangentBugConfig, robot: Robot) -> None:
        self._config = config
        self._r = robot.r
        self._mount = robot.lidar.mount
        self.reset(np.random.default_rng(0))

    def reset(self, rng: np.random.Generator) -> None:
        """Start a new episode; `rng` is not used."""
        self._blind = BlindArc(self._mount, _REMEMBERED)
        self._mode = Mode.TOWARD
        self._nearest = math.inf  # [m] least distance to the target so far, of the robot or the boundary
        self._side = 0  # +1: pass the obstacle's left end, with the obstacle on the right; −1: the right end
        self._followed_point = np.zeros(2)  # scan point on the followed boundary, in the odometry frame
        self._leave_position = np.zeros(2)  # destination in mode LEAVE, in the odometry frame

    def guide(self, observation: Observation) -> Guidance:
        """Return the next place of the local tangent graph; the robot's position if obstacles enclose it."""
        previous = self._mode, self._side
        # Sort the points by bearing about the lidar: about the base, the surfaces at an end would mix.
        points = self._blind.points(observation)
        x, y = to_robot(points, self._mount).T
        points = points[np.argsort(np.arctan2(y, x), kind="stable")]
        view = _View(points, observation, self._r, self._config.margin)
        act = {Mode.TOWARD: self._toward, Mode.FOLLOW: self._follow, Mode.LEAVE: self._leave}[self._mode]
        subgoal = act(view)
        switched = (self._mode, self._side) != previous
        return Guidance(np.zeros(2) if subgoal is None else subgoal, None, switched, subgoal is None)

    def _toward(self, view: _View) -> Floats | None:
        """Drive straight, or past an end of the blocking obstacle, while that comes nearer to the target."""
        self._nearest = min(self._nearest, view.distance)
        owner = view.blocking(view.target)
        if owner < 0:
            self._side = 0
            return view.target
        ends, min_distance = view.ends(owner)
        lengths = {side: self._length_over(view, end.place, side) for side, end in ends.items()}
        sides = [side for side, end in ends.items() if math.dist(end.place, view.target) < self._nearest]
        if sides:
            self._side = min(sides, key=lengths.__getitem__)
            return ends[self._side].place
        self._mode = Mode.FOLLOW
        self._side = min(lengths, key=lengths.__getitem__, default=view.side_of_target(owner))
        self._followed_point = to_world(view.points[owner], view.odometry)
        self._nearest = min(self._nearest, min_distance)
        return self._follow(view)

    def _length_over(self, view: _View, position: Floats, side: int) -> float:
        """Length of the path to the target by way of a position [m], minus `keep` on the previous side."""
        length = math.hypot(*position) + math.dist(position, view.target)
        return length - self._config.keep if side == self._side else length

    def _follow(self, view: _View) -> Floats | None:
        """Drive to the end of the visible boundary, unless a place nearer than the whole boundary is in sight."""
        position = view.nearest_place()
        if math.dist(position, view.target) < self._nearest - self._config.leave_gain:
            self._mode, self._leave_position = Mode.LEAVE, to_world(position, view.odometry)
            return position
        end, min_distance = view.next_end(to_robot(self._followed_point, view.odometry), self._side)
        self._nearest = min(self._nearest, view.distance, min_distance)
        if end is None:
            return None
        self._followed_point = to_world(end.point, view.odometry)
        return end.place

    def _leave(self, view: _View) -> Floats | None:
        """Drive to the chosen place until the robot itself is nearer to the target than the boundary."""
        position = to_robot(self._leave_position, view.odometry)
        if view.distance < self._nearest:
            self._mode = Mode.TOWARD
            return self._toward(view)
        if view.blocking(position, closely=True) >= 0:
            self._mode = Mode.FOLLOW
            return self._follow(view)
        return position


class _View:
    """The scan for a point robot: scan points grown to discs.

    A disc never contains the robot, nor the target if the robot fits there.
    """

    def __init__(self, points: Floats, observation: Observation, r: float, margin: float) -> None:
        self.points = points
        self.target = observation.target
        self.odometry = observation.odometry
        self.distance = math.hypot(*self.target)
        self._radius = r + margin
        distances = np.hypot(points[:, 0], points[:, 1])
        from_target = np.hypot(points[:, 0] - self.target[0], points[:, 1] - self.target[1])
        radii = np.minimum(self._radius, np.maximum(TOUCHING * from_target, r))
        self._radii = np.minimum(radii, TOUCHING * distances)
        self._reduced_radii = np.minimum(self._radii, r + margin / 2.0)
        self._free, self._owners = free_ways(points, self._radii, UNITS)
        slope = GRAZING * abs(observation.scan.angle_increment)
        self._breaks = breaks_before(points, 2.0 * self._radius, slope)
        self._profile = self._free, self._owners, self._breaks, slope
        self._jumps = self._free, self._owners, np.arange(len(points) + 1), slope  # a break after every point

    def blocking(self, position: Floats, closely: bool = False) -> int:
        """Index of the point that blocks the line to a position, −1 if none; closely: with half the margin."""
        return int(first_on_way(self.points, self._reduced_radii if closely else self._radii, position))

    def side_of_target(self, owner: int) -> int:
        """Side of the target relative to a point: +1 left, −1 right."""
        x, y = self.points[owner]
        return 1 if x * self.target[1] - y * self.target[0] >= 0.0 else -1

    def ends(self, owner: int) -> tuple[dict[int, Vertex], float]:
        """Left (+1) and right (−1) end of a point's obstacle, and the obstacle's least distance to the target [m]."""
        start = _direction(self.points[owner])
        ends, nearest = {}, math.inf
        for side in (1, -1):
            k, is_longer, min_distance = sweep(*self._profile, UNITS, start, side, self.target)
            end = self._mouth(start, side) or (self._node(k, is_longer, side) if k >= 0 else None)
            if end is not None:
                ends[side] = end
            nearest = min(nearest, min_distance)
        return ends, nearest

    def next_end(self, along: Floats, side: int) -> tuple[Vertex | None, float]:
        """End, on one side, of the visible boundary with the scan point nearest to `along`.

        If there is no end, as in a room: a place along the wall; None if the robot is enclosed. Also returns the
        least distance of the visible boundary to the target [m].
        """
        if not len(self.points):
            return None, math.inf
        index = int(np.argmin(np.hypot(*(self.points - along).T)))
        start = self._in_sight(index, side)
        k, is_longer, min_distance = sweep(*self._profile, UNITS, start, side, self.target)
        return self._node(k, is_longer, side) if k >= 0 else self._along_wall(start, side), min_distance

    def nearest_place(self) -> Floats:
        """Reachable place nearest to the target: the target, an end, or the farthest point towards the target."""
        if self.blocking(self.target) < 0:
            return self.target
        k = _direction(self.target)
        positions = [self._node(k, True, side).place for k, side in all_ends(*self._profile).tolist()]
        positions.append(min(self._free[k], self.distance) * UNITS[k])
        return min(positions, key=lambda position: math.dist(position, self.target))

    def _mouth(self, start: int, side: int) -> Vertex | None:
        """Opening of a pocket that contains the target; the scan has no break there if it shows the inside."""
        k, is_longer, _ = sweep(*self._jumps, UNITS, start, side, self.target)
        if k < 0 or not is_longer:
            return None
        node = self._node(k, True, side)
        blocking = first_on_way(self.points - node.place, self._reduced_radii, self.target - node.place)
        return node if blocking < 0 else None

    def _in_sight(self, index: int, side: int) -> int:
        """Direction of a point, turned back until no nearer obstacle hides the point's obstacle."""
        start = _direction(self.points[index])
        directions = ((start - side * steps) % len(UNITS) for steps in range(len(UNITS)))
        return next((k for k in directions if joined(self._owners[k], index, self._breaks)), start)

    def _along_wall(self, start: int, side: int) -> Vertex | None:
        """Next place along a wall, one robot width ahead or up to the wall; None if there is no free one."""
        k = first_longer(self._free, start, side, 2.0 * self._radius)
        if k < 0:
            return None
        if k == start:
            return self._node(k, False, side)
        return Vertex(2.0 * self._radius * UNITS[k], self.points[self._owners[(k - side) % len(UNITS)]])

    def _node(self, k: int, is_longer: bool, side: int) -> Vertex:
        """Node at the end of the obstacle in direction k: past its end, or where another obstacle hides it."""
        point, radius = self.points[self._owners[k]], self._radii[self._owners[k]]
        if not is_longer:
            return Vertex(self._free[k] * UNITS[k], point)
        distance = math.hypot(*point)
        bearing = math.atan2(point[1], point[0]) + side * math.asin(radius / distance)
        length = math.sqrt(distance * distance - radius * radius) + self._radius
        length = min(length, self._free[(k + side) % len(UNITS)])
        return Vertex(np.array([length * math.cos(bearing), length * math.sin(bearing)]), point)


def _direction(point: Floats) -> int:
    """Index of the direction nearest to a point's bearing."""
    return int((math.atan2(point[1], point[0]) + math.pi) / math.tau * len(UNITS)) % len(UNITS)
