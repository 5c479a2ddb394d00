"""Motion of a robot whose wheels slide on the floor, as a planar body under box friction.

Each wheel follows its controller exactly and touches the floor at both edges of its tread. Friction opposes the
sliding of a contact along two directions, each bounded by μ N on its own, as in Open Dynamics Engine (ODE). A sweep
over the contacts (projected Gauss–Seidel) finds the impulses of each millisecond.

The first direction may be fixed to the wheel's material, as `fdir1` of a Gazebo model is. It then turns with the
wheel, up and down through the floor: cos φ of it is horizontal, and the rest of the force loads or lifts the wheel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from lme.types import Floats

MAX_STEP = 1e-3  # [s] as in Gazebo
SWEEPS = 2  # over the contacts per step
GRAVITY = 9.81  # [m/s²]
AXES = ("wheel", "world", "body")  # frames to which the friction directions may be fixed

_WHEEL, _WORLD = AXES.index("wheel"), AXES.index("world")
_CONTACTS = 8


class Chassis(NamedTuple):
    """Mass [kg], inertia about the vertical [kg m²], lengths [m] and friction coefficient of a robot on wheels."""

    mass: float
    inertia: float
    com_x: float  # of the centre of mass, ahead of the middle of the wheels
    com_height: float
    track: float
    wheel_base: float  # 0: one axle, and casters that bear no load
    wheel_radius: float
    wheel_width: float
    friction: float
    separation_multiplier: float  # the controller's track, in tracks
    lag: float = 0.0  # [s] time constant with which the wheels approach the command


class WheelState(NamedTuple):
    """State that a step changes in place.

    body (6,): x, y, yaw and velocities vx, vy, ω of the centre of mass, in the world. wheels (4,): v and ω that the
    controller has reached, angles of the left and right wheels. acceleration (2,): of the centre of mass in the
    last step, ahead and left. grip (16,): impulses of the contacts in the last step. odometry (2,): x, y.
    """

    body: Floats
    wheels: Floats
    acceleration: Floats
    grip: Floats
    odometry: Floats


@njit(cache=True, error_model="numpy")
def slide(
    state: WheelState,
    chassis: Chassis,
    command: tuple[float, float],
    limits: tuple[float, float, float, float],
    factors: tuple[float, float],
    axes: int,
    yaw_errors: Floats,
    duration: float,
    count: int,
) -> Floats:
    """Drive, and return poses (count, 3) of the base at equal times up to `duration` [s]. Changes the state.

    command (v, ω); limits (v_max, ω_max, α_v, α_ω) of the controller; factors: ground per metre of tread, left and
    right; axes: index into AXES. yaw_errors: of the measured yaw [rad], by which odometry moves, in equal parts of
    the time.
    """
    points = _contacts(chassis)
    rows = np.empty((2 * _CONTACTS, 5))
    poses = np.empty((count, 3))
    body, wheels = state.body, state.wheels
    # Equal steps of at most MAX_STEP, a whole number of them for each pose.
    per_pose = math.ceil(duration / count / MAX_STEP - 1e-9)
    steps = count * per_pose
    dt = duration / steps
    gain = 1.0 - math.exp(-dt / chassis.lag) if chassis.lag > 0.0 else 1.0
    for k in range(steps):
        left, right = _turn_wheels(wheels, chassis, command, limits, gain, dt)
        _grip(state, chassis, points, rows, (left * factors[0], right * factors[1]), axes, dt)
        # Semi-implicit Euler: the friction has changed the velocity, which now moves the body.
        for i in range(3):
            body[i] += dt * body[i + 3]
        heading = body[2] + yaw_errors[k * len(yaw_errors) // steps]
        state.odometry[0] += dt * wheels[0] * math.cos(heading)
        state.odometry[1] += dt * wheels[0] * math.sin(heading)
        if (k + 1) % per_pose == 0:
            # From the centre of mass back to the base.
            pose = poses[k // per_pose]
            pose[0] = body[0] - chassis.com_x * math.cos(body[2])
            pose[1] = body[1] - chassis.com_x * math.sin(body[2])
            pose[2] = body[2]
    return poses


@njit(cache=True, error_model="numpy")
def _contacts(chassis):
    """Contacts (8, 5): x, y from the centre of mass, load at rest [N], −1 in front or 1, −1 at the left or 1."""
    points = np.empty((_CONTACTS, 5))
    half_base, weight = chassis.wheel_base / 2, chassis.mass * GRAVITY
    lean = chassis.com_x / chassis.wheel_base if chassis.wheel_base > 0.0 else 0.0
    for i in range(_CONTACTS):
        # Two contacts for each wheel, at both edges of its tread.
        end = 1.0 if i < _CONTACTS // 2 else -1.0
        side = i // 2 % 2
        edge = (i % 2 - 0.5) * chassis.wheel_width
        points[i, 0] = end * half_base - chassis.com_x
        points[i, 1] = (0.5 - side) * chassis.track + edge
        # Load at rest: its part of the weight, by the lever of the centre of mass.
        points[i, 2] = weight * (0.5 + end * lean) / (_CONTACTS // 2)
        points[i, 3], points[i, 4] = -end, 2.0 * side - 1.0
    return points


@njit(cache=True, error_model="numpy")
def _turn_wheels(wheels, chassis, command, limits, gain, dt):
    """Advance the controller and the wheels by one step; return the speeds of the treads [m/s], left and right.

    The controller moves by a share of the difference to the command, as far as its acceleration allows.
    """
    for i in range(2):
        goal = min(max(command[i], -limits[i]), limits[i])
        max_change = limits[i + 2] * dt
        wheels[i] += min(max(gain * (goal - wheels[i]), -max_change), max_change)
    # Treads of a differential drive: v ∓ ω b / 2, with b the track times its multiplier.
    turn = wheels[1] * chassis.track * chassis.separation_multiplier / 2
    left, right = wheels[0] - turn, wheels[0] + turn
    wheels[2] += dt * left / chassis.wheel_radius
    wheels[3] += dt * right / chassis.wheel_radius
    return left, right


@njit(cache=True, error_model="numpy")
def _grip(state, chassis, points, rows, treads, axes, dt):
    """Change the body's velocity by the friction of one step."""
    body, grip = state.body, state.grip
    cos, sin = math.cos(body[2]), math.sin(body[2])
    _fill_rows(state, chassis, points, rows, (cos, sin), axes, dt)
    vx, vy, omega = body[3], body[4], body[5]
    per_mass, per_inertia = 1.0 / chassis.mass, 1.0 / chassis.inertia
    grip[:] = 0.0
    # Projected Gauss–Seidel on the impulses: each one stops the sliding along its row, within its bound.
    for _ in range(SWEEPS):
        for i in range(2 * _CONTACTS):
            tread = treads[i // 4 % 2]
            x, y, turn = rows[i, 0], rows[i, 1], rows[i, 2]
            # Speed of the contact relative to the tread, along the direction of the row.
            sliding = (vx - tread * cos) * x + (vy - tread * sin) * y + omega * turn
            previous = grip[i]
            grip[i] = min(max(previous - sliding * rows[i, 3], -rows[i, 4]), rows[i, 4])
            change = grip[i] - previous
            vx += change * x * per_mass
            vy += change * y * per_mass
            omega += change * turn * per_inertia
    # Acceleration in the body frame, from which the next step takes the load transfer.
    ax, ay = (vx - body[3]) / dt, (vy - body[4]) / dt
    state.acceleration[0], state.acceleration[1] = cos * ax + sin * ay, cos * ay - sin * ax
    body[3], body[4], body[5] = vx, vy, omega


@njit(cache=True, error_model="numpy")
def _fill_rows(state, chassis, points, rows, heading, axes, dt):
    """Fill rows (16, 5), two directions a contact: x, y, lever [m], impulse that stops 1 m/s [kg], bound [N s]."""
    cos, sin = heading
    level = (math.cos(state.wheels[2]), math.cos(state.wheels[3]))
    lift = (math.sin(state.wheels[2]) / dt, math.sin(state.wheels[3]) / dt)
    per_mass, per_inertia = 1.0 / chassis.mass, 1.0 / chassis.inertia
    shift = _load_transfer(chassis, state.acceleration)
    for i in range(_CONTACTS):
        side = i // 2 % 2
        # Load at rest, plus what acceleration moves between the wheels.
        load = points[i, 2] + points[i, 3] * shift[0] + points[i, 4] * shift[1]
        x, y = (1.0, 0.0) if axes == _WORLD else (cos, sin)
        if axes == _WHEEL:
            load += state.grip[2 * i] * lift[side]
            x, y = x * level[side], y * level[side]
        lever_x = cos * points[i, 0] - sin * points[i, 1]
        lever_y = sin * points[i, 0] + cos * points[i, 1]
        square = (x * x + y * y) * per_mass
        for j in range(2 * i, 2 * i + 2):
            # The impulse that stops 1 m/s is 1 / (1/m + lever² / I) along a direction of length 1.
            turn = lever_x * y - lever_y * x
            yielding = square + turn * turn * per_inertia
            rows[j, 0], rows[j, 1], rows[j, 2] = x, y, turn
            rows[j, 3] = 1.0 / yielding if yielding > 1e-12 else 0.0  # 0: the direction is vertical
            rows[j, 4] = chassis.friction * max(load, 0.0) * dt
            x, y = -y, x


@njit(cache=True, error_model="numpy")
def _load_transfer(chassis, acceleration):
    """Load that acceleration moves from a front to a rear contact and from a left to a right one [N]."""
    force = chassis.mass * chassis.com_height / (_CONTACTS // 2)
    base = chassis.wheel_base
    return force * acceleration[0] / base if base > 0.0 else 0.0, force * acceleration[1] / chassis.track
