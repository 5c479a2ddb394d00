"""Picture of the scene from above: obstacles, goal, lidar returns, the path driven, and the robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from lme.geometry.frames import compose, to_world
from lme.perception.scan_points import beam_directions
from lme.robots import Robot
from lme.simulation.simulator import Simulator
from lme.types import Floats, LaserScan, Pose
from lme.worlds.world import Task

LONGER_SIDE = 600  # [pixels]
MARGIN = 0.5  # [m] around the scene

PAPER, OBSTACLE, GOAL = (255, 255, 255), (90, 90, 90), (150, 215, 160)
SEEN, TRAIL, ROBOT, HEADING = (225, 120, 30), (150, 180, 235), (40, 90, 200), (255, 255, 255)

Corners = list[tuple[float, float]]


def frame(
    task: Task, robot: Robot, simulator: Simulator, scan: LaserScan, trail: list[Pose]
) -> NDArray[np.uint8]:
    """Draw the scene (H, W, 3). scan: the current one; trail: the poses passed so far, the current one last.

    All pictures of an episode have the same size.
    """
    canvas = _Canvas(task)
    canvas.disc(float(task.goal[0]), float(task.goal[1]), task.goal_tolerance, GOAL)
    circles, edges = simulator.obstacles
    for polygon in task.world.polygons:
        canvas.polygon(polygon, OBSTACLE)
    for x, y, radius in circles.tolist():
        canvas.disc(x, y, radius, OBSTACLE)
    for edge in edges:
        canvas.line(edge.reshape(2, 2), OBSTACLE)
    canvas.line(np.array(trail)[:, :2], TRAIL)
    for x, y in _hits(robot, scan, trail[-1]).tolist():
        canvas.disc(x, y, 0.03, SEEN)
    canvas.polygon(to_world(robot.footprint.outline(), trail[-1]), ROBOT)
    canvas.line(
        to_world(np.array([[0.0, 0.0], [robot.footprint.circumscribed_radius, 0.0]]), trail[-1]),
        HEADING,
    )
    return np.array(canvas.image)


class _Canvas:
    """Image that is drawn on in world coordinates, x to the right and y up [m]."""

    def __init__(self, task: Task) -> None:
        low, high = _bounds(task)
        self._low, self._scale = low, LONGER_SIDE / float((high - low).max())
        width, height = (2 * math.ceil(side / 2) for side in (high - low) * self._scale)  # even, for video
        self._height = height
        self.image = Image.new("RGB", (width, height), PAPER)
        self._draw = ImageDraw.Draw(self.image)

    def disc(self, x: float, y: float, radius: float, colour: tuple[int, int, int]) -> None:
        corners = self._pixels(np.array([[x - radius, y + radius], [x + radius, y - radius]]))
        self._draw.ellipse(corners, fill=colour)

    def polygon(self, points: Floats, colour: tuple[int, int, int]) -> None:
        self._draw.polygon(self._pixels(points), fill=colour)

    def line(self, points: Floats, colour: tuple[int, int, int]) -> None:
        self._draw.line(self._pixels(points), fill=colour, width=3)

    def _pixels(self, points: Floats) -> Corners:
        u, v = ((points - self._low) * self._scale).T
        return list(zip(u.tolist(), (self._height - v).tolist(), strict=True))


def _bounds(task: Task) -> tuple[Floats, Floats]:
    """Lowest and highest x, y (2,) of static obstacles, start and goal, with a margin [m]."""
    circles, edges = task.world.circles, task.world.edges
    discs = [circles[:, :2] - circles[:, 2:], circles[:, :2] + circles[:, 2:]]
    goal = [task.goal - task.goal_tolerance, task.goal + task.goal_tolerance]
    points = np.vstack([task.start[:2], *goal, *discs, edges[:, :2], edges[:, 2:]])
    return points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN


def _hits(robot: Robot, scan: LaserScan, pose: Pose) -> Floats:
    """Points that the lidar sees, in the world: (M, 2) [m]."""
    directions = beam_directions(scan.angle_min, scan.angle_increment, len(scan.ranges))
    hit = scan.ranges < scan.range_max
    return to_world(directions[hit] * scan.ranges[hit, None], compose(pose, robot.lidar.mount))
