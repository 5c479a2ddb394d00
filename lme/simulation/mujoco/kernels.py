"""Friction between wheels and floor, as forces on a body in MuJoCo.

MuJoCo's own friction fills a cone or a diamond, and the more a contact slides, the harder it pushes the bodies apart.
Gazebo's engine (ODE) bounds the friction along each of two directions on its own, by μ times the load, whatever
slides. Here MuJoCo gives the loads, and the friction is applied as an external force.
"""

from __future__ import annotations

from numba import njit

from lme.geometry.skid import AXES
from lme.types import Floats, Ints

_WHEEL, _WORLD = AXES.index("wheel"), AXES.index("world")


@njit(cache=True, error_model="numpy")
def apply_friction(
    wrenches: Floats,
    velocities: Floats,
    bodies: tuple[Floats, Floats, Floats],
    contacts: tuple[Floats, Ints, Ints, Floats],
    first: tuple[int, int],
    axes: int,
    friction: float,
    viscosity: float,
) -> bool:
    """Set the forces and torques (B, 6) on the wheels' centres of mass; return whether a shape is near an obstacle.

    velocities (10,): of the chassis in the world, its turn rates in its own frame, and turn rates of the wheels.
    bodies: positions (B, 3), axes (B, 9) and centres of mass (B, 3). contacts: points (C, 3), shapes (C, 2), places of
    the loads (C,), negative for none, and loads [N]. first: body of the chassis, after which come those of the wheels,
    and shape of the first wheel; the floor is shape 0. axes: index into AXES. viscosity: force per speed up to the
    bound [N s/m].
    """
    positions, frames, centres = bodies
    points, shapes, places, loads = contacts
    chassis, first_wheel = first
    vx, vy, vz = velocities[0], velocities[1], velocities[2]
    # Turn rates of the chassis in the world.
    frame = frames[chassis]
    p, q, r = velocities[3], velocities[4], velocities[5]
    wx = frame[0] * p + frame[1] * q + frame[2] * r
    wy = frame[3] * p + frame[4] * q + frame[5] * r
    wz = frame[6] * p + frame[7] * q + frame[8] * r
    length = (frame[0] ** 2 + frame[3] ** 2) ** 0.5
    cos, sin = frame[0] / length, frame[3] / length
    wrenches[chassis + 1 : chassis + 5] = 0.0
    is_near = False
    for i in range(len(points)):
        if min(shapes[i, 0], shapes[i, 1]) != 0:
            is_near = True
            continue
        wheel = max(shapes[i, 0], shapes[i, 1]) - first_wheel
        if wheel < 0 or places[i] < 0:
            continue
        body, bound = chassis + 1 + wheel, friction * loads[places[i]]
        # Velocity of the tread at the contact: that of the chassis there, and of the wheel about its axle.
        x, y, z = points[i] - positions[chassis]
        sx, sy, sz = vx + wy * z - wz * y, vy + wz * x - wx * z, vz + wx * y - wy * x
        x, y, z = points[i] - positions[body]
        rate, ax, ay, az = velocities[6 + wheel], frame[1], frame[4], frame[7]
        sx, sy, sz = (
            sx + rate * (ay * z - az * y),
            sy + rate * (az * x - ax * z),
            sz + rate * (ax * y - ay * x),
        )
        # Two directions; the first may be fixed to the wheel, and the second is level, normal × first, as in ODE.
        tx, ty, tz = cos, sin, 0.0
        if axes == _WORLD:
            tx, ty = 1.0, 0.0
        elif axes == _WHEEL:
            tx, ty, tz = frames[body, 0], frames[body, 3], frames[body, 6]
        along = min(max(-viscosity * (sx * tx + sy * ty + sz * tz), -bound), bound)
        across = min(max(-viscosity * (sy * tx - sx * ty), -bound), bound)
        fx, fy, fz = along * tx - across * ty, along * ty + across * tx, along * tz
        x, y, z = points[i] - centres[body]
        wrenches[body, 0] += fx
        wrenches[body, 1] += fy
        wrenches[body, 2] += fz
        wrenches[body, 3] += y * fz - z * fy
        wrenches[body, 4] += z * fx - x * fz
        wrenches[body, 5] += x * fy - y * fx
    return is_near
