"""Safety of a command: it does not lead into contact."""

from __future__ import annotations

from lme.geometry.frames import to_robot
from lme.kernels.motion import drive
from lme.planners.safety.check import StoppingCheck, StoppingState
from lme.robots import Robot
from lme.types import Floats, Pose, Twist

_STEP = 0.02  # [m] no point of the outline moves further between two poses


def predict(pose: Pose, twist: Twist, command: Twist, time: float, robot: Robot) -> tuple[Pose, Twist]:
    """Pose and twist of the robot after following a command for `time` [s]."""
    poses, moving = drive(pose, twist, command, robot.limits.bounds, time, _STEP, robot.hull.r_max)
    return Pose(*poses[-1].tolist()), Twist(*moving)


def touches(points: Floats, pose: Pose, twist: Twist, command: Twist, robot: Robot) -> bool:
    """Whether the robot would touch a point if it followed the command for a control period and then braked.

    points (M, 2) [m], in the frame in which `pose` is given. twist: of the robot now.
    """
    now = StoppingState(to_robot(points, pose), (twist,), robot.limits, ramp_start=command)
    return not StoppingCheck(robot.hull, robot.dt).stops(command, now)
