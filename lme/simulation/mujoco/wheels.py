"""A robot on four driven wheels: its bodies in MuJoCo, the controller of the wheels, and the sensors on it."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import relative
from lme.geometry.skid import AXES
from lme.robots import Drivetrain, Robot, Solid
from lme.simulation.crowd import Crowd
from lme.simulation.mujoco.arena import Arena
from lme.simulation.mujoco.kernels import apply_friction
from lme.simulation.mujoco.machine import FALLEN_TILT, Readings
from lme.simulation.simulator import FALL, State
from lme.simulation.skid.simulator import ODOMETRY_RATE, check_control_rate
from lme.types import Floats, Pose, Twist
from lme.worlds.world import World

if TYPE_CHECKING:
    import mujoco

TIME_STEP = 0.001  # [s] of the physics, as in Gazebo
PIECE = 5  # steps, 5 ms: 1 cm at 2 m/s
CHASSIS, WHEEL = "chassis", "wheel"  # parts
SETTLING_TIME = 0.2  # [s] in which the wheels sink into the floor

# Chosen on half of the random commands of benchmarks/ode_jackal.cpp (research/fidelity.md, "A Jackal in MuJoCo").
FLOOR_SPRING = (0.01, 2.0)  # time constant [s] and damping ratio [-] of the load of a wheel
FLOOR_IMPEDANCE = (0.95, 0.99, 0.001)  # least and greatest impedance [-], over a depth of [m]
SHARE = (
    0.7  # [-] of the sliding of the whole robot that friction stops in a step, unless it reaches its bound
)
CONTACTS = 8  # two for each wheel

# The controller has no limit of torque. A rotor that is far heavier than the robot keeps the speed that it is given.
ROTOR_INERTIA = 10.0  # [kg m²]
SERVO = 1e5  # [N m s/rad] torque per error of a wheel's turn rate


def check_wheels(robot: Robot, drivetrain: Drivetrain) -> None:
    """Raise InputError unless the robot has four wheels whose masses are known, and is driven often enough."""
    if drivetrain.solid is None:
        raise InputError(
            f"robot.drivetrain.solid is null in robot {robot.name}: sim=mujoco needs the sizes and inertias of chassis "
            "and wheels there, as conf/robot/jackal.yaml has them"
        )
    for key in ("wheel_base", "wheel_width", "com_height"):
        if getattr(drivetrain, key) == 0.0:
            raise InputError(
                f"robot.drivetrain.{key} is 0 in robot {robot.name}: must be above 0 in sim=mujoco, where a robot "
                "stands on four wheels"
            )
    check_control_rate(robot, drivetrain.controller.timeout)
    if min(_chassis_inertias(drivetrain, drivetrain.solid)[2:]) <= 0.0:
        raise InputError(
            f"robot.drivetrain in robot {robot.name}: mass and inertias must be more than those of its four "
            "wheels alone"
        )


class FourWheels:
    """See `Machine`. The base frame is on the floor, in the middle of the wheels."""

    time_step, piece = TIME_STEP, PIECE
    legs = joints = None

    def __init__(self, robot: Robot, friction: str, yaw_noise: float, scan_rate: float | None) -> None:
        """friction: one of AXES. yaw_noise: σ of the measured yaw [rad]. scan_rate [Hz]: None: control's."""
        assert robot.drivetrain is not None
        self._drivetrain, self._axes = robot.drivetrain, AXES.index(friction)
        self._yaw_noise, self._scan_rate = yaw_noise, scan_rate

    def begin(self, start: Pose, rng: np.random.Generator) -> None:
        """See `Machine`."""
        self._start = self._pose = start
        self._yaw_rng, phase_rng = rng.spawn(2)
        self._scan_phase = phase_rng.uniform() / self._scan_rate if self._scan_rate else 0.0
        self._speeds = np.zeros(2)  # v and ω that the controller has reached
        self._steps, self._yaw_error = 0, 0.0
        self._reckoned = np.array(start[:2], dtype=np.float64)
        self._data: mujoco.MjData | None = None

    def enter(self, world: World, crowd: Crowd) -> None:
        """See `Machine`."""
        import mujoco

        former, self._arena = (
            self._data,
            Arena(world, crowd, partial(add_robot, drivetrain=self._drivetrain), margin=0.0),
        )
        model = self._arena.model
        self._data = data = mujoco.MjData(model)
        self._chassis = int(model.body(CHASSIS).id)
        self._first = self._chassis, self._arena.parts.index(WHEEL)
        if former is None:
            x, y, yaw = self._start
            data.qpos[:7] = x, y, 0.0, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)
        else:
            for name in ("qpos", "qvel", "qacc_warmstart", "ctrl"):
                getattr(data, name)[:] = getattr(former, name)
        self._arena.place(data)
        mujoco.mj_forward(model, data)
        self.contact = self._arena.touching(data)
        if former is None and not self.contact:
            mujoco.mj_step(model, data, round(SETTLING_TIME / TIME_STEP))

    def move(self, command: Twist, steps: int) -> int:
        """See `Machine`."""
        import mujoco

        arena, drivetrain, before = self._arena, self._drivetrain, self.pose
        model, data, controller = arena.model, self._data, drivetrain.controller
        assert data is not None
        arena.place(data)
        # How far the controller may go, and by how much it may change in a step.
        most = np.array([controller.v_max, controller.omega_max])
        change = np.array([controller.alpha_v, controller.alpha_omega]) * TIME_STEP
        goal = np.minimum(np.maximum(np.array(command), -most), most)
        half_track = drivetrain.track * controller.separation_multiplier / 2
        to_wheels = np.array([[1.0, -half_track], [1.0, half_track]] * 2) / drivetrain.wheel_radius
        bodies = data.xpos, data.xmat, data.xipos
        viscosity = SHARE * drivetrain.mass / (CONTACTS * TIME_STEP)
        v_sum, made = 0.0, 0
        while made < steps and not (made and self.contact):
            made += 1
            self._speeds += np.minimum(np.maximum(goal - self._speeds, -change), change)
            v_sum += float(self._speeds[0])
            data.ctrl[:] = to_wheels @ self._speeds
            near = data.contact
            contacts = near.pos, near.geom, near.efc_address, data.efc_force
            is_near = apply_friction(
                data.xfrc_applied,
                data.qvel,
                bodies,
                contacts,
                self._first,
                self._axes,
                drivetrain.friction,
                viscosity,
            )
            mujoco.mj_step(model, data)
            # A contact counts from the step after that in which it has come within reach.
            self.contact = arena.touching(data) if is_near else ""
        self._reckon(before, v_sum / made, made)
        if not self.contact and data.xmat[self._chassis, 8] < math.cos(FALLEN_TILT):
            self.contact = FALL
        return made

    def look(self, time: float, made: int, left: int, circles: Floats, edges: Floats) -> None:
        """See `Machine`. The scan is cast when it is read."""

    def read(self, state: State, circles: Floats, edges: Floats) -> Readings:
        """See `Machine`. As in `sim=skid`: the wheels' speed, the true turn rate, and a yaw with noise."""
        twist = Twist(float(self._speeds[0]), float(self.velocity[2]))
        x, y = self._reckoned.tolist()
        odometry = relative(Pose(x, y, self.pose.yaw + self._yaw_error), self._start)
        if self._scan_rate is None:
            return Readings(twist, odometry)
        age = (state.time + self._scan_phase) % (1.0 / self._scan_rate)
        num_back = round(age / (PIECE * TIME_STEP))
        return Readings(
            twist, odometry, Pose(*state.travel[max(len(state.travel) - 1 - num_back, 0)].tolist())
        )

    @property
    def pose(self) -> Pose:
        """See `Machine`."""
        assert self._data is not None
        x, y, _, a, b, c, d = self._data.qpos[:7].tolist()  # position, and quaternion a, b, c, d
        return Pose(x, y, math.atan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d)))

    @property
    def velocity(self) -> Floats:
        """See `Machine`."""
        assert self._data is not None
        vx, vy = self._data.qvel[:2].tolist()
        yaw = self.pose.yaw
        cos, sin = math.cos(yaw), math.sin(yaw)
        omega = float(
            self._data.xmat[self._chassis, 6:] @ self._data.qvel[3:6]
        )  # in the frame of the chassis
        return np.array([cos * vx + sin * vy, cos * vy - sin * vx, omega])

    def _reckon(self, before: Pose, v: float, steps: int) -> None:
        """Move the dead-reckoned position at the wheels' speed along the measured yaw, whose error is new at 50 Hz."""
        if self._steps % round(1.0 / (ODOMETRY_RATE * TIME_STEP)) < PIECE:
            self._yaw_error = float(self._yaw_rng.normal(0.0, self._yaw_noise))
        self._steps += steps
        turn = math.remainder(self.pose.yaw - before.yaw, math.tau)
        heading = before.yaw + turn / 2 + self._yaw_error
        self._reckoned += v * steps * TIME_STEP * np.array([math.cos(heading), math.sin(heading)])


