"""Safety of a command: it does not lead into contact."""

from __future__ import annotations

import numpy as np

from lme.kernels.collision import sweep
from lme.kernels.motion import drive
from lme.robots import Robot
from lme.types import Floats, Pose, Twist

_NO_EDGES = np.empty((0, 4))
_STEP = 0.02  # [m] no point of the outline moves further between two collision checks


def predict(pose: Pose, twist: Twist, command: Twist, time: float, robot: Robot) -> tuple[Pose, Twist]:
    """Pose and twist of the robot after following a command for `time` [s]."""
    poses, moving = drive(pose, twist, command, robot.limits.bounds, time, _STEP, robot.hull.r_max)
    return Pose(*poses[-1].tolist()), Twist(*moving)


def touches(points: Floats, pose: Pose, twist: Twist, command: Twist, robot: Robot) -> bool:
    """Whether the robot would touch a point if it followed the command for a control period and then braked.

    points (M, 2) [m], in the frame in which `pose` is given. twist: of the robot now.
    """
    poses = _stopping_poses(pose, twist, command, robot)
    circles = np.column_stack((points, np.zeros(len(points))))
    return sweep(poses, robot.hull.box, circles, _NO_EDGES)[1] >= 0


def _stopping_poses(pose: Pose, twist: Twist, command: Twist, robot: Robot) -> Floats:
    """Poses (K, 3) over a control period with the command, and then until the robot stands."""
    limits, reach = robot.limits, robot.hull.r_max
    period, moving = drive(pose, twist, command, limits.bounds, robot.dt, _STEP, reach)
    braking_time = max(abs(moving[0]) / limits.alpha_v, abs(moving[1]) / limits.alpha_omega)
    if braking_time == 0.0:
        return period
    x, y, yaw = period[-1].tolist()
    braking, _ = drive((x, y, yaw), moving, (0.0, 0.0), limits.bounds, braking_time, _STEP, reach)
    return np.concatenate((period, braking))
