"""Rigid-body simulator: a robot with mass on wheels of limited grip; the physics engine reports contact."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pymunk

from lme.errors import require
from lme.inputs.plausibility import check_fields
from lme.robots import Footprint, Robot
from lme.simulation.crowd import Crowd
from lme.simulation.disturbances import Disturbances
from lme.simulation.gait import check_height
from lme.simulation.simulator import Sensors, forward_enough
from lme.simulation.substeps import Substepper, track
from lme.types import Floats, Limits, Observation, Pose, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import Task, World

MASS = 1.0  # [kg] any value: grip is proportional to mass, and no obstacle gives way
GRAVITY = 9.81  # [m/s²]
CONTACT_FRICTION = 0.5  # [-] between hull and obstacle, once in contact

_ROBOT, _OBSTACLE = 1, 2  # collision types
_ELSEWHERE = (1e6, 1e6)  # [m] where a recorded mover is while it is not there


@dataclass(slots=True)
class PhysicsConfig(Disturbances):
    """Time step of the physics engine, and grip of the tyres."""

    substep: float
    grip: float | None

    def __post_init__(self) -> None:
        Disturbances.__post_init__(self)
        require("substep", self.substep, above=0.0)
        if self.grip is not None:
            require("grip", self.grip, above=0.0)
        check_fields(self)


class PhysicsSimulator:
    """Differential drive among static and moving rigid bodies (Chipmunk2D through pymunk)."""

    Config = PhysicsConfig

    def __init__(self, config: PhysicsConfig, robot: Robot) -> None:
        check_height(config.tilt, robot)
        self._robot = robot
        self._config = config
        self._substeps = max(1, math.ceil(robot.dt / config.substep - 1e-9))

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """Circles (C, 3) and edges (E, 4) at their current poses, static ones first."""
        return self._substepper.obstacles

    @property
    def people(self) -> tuple[Floats, Floats]:
        """See `lme.simulation.simulator.Simulator.people`."""
        return self._substepper.crowd.people

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Put the robot at the task's start, at rest."""
        crowd = Crowd(task.world.movers, task.world, self._robot.footprint.circumscribed_radius)
        self._sensors = Sensors(self._robot, self._config, task, rng)
        start = Pose(*map(float, task.start))
        self._body = body = RigidBody(task.world, start, self._robot, crowd, self._config.grip)
        self._substepper = Substepper(task, self._robot, self._config, rng.spawn(1)[0], crowd, body)
        self.state = self._substepper.start()
        return self._observe()

    def step(self, command: Twist) -> Observation:
        """Drive for one control period, or until contact or arrival, whichever comes first."""
        command = forward_enough(command, self._robot)
        self._sensors.sent(command)
        self.state = self._substepper.period(command, self._substeps, self._limits)
        return self._observe()

    def change(self, task: Task) -> Observation:
        """See `lme.simulation.simulator.Changeable`."""
        crowd = Crowd(task.world.movers, task.world, self._robot.footprint.circumscribed_radius)
        crowd.go_on(self._substepper.crowd)
        self._sensors.change(task)
        body = RigidBody(task.world, self._body.pose, self._robot, crowd, self._config.grip)
        body.keep_moving(self._body)
        self._body = body
        self._substepper.change(task, crowd, body)
        self.state = self._substepper.start()
        return self._observe()

    def _limits(self, _command: Twist, _twist: Twist) -> Limits:
        return self._robot.limits

    def _observe(self) -> Observation:
        wheels, crowd = self._substepper.wheels, self._substepper.crowd
        return self._sensors.observe(self.state, wheels.twist, wheels.odometry, *self.obstacles, crowd)