def add_robot(spec: mujoco.MjSpec, drivetrain: Drivetrain) -> None:
    """Add a box on four wheels to a model, with a free joint and one motor per wheel: left and right, front, rear.

    Wheels press on the floor without friction, which `apply_friction` adds.
    """
    import mujoco

    solid = drivetrain.solid
    assert solid is not None
    spec.compiler.degree = False
    spec.option.timestep = TIME_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # for the stiff servo
    radius, wheel_width = drivetrain.wheel_radius, drivetrain.wheel_width
    chassis = spec.worldbody.add_body(name=CHASSIS)
    chassis.add_freejoint()
    com_x, com_height, mass, *inertias = _chassis_inertias(drivetrain, solid)
    _set_inertial(chassis, mass, [com_x, 0.0, com_height], inertias)
    # Obstacles are upright and higher than the box, whose own height has no effect.
    size = [solid.chassis_length / 2, solid.chassis_width / 2, radius]
    common = {"contype": 1, "conaffinity": 0, "condim": 1}
    box = mujoco.mjtGeom.mjGEOM_BOX
    chassis.add_geom(name=CHASSIS, type=box, size=size, pos=[0.0, 0.0, 1.5 * radius], **common)
    lying = [math.cos(math.pi / 4), math.sin(math.pi / 4), 0.0, 0.0]  # axis to the left
    for name, x, y in _wheel_positions(drivetrain):
        wheel = chassis.add_body(name=name, pos=[x, y, radius])
        across = _inertia_across(drivetrain, solid)
        _set_inertial(wheel, solid.wheel_mass, [0.0, 0.0, 0.0], [across, solid.wheel_inertia, across])
        wheel.add_joint(name=name, axis=[0.0, 1.0, 0.0], armature=ROTOR_INERTIA)
        tread = wheel.add_geom(
            name=f"{WHEEL}_{name}", type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[radius, wheel_width / 2, 0.0], quat=lying, priority=1, **common,
        )  # fmt: skip
        tread.solref, tread.solimp[:3] = FLOOR_SPRING, FLOOR_IMPEDANCE
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.gainprm[0], motor.biasprm[2] = SERVO, -SERVO


