"""Drivetrain models of a robot: wheels on a floor, or the measured response of a real robot."""

from __future__ import annotations

from dataclasses import dataclass, fields

from lme.errors import argument_error, require
from lme.inputs.plausibility import check_fields


@dataclass(slots=True)
class Controller:
    """The wheels' velocity controller. Wheel speeds follow v and ω, which ramp to the command."""

    v_max: float  # [m/s]
    omega_max: float  # [rad/s]
    alpha_v: float  # [m/s²]
    alpha_omega: float  # [rad/s²]
    separation_multiplier: float = (
        1.0  # [-] the track that the controller assumes, as a multiple of the real one
    )
    timeout: float = 0.25  # [s] without a command, after which the wheels stop

    def __post_init__(self) -> None:
        for field in fields(self):
            require(f"{field.name}", getattr(self, field.name), above=0.0)
        check_fields(self)


@dataclass(slots=True)
class Drivetrain:
    """Four wheels on a floor, or two on one axle, and the body that they carry."""

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