class RigidBody:
    """The robot in a pymunk space with the obstacles. pose, twist: of the base, over ground."""

    def __init__(self, world: World, start: Pose, robot: Robot, crowd: Crowd, grip: float | None) -> None:
        self._crowd = crowd
        self._grip = math.inf if grip is None else grip
        self._track = track(robot.footprint)
        self._touching = 0
        self._space = pymunk.Space()
        self._space.collision_slop = 1e-4  # [m] the default, 0.1, is meant for pixels
        # Share of an overlap left after a second: bodies separate within one substep.
        self._space.collision_bias = 1e-200
        self._space.on_collision(_ROBOT, _OBSTACLE, begin=self._begin, separate=self._separate)
        self._add(self._space.static_body, _static_shapes(self._space.static_body, world))
        self._movers = [
            self._add_mover(mover, pose)
            for mover, pose in zip(world.movers, crowd.poses.tolist(), strict=True)
        ]
        self._robot = self._add_robot(robot.footprint, start)
        self.pose, self.twist = start, Twist(0.0, 0.0)
        self._space.step(1e-9)  # so that a start in contact is reported at once

    def move(self, motion: tuple[float, float], dt: float) -> None:
        """Drive the wheels so that the body rolls by this distance [m] and turn [rad], if they grip."""
        heading = self._robot.angle + motion[1] / 2
        self._push(motion[0] / dt, motion[1] / dt, heading, dt)
        self._walk(dt)
        self._space.step(dt)
        (x, y), (vx, vy) = self._robot.position, self._robot.velocity
        self.pose = Pose(x, y, self._robot.angle)
        along = vx * math.cos(heading) + vy * math.sin(heading)
        self.twist = Twist(along, self._robot.angular_velocity)

    def keep_moving(self, former: RigidBody) -> None:
        """Take over the current velocity of another body."""
        self._robot.velocity, self._robot.angular_velocity = (
            former._robot.velocity,
            former._robot.angular_velocity,
        )
        self.twist = former.twist

    def touches(self, clearance: float) -> bool:
        """Return whether the engine has reported a contact, but not its end."""
        return self._touching > 0

    def _push(self, v: float, omega: float, heading: float, dt: float) -> None:
        """Apply the impulses of both wheels that make the body roll at v along the heading and turn at omega.

        A wheel pushes along its tread and resists sideways slip. Grip bounds the sum of both impulses.
        """
        body, cos, sin = self._robot, math.cos(heading), math.sin(heading)
        vx, vy = body.velocity
        along = MASS * (v - (vx * cos + vy * sin)) / 2
        across = MASS * (vx * sin - vy * cos) / 2
        turn = body.moment * (omega - body.angular_velocity) / self._track
        max_impulse = self._grip * MASS * GRAVITY / 2 * dt
        x, y = body.position
        for side, drive in ((0.5, along - turn), (-0.5, along + turn)):
            needed = math.hypot(drive, across)
            part = max_impulse / needed if needed > max_impulse else 1.0
            impulse = (part * (drive * cos - across * sin), part * (drive * sin + across * cos))
            lever = side * self._track
            body.apply_impulse_at_world_point(impulse, (x - lever * sin, y + lever * cos))

    def _walk(self, dt: float) -> None:
        """Set the velocities that bring every mover to its pose in the crowd within `dt` [s]."""
        crowd = self._crowd
        for body, (x, y, yaw), present in zip(self._movers, crowd.poses.tolist(), crowd.present, strict=True):
            if not present:
                x, y = _ELSEWHERE
            if present != (body.position.x < _ELSEWHERE[0] / 2):
                body.position = x, y  # comes or goes; it does not walk there
            at_x, at_y = body.position
            body.velocity = ((x - at_x) / dt, (y - at_y) / dt)
            body.angular_velocity = (yaw - body.angle) / dt

    def _add_robot(self, hull: Footprint, start: Pose) -> pymunk.Body:
        half_length, half_width, rounding = hull.box
        body = pymunk.Body()
        if hull.radius is not None:
            shape: pymunk.Shape = pymunk.Circle(body, rounding)
        else:
            shape = pymunk.Poly.create_box(body, (2 * half_length, 2 * half_width))
        shape.mass, shape.friction, shape.collision_type = MASS, CONTACT_FRICTION, _ROBOT
        body.position, body.angle = start[:2], start.yaw
        self._space.add(body, shape)
        return body

    def _add_mover(self, mover: Mover, pose: Sequence[float]) -> pymunk.Body:
        body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
        body.position, body.angle = (pose[0], pose[1]), pose[2]
        if mover.outline is None:
            assert mover.radius is not None
            shapes: Iterable[pymunk.Shape] = [pymunk.Circle(body, mover.radius)]
        else:
            shapes = _polygon(body, mover.outline)
        self._space.add(body)
        self._add(body, shapes)
        return body

    def _add(self, body: pymunk.Body, shapes: Iterable[pymunk.Shape]) -> None:
        new_shapes = list(shapes)
        for shape in new_shapes:
            shape.friction, shape.collision_type = CONTACT_FRICTION, _OBSTACLE
        self._space.add(*new_shapes)

    def _begin(self, _arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        self._touching += 1

    def _separate(self, _arbiter: pymunk.Arbiter, _space: pymunk.Space, _data: Any) -> None:
        self._touching -= 1


def _static_shapes(body: pymunk.Body, world: World) -> Iterator[pymunk.Shape]:
    for x, y, radius in world.circles.tolist():
        yield pymunk.Circle(body, radius, (x, y))
    for x0, y0, x1, y1 in world.segments.tolist():
        yield pymunk.Segment(body, (x0, y0), (x1, y1), 0.0)
    for polygon in world.polygons:
        yield from _polygon(body, polygon)


def _polygon(body: pymunk.Body, outline: Floats) -> Iterator[pymunk.Shape]:
    """Return one shape for a convex polygon, else one per side: the engine would fill the hollows of others."""
    points = outline.tolist()
    if _is_convex(outline):
        yield pymunk.Poly(body, points)
    else:
        for start, end in zip(points, points[1:] + points[:1], strict=True):
            yield pymunk.Segment(body, start, end, 0.0)


def _is_convex(outline: Floats) -> bool:
    """Return whether a polygon that does not cross itself is convex."""
    sides = np.roll(outline, -1, axis=0) - outline
    following = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * following[:, 1] - sides[:, 1] * following[:, 0]
    return bool((turns >= 0.0).all() or (turns <= 0.0).all())