def _wheel_positions(drivetrain: Drivetrain) -> list[tuple[str, float, float]]:
    half_base, half_track = drivetrain.wheel_base / 2, drivetrain.track / 2
    ends, sides = (("F", half_base), ("R", -half_base)), (("L", half_track), ("R", -half_track))
    return [(end + side, x, y) for end, x in ends for side, y in sides]


def _inertia_across(drivetrain: Drivetrain, solid: Solid) -> float:
    """Inertia of a wheel about an axis across its axle [kg m²], as of a cylinder."""
    return solid.wheel_inertia / 2 + solid.wheel_mass * drivetrain.wheel_width**2 / 12


def _chassis_inertias(
    drivetrain: Drivetrain, solid: Solid
) -> tuple[float, float, float, float, float, float]:
    """Centre of mass x and height [m], mass [kg], inertias about x, y and z [kg m²] of the robot without its wheels."""
    wheels, radius = 4 * solid.wheel_mass, drivetrain.wheel_radius
    mass = drivetrain.mass - wheels
    if mass <= 0.0:
        return 0.0, 0.0, mass, 0.0, 0.0, 0.0
    x = drivetrain.mass * drivetrain.com_x / mass
    height = (drivetrain.mass * drivetrain.com_height - wheels * radius) / mass
    # Steiner's theorem, from the centre of mass of the whole robot.
    x_squares = (
        wheels * ((drivetrain.wheel_base / 2) ** 2 + drivetrain.com_x**2) + mass * (x - drivetrain.com_x) ** 2
    )
    y_squares = wheels * (drivetrain.track / 2) ** 2
    z_squares = wheels * (radius - drivetrain.com_height) ** 2 + mass * (height - drivetrain.com_height) ** 2
    across = 4 * _inertia_across(drivetrain, solid)
    roll = solid.roll_inertia - y_squares - z_squares - across
    pitch = solid.pitch_inertia - x_squares - z_squares - 4 * solid.wheel_inertia
    yaw = drivetrain.inertia - x_squares - y_squares - across
    return x, height, mass, roll, pitch, yaw


def _set_inertial(body: mujoco.MjsBody, mass: float, com: list[float], inertias: list[float]) -> None:
    body.explicitinertial = True
    body.mass, body.ipos, body.iquat, body.inertia = mass, com, [1.0, 0.0, 0.0, 0.0], inertias
