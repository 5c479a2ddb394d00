"""sim=gazebo with a robot that benchmarks/ode_jackal.cpp moves, so that systems drive in Gazebo's own engine.

    g++ -O2 benchmarks/ode_jackal.cpp -lode -o ode_jackal
    ODE_JACKAL=./ode_jackal lme eval map=barn robot=jackal sim=gazebo sim._target_=benchmarks.ode_loop.OdeSimulator

Sensors, contacts and the profile are those of sim=gazebo. The start has the heading 0 in the engine, so friction must
not be fixed to the world.
"""

import math
import os
import subprocess

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import compose
from lme.robots import Controller
from lme.simulation.skid.simulator import Base, GazeboConfig, GazeboSimulator
from lme.types import Floats, Pose, Twist

STEP = 0.001  # [s] of the engine


class OdeSimulator(GazeboSimulator):
    """The BARN Challenge's Gazebo, with its engine."""

    Config = GazeboConfig

    def _make_base(self) -> Base:
        friction, drivetrain = self._config.friction, self._robot.drivetrain
        if friction == "world":
            raise InputError("sim.friction is 'world': must be wheel or body in OdeSimulator")
        assert drivetrain is not None
        return OdeBase(self._start, friction, drivetrain.controller)


class OdeBase:
    """A process of ode_jackal; see `Base`. It ends with its standard input, when the base is no longer used."""

    def __init__(self, start: Pose, friction: str, controller: Controller) -> None:
        """friction: wheel or body."""
        program = os.environ.get("ODE_JACKAL", "./ode_jackal")
        pipe = subprocess.PIPE
        self._engine = subprocess.Popen([program, friction], stdin=pipe, stdout=pipe, text=True)
        self._start, self._controller, self._v = start, controller, 0.0
        self.pose, self.twist, self.measured = start, Twist(0.0, 0.0), Twist(0.0, 0.0)
        self.reckoned = np.array(start[:2], dtype=np.float64)

    def __del__(self) -> None:
        """End the process."""
        engine = self._engine
        assert engine.stdin is not None
        assert engine.stdout is not None
        engine.stdin.close()
        engine.stdout.close()
        engine.wait()

    def drive(
        self, command: Twist, duration: float, count: int, factors: tuple[float, float], yaw_errors: Floats
    ) -> Floats:
        """See `Base`."""
        controller, engine = self._controller, self._engine
        assert engine.stdin is not None
        assert engine.stdout is not None
        v = min(max(command.v, -controller.v_max), controller.v_max)
        omega = min(max(command.omega, -controller.omega_max), controller.omega_max)
        steps = round(duration / STEP)
        engine.stdin.write(f"{v:.9f} {omega:.9f} {steps}\n")
        engine.stdin.flush()
        rows = np.array([engine.stdout.readline().split() for _ in range(steps)], dtype=float)
        # Odometry: the wheels' speed along the measured yaw.
        change = controller.alpha_v * STEP
        for k, row in enumerate(rows):
            self._v += min(max(v - self._v, -change), change)
            heading = self._start.yaw + row[2] + yaw_errors[k * len(yaw_errors) // steps]
            self.reckoned += STEP * self._v * np.array([math.cos(heading), math.sin(heading)])
        ends = [(k + 1) * steps // count - 1 for k in range(count)]
        poses = np.array([compose(self._start, Pose(*rows[end, :3].tolist())) for end in ends])
        self.pose = Pose(*poses[-1].tolist())
        self.twist = Twist(float(rows[-1, 3]), float(rows[-1, 5]))
        self.measured = Twist(self._v, float(rows[-1, 5]))
        return poses
