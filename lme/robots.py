"""Robots: footprint, lidar, limits, the drivetrain that moves them, and how fast a command may change.

Each robot is one YAML in `conf/robot/`.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, fields, replace

import numpy as np

from lme.errors import argument_error, require
from lme.inputs.plausibility import check_fields, check_mount
from lme.types import Floats, Limits, Pose, Twist

_MOST_BEAMS = 100_000  # of a lidar


@dataclass(slots=True)
class Footprint:
    """The robot's outline from above, centred on the base frame: a disc or a rectangle."""

    radius: float | None = None  # [m], of a disc
    length: float | None = None  # [m], of a rectangle, along x
    width: float | None = None  # [m], of a rectangle, along y

    def __post_init__(self) -> None:
        disc = self.radius is not None
        sides = (self.length is not None) + (self.width is not None)
        if (disc and sides) or (not disc and sides != 2):
            radius, length, width = (
                "null" if value is None else value for value in (self.radius, self.length, self.width)
            )
            raise argument_error(
                f"radius is {radius}, length {length} and width {width}: "
                "give either a radius (disc) or a length and a width (rectangle), and null for the rest"
            )
        for key in ("radius", "length", "width"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)
        check_fields(self)

    @property
    def box(self) -> tuple[float, float, float]:
        """(half_length, half_width, rounding) [m]; a disc is a point with a rounding of its radius."""
        if self.radius is not None:
            return 0.0, 0.0, float(self.radius)
        assert self.length is not None
        assert self.width is not None
        return self.length / 2, self.width / 2, 0.0

    @property
    def inscribed_radius(self) -> float:
        """Radius of the largest disc inside the footprint [m] (paper §III.G)."""
        half_length, half_width, rounding = self.box
        return min(half_length, half_width) + rounding

    @property
    def circumscribed_radius(self) -> float:
        """Radius of the smallest disc around the footprint [m] (paper §III.G)."""
        half_length, half_width, rounding = self.box
        return math.hypot(half_length, half_width) + rounding

    def outline(self, padding: float = 0.0) -> Floats:
        """Corners (P, 2) of the footprint [m], with each side moved out by `padding` [m]; 16 around a disc."""
        half_length, half_width, rounding = self.box
        if rounding > 0.0:
            angles = np.arange(16) * math.tau / 16.0
            return (rounding + padding) * np.column_stack([np.cos(angles), np.sin(angles)])
        corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
        return corners * [half_length + padding, half_width + padding]


@dataclass(slots=True)
class Controller:
    """The wheels' velocity controller. Wheel speeds follow v and ω, which ramp to the command."""

    v_max: float  # [m/s]
    omega_max: float  # [rad/s]
    alpha_v: float  # [m/s²]
    alpha_omega: float  # [rad/s²]
    separation_multiplier: float = 1.0  # [-] the track that the controller assumes / the real one
    timeout: float = 0.25  # [s] without a command, after which the wheels stop

    def __post_init__(self) -> None:
        for field in fields(self):
            require(field.name, getattr(self, field.name), above=0.0)
        check_fields(self)


@dataclass(slots=True)
class Solid:
    """What is known of a robot's parts in three dimensions: a box between four wheels."""

    chassis_length: float  # [m] of the box
    chassis_width: float  # [m]
    roll_inertia: float  # [kg m²] of the whole robot, about the axis ahead through its centre of mass
    pitch_inertia: float  # [kg m²] about the axis to the left
    wheel_mass: float  # [kg] of each wheel
    wheel_inertia: float  # [kg m²] about its axle

    def __post_init__(self) -> None:
        for field in fields(self):
            require(field.name, getattr(self, field.name), above=0.0)
        check_fields(self)


