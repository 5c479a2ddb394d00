"""Model of a world in MuJoCo: a floor, upright obstacles and the robot among them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError
from lme.requirements import install
from lme.simulation.crowd import Crowd
from lme.types import Floats
from lme.worlds.world import World

if TYPE_CHECKING:
    import mujoco

HEIGHT = 1.0  # [m] of the obstacles, above everything that the robot is made of
HALF_THICKNESS = 0.002  # [m] of walls
CONTACT_MARGIN = 0.001  # [m] at which bodies begin to push each other away
_ELSEWHERE = -100.0  # [m] height of a recorded mover while it is not there


def require_mujoco() -> None:
    """Raise InputError, which says how to install it, unless MuJoCo can be imported."""
    try:
        import mujoco  # noqa: F401 - the others import it where they use it
    except ModuleNotFoundError as error:
        raise InputError(
            f"sim=mujoco needs MuJoCo: {install('mujoco')}, or the extra mujoco of lme"
        ) from error


class Arena:
    """The model of a world and what in it is which. `model` has the floor, the obstacles and the robot, in this order.

    parts: what each shape belongs to. The movers of a crowd are bodies without dynamics; `place` puts them at their
    poses.
    """

    def __init__(
        self,
        world: World,
        crowd: Crowd,
        add_robot: Callable[[mujoco.MjSpec], None],
        margin: float = CONTACT_MARGIN,
    ) -> None:
        """add_robot: adds a body whose shapes are named PART or PART_…, and collide with obstacles and floor.

        margin [m]: distance at which obstacles begin to push, so that a robot may graze one without a contact.
        """
        import mujoco

        spec = mujoco.MjSpec()
        ground = mujoco.mjtGeom.mjGEOM_PLANE
        spec.worldbody.add_geom(name="floor", type=ground, size=[0.0, 0.0, 0.05], contype=0, conaffinity=1)
        _add_obstacles(spec.worldbody, np.asarray(world.circles, dtype=np.float64), world.edges, margin)
        for i, mover in enumerate(world.movers):
            body = spec.worldbody.add_body(name=f"mover_{i}", mocap=True)
            if mover.outline is None:
                _add_obstacles(body, np.array([[0.0, 0.0, mover.radius]]), np.empty((0, 4)), margin)
            else:
                sides = np.hstack([mover.outline, np.roll(mover.outline, -1, axis=0)])
                _add_obstacles(body, np.empty((0, 3)), sides, margin)
        self._first_part = len(spec.geoms)  # geoms before it are the floor, 0, and obstacles
        add_robot(spec)
        self.model: mujoco.MjModel = spec.compile()
        self.parts = [self.model.geom(i).name.partition("_")[0] for i in range(self.model.ngeom)]
        self._crowd = crowd

    def place(self, data: mujoco.MjData) -> None:
        """Move the movers to their current poses."""
        for i, ((x, y, yaw), present) in enumerate(zip(self._crowd.poses, self._crowd.present, strict=True)):
            data.mocap_pos[i] = x, y, 0.0 if present else _ELSEWHERE
            data.mocap_quat[i] = math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)

    def touching(self, data: mujoco.MjData) -> str:
        """Return the part of the robot that touches an obstacle; empty for none."""
        pairs = data.contact.geom
        is_obstacle = (pairs > 0) & (pairs < self._first_part)
        if not is_obstacle.any():
            return ""
        touches = is_obstacle.any(axis=1) & (
            data.contact.dist <= 0.0
        )  # others are only near, within the margin
        return self.parts[pairs[touches.argmax()].max()] if touches.any() else ""


def _add_obstacles(body: mujoco.MjsBody, circles: Floats, edges: Floats, margin: float) -> None:
    """Add upright cylinders (C, 3) and thin walls (E, 4) to a body."""
    import mujoco

    common = {"contype": 0, "conaffinity": 1, "margin": margin}
    half_height = HEIGHT / 2
    cylinder, box = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_BOX
    for x, y, radius in circles.tolist():
        body.add_geom(type=cylinder, size=[radius, half_height, 0.0], pos=[x, y, half_height], **common)
    for x0, y0, x1, y1 in edges.tolist():
        length, yaw = math.hypot(x1 - x0, y1 - y0), math.atan2(y1 - y0, x1 - x0)
        size = [length / 2 + HALF_THICKNESS, HALF_THICKNESS, half_height]
        pos, quat = (
            [(x0 + x1) / 2, (y0 + y1) / 2, half_height],
            [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)],
        )
        body.add_geom(type=box, size=size, pos=pos, quat=quat, **common)