@dataclass(slots=True)
class Drivetrain:
    """Four wheels on a floor, or two on one axle, and the body that they carry.

    contact: outline that collides, if it is not the footprint that the robot is given, for instance since the wheels
    stand out; None: the footprint. solid: for `sim=mujoco`; None: not known.
    """

    mass: float  # [kg] of the whole robot
    inertia: float  # [kg m²] of the whole robot, about the vertical through its centre of mass
    track: float  # [m] between the middles of left and right wheels
    wheel_radius: float  # [m]
    friction: float  # [-] coefficient between wheel and floor
    controller: Controller
    wheel_base: float = 0.0  # [m] between the axles; 0: two wheels, and casters that bear no load
    wheel_width: float = 0.0  # [m]
    com_x: float = 0.0  # [m] centre of mass ahead of the middle of the wheels
    com_height: float = 0.0  # [m] over the floor
    contact: Footprint | None = None
    solid: Solid | None = None

    def __post_init__(self) -> None:
        for key in ("mass", "inertia", "track", "wheel_radius", "friction"):
            require(key, getattr(self, key), above=0.0)
        for key in ("wheel_base", "wheel_width", "com_height"):
            require(key, getattr(self, key), at_least=0.0)
        if not abs(self.com_x) <= self.wheel_base / 2:
            raise argument_error(
                f"com_x is {self.com_x:g} m: must lie between the axles, within ±{self.wheel_base / 2:g}"
            )
        check_fields(self)


@dataclass(slots=True)
class Response:
    """Ground velocity of a real robot: after a delay it ramps to a share of the command."""

    gain_v: float  # [-] v over ground per v of the command
    gain_omega: float  # [-]
    delay_v: float  # [s]
    delay_omega: float  # [s]
    alpha_v: float  # [m/s²] over ground
    alpha_omega: float  # [rad/s²]

    def __post_init__(self) -> None:
        for key in ("gain_v", "gain_omega", "alpha_v", "alpha_omega"):
            require(key, getattr(self, key), above=0.0)
        for key in ("delay_v", "delay_omega"):
            require(key, getattr(self, key), at_least=0.0)
        check_fields(self)


@dataclass(slots=True)
class Cap:
    """Highest speeds that a system commands, where the robot's limits are higher; None: the robot's limits."""

    v_max: float | None = None  # [m/s]
    omega_max: float | None = None  # [rad/s]

    def __post_init__(self) -> None:
        for key in ("v_max", "omega_max"):
            if getattr(self, key) is not None:
                require(key, getattr(self, key), above=0.0)
        check_fields(self)

    def of(self, limits: Limits) -> Limits:
        """Return the limits, lowered to this cap."""
        v_max, omega_max = (math.inf if value is None else value for value in (self.v_max, self.omega_max))
        return limits._replace(v_max=min(limits.v_max, v_max), omega_max=min(limits.omega_max, omega_max))


@dataclass(slots=True)
class Cloud:
    """A level 3D lidar, in simulation a Livox Mid-360. The scan consists of the points within a range of heights.

    All heights are above the ground. The sensor is at (x, y) in the base frame, and the scan is what the base would
    see of the points, as with `pointcloud_to_laserscan`.
    """

    height: float  # [m] of the sensor
    min_height: float  # [m] of the lowest points that count
    max_height: float  # [m] of the highest
    duration: float = 0.1  # [s] in which the points of one cloud are taken
    x: float = 0.0  # [m] of the sensor in the base frame
    y: float = 0.0  # [m]

    def __post_init__(self) -> None:
        require("height", self.height, above=0.0)
        for key in ("x", "y"):
            require(key, getattr(self, key))
        require("min_height", self.min_height)
        require("max_height", self.max_height, above=self.min_height)
        require("duration", self.duration, above=0.0)
        check_fields(self)


@dataclass(slots=True)
class Lidar:
    """The source of planar scans, mounted on the base at (x, y, yaw).

    native_beams: beams that the scanner fires over its field of view, if the scan is interpolated from them. height:
    height of a planar scanner above the floor, which it sees when the robot tilts (`sim.tilt`); None if not known.
    shadow_angle: of the filter against returns between two surfaces (`lme.perception.shadows`); None: no filter.
    cloud: the 3D lidar that makes the scan; None for a planar scanner.
    """

    num_beams: int
    fov: float  # [rad], 2π for a full circle
    range_min: float  # [m]
    range_max: float  # [m]
    noise_std: float = 0.0  # [m], of the Gaussian noise on every range
    x: float = 0.0  # [m], of the mount in the base frame
    y: float = 0.0  # [m]
    yaw: float = 0.0  # [rad]
    native_beams: int | None = None
    height: float | None = None  # [m]
    shadow_angle: float | None = None  # [rad]
    cloud: Cloud | None = None

    def __post_init__(self) -> None:
        for key in ("num_beams", "native_beams"):
            beams = getattr(self, key)
            if key == "num_beams" or beams is not None:
                require(key, beams, above=1, at_most=_MOST_BEAMS)
                if beams != int(beams):
                    raise argument_error(f"{key} is {beams:g}: must be a whole number")
        if self.fov > 2 * math.pi + 1e-6:
            raise argument_error(f"fov is {self.fov:g} rad: must be at most 6.28319; is it in degrees?")
        require("fov", self.fov, above=0.0, at_most=2 * math.pi + 1e-6)
        require("range_min", self.range_min, at_least=0.0)
        if not self.range_min < self.range_max < math.inf:
            raise argument_error(
                f"range_max is {self.range_max:g}: must be greater than range_min {self.range_min:g}, and finite"
            )
        require("noise_std", self.noise_std, at_least=0.0)
        for key in ("x", "y", "yaw"):
            require(key, getattr(self, key))
        if self.height is not None:
            require("height", self.height, above=0.0)
        if self.shadow_angle is not None:
            require("shadow_angle", self.shadow_angle, above=0.0, at_most=math.pi / 4)
            if self.cloud is not None:
                raise argument_error(
                    f"shadow_angle is {self.shadow_angle:g} rad with a cloud: must be null, since the filter is "
                    "for the beams of a planar scanner"
                )
        if self.cloud is not None and (self.native_beams is not None or not self.full_circle):
            raise argument_error(
                f"cloud is set with fov {self.fov:g} rad and native_beams {self.native_beams}: "
                "a cloud makes a full circle (fov 2π) without native_beams"
            )
        for key in ("x", "y", "yaw"):
            if self.cloud is not None and getattr(self, key) != 0.0:
                raise argument_error(
                    f"{key} is {getattr(self, key):g} with a cloud: must be 0, since its scan is seen from the base; "
                    "cloud.x and cloud.y are where the sensor is"
                )
        check_fields(self)

    @property
    def native(self) -> Lidar:
        """The scanner whose scans are interpolated; this one if they are not."""
        if self.native_beams is None:
            return self
        return replace(self, num_beams=self.native_beams, native_beams=None)

    @property
    def full_circle(self) -> bool:
        """Return whether there is no blind arc, so that the first beam follows the last."""
        return self.fov >= 2 * math.pi - 1e-6

    @property
    def angle_min(self) -> float:
        """Bearing of the first beam in the lidar's frame [rad]; the field of view is symmetric about 0."""
        return -self.fov / 2

    @property
    def angle_increment(self) -> float:
        """Angle between neighbouring beams [rad]; in a full circle the last beam is not the first again."""
        return self.fov / (self.num_beams if self.full_circle else self.num_beams - 1)

    @property
    def mount(self) -> Pose:
        """The pose of the scan's frame in the base frame: that of a planar scanner, or the base itself for a cloud."""
        return Pose(self.x, self.y, self.yaw)

    @property
    def sensor(self) -> Pose:
        """The pose of the sensor in the base frame."""
        return self.mount if self.cloud is None else Pose(self.cloud.x, self.cloud.y, 0.0)


@dataclass(slots=True)
class Robot:
    """A robot with a 2D lidar that is driven like a differential-drive robot, by v and omega."""

    name: str
    footprint: Footprint
    v_max: float  # [m/s]
    omega_max: float  # [rad/s]
    alpha_v: float  # [m/s²]
    alpha_omega: float  # [rad/s²]
    control_rate: float  # [Hz]
    lidar: Lidar
    collision_radius: float | None = None  # [m], LME's r; None: the circumscribed radius of the footprint
    drivetrain: Drivetrain | None = None  # for sim=skid
    response: Response | None = None  # for sim=skid, in place of a drivetrain
    v_min: float | None = None  # [m/s], at most 0: it backs up no faster; None: −v_max
    settling_time: float = 0.0  # [s] of motion after a command has changed; for `MinTime` and `Dwa`

    def __post_init__(self) -> None:
        for key, kind in (("footprint", Footprint), ("lidar", Lidar)):
            if not isinstance(getattr(self, key), kind):
                raise argument_error(f"{key} is {getattr(self, key)!r:.80}: must be an lme.{kind.__name__}")
        for key in ("v_max", "omega_max", "alpha_v", "alpha_omega", "control_rate"):
            require(key, getattr(self, key), above=0.0)
        if self.v_min is not None:
            require("v_min", self.v_min, at_most=0.0)
        require("settling_time", self.settling_time, at_least=0.0)
        if self.collision_radius is not None:
            # Below r_min no subgoal is reachable (paper §III.G).
            radius = self.collision_radius
            r_min, r_max = self.footprint.inscribed_radius, self.footprint.circumscribed_radius
            if radius < r_min:
                raise argument_error(
                    f"collision_radius is {radius:g} m, less than the footprint's inner radius {r_min:.3g} m: "
                    f"must be at least {r_min:.3g}, better {r_max:.3g} (null)"
                )
            require("collision_radius", radius, above=0.0)
        if self.drivetrain is not None and self.response is not None:
            raise argument_error("drivetrain and response are both set: must be one, and null for the other")
        check_fields(self)
        check_mount("lidar", self.lidar.sensor.x, self.lidar.sensor.y, self.footprint.circumscribed_radius)

    @property
    def limits(self) -> Limits:
        v_min = -math.inf if self.v_min is None else self.v_min
        return Limits(self.v_max, self.omega_max, self.alpha_v, self.alpha_omega, v_min)

    def capped(self, cap: Cap) -> Robot:
        """Return the robot as a system with this cap on its commands sees it."""
        limits, capped = cap.of(self.limits), copy.copy(self)  # not `replace`, which would warn again
        capped.v_max, capped.omega_max = limits.v_max, limits.omega_max
        return capped

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return 1.0 / self.control_rate

    @property
    def r(self) -> float:
        """The collision radius that LME plans with [m]: r_max unless it is set (paper §III.G)."""
        return self.footprint.circumscribed_radius if self.collision_radius is None else self.collision_radius

    @property
    def radius_note(self) -> str:
        """Consequence of a collision radius below r_max (paper §III.G), in words; empty if it is not below."""
        radius, r_max = self.collision_radius, self.footprint.circumscribed_radius
        if radius is None or radius >= r_max:
            return ""
        return (
            f"collision_radius {radius:g} m is less than the footprint's outer radius {r_max:.3g} m: "
            "some subgoals are reachable in some orientations only"
        )


def reachable(v: float, omega: float, twist: Twist, limits: Limits, dt: float) -> Twist:
    """Return the twist nearest to (v, ω) within the limits of velocity that can be reached from `twist` in `dt` [s]."""
    v = min(max(v, limits.lowest), limits.v_max)
    omega = min(max(omega, -limits.omega_max), limits.omega_max)
    return Twist(
        towards(v, twist.v, limits.alpha_v, dt),
        towards(omega, twist.omega, limits.alpha_omega, dt),
    )


def towards(goal: float, rate: float, alpha: float, dt: float) -> float:
    """Return the rate nearest to `goal` that is reachable from `rate` in a period `dt` at acceleration `alpha`."""
    return min(max(goal, rate - alpha * dt), rate + alpha * dt)
