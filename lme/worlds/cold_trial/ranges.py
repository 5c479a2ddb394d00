"""Ranges from which a robot and the simulator's disturbances are drawn, uniformly."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np

from lme.errors import InputError, require
from lme.robots import Footprint, Lidar, Robot

DISTURBANCES = ("latency", "slip", "scan_noise")  # keys of every simulator

_MAY_BE_ZERO = (*DISTURBANCES, "blind_arc", "range_min")


@dataclass(slots=True)
class TrialRanges:
    """[lowest, highest] of each value, drawn anew for every episode. The names of the robot's limits are `Robot`'s."""

    size: list[float] = field(default_factory=lambda: [0.2, 0.8])  # [m] diameter, or length and width
    v_max: list[float] = field(default_factory=lambda: [0.3, 2.0])  # [m/s]
    omega_max: list[float] = field(default_factory=lambda: [0.8, 4.0])  # [rad/s]
    alpha_v: list[float] = field(default_factory=lambda: [0.5, 5.0])  # [m/s²]
    alpha_omega: list[float] = field(default_factory=lambda: [1.0, 10.0])  # [rad/s²]
    control_rate: list[float] = field(default_factory=lambda: [5.0, 20.0])  # [Hz]
    num_beams: list[float] = field(default_factory=lambda: [180.0, 1080.0])  # of the lidar
    range_min: list[float] = field(default_factory=lambda: [0.02, 0.1])  # [m]
    range_max: list[float] = field(default_factory=lambda: [5.0, 30.0])  # [m]
    mount: list[float] = field(
        default_factory=lambda: [-0.5, 0.5]
    )  # of half the length, and of half the width
    blind_arc: list[float] = field(default_factory=lambda: [0.0, math.pi])  # [rad] behind the lidar
    latency: list[float] = field(default_factory=lambda: [0.0, 0.2])  # [s] from a command to its effect
    slip: list[float] = field(
        default_factory=lambda: [0.0, 0.05]
    )  # of each wheel's speed, standard deviation
    scan_noise: list[float] = field(default_factory=lambda: [0.0, 0.02])  # [m] standard deviation

    def __post_init__(self) -> None:
        for each in fields(self):
            self._check(each.name, getattr(self, each.name))
        require("map.ranges.num_beams[0]", self.num_beams[0], above=1)
        require("map.ranges.blind_arc[1]", self.blind_arc[1], at_most=1.9 * math.pi)
        require("map.ranges.range_max[0]", self.range_max[0], above=self.range_min[1])

    def _check(self, key: str, bounds: list[float]) -> None:
        if len(bounds) != 2 or not bounds[0] <= bounds[1]:
            raise InputError(f"map.ranges.{key} is {list(bounds)}: must be [lowest, highest]")
        low, high = f"map.ranges.{key}[0]", f"map.ranges.{key}[1]"
        if key == "mount":  # inside the footprint
            require(low, bounds[0], at_least=-1.0)
            require(high, bounds[1], at_most=1.0)
        elif key in _MAY_BE_ZERO:
            require(low, bounds[0], at_least=0.0)
        else:
            require(low, bounds[0], above=0.0)
        require(high, bounds[1])


def drawn_disturbances(ranges: TrialRanges, rng: np.random.Generator) -> dict[str, float]:
    """A value for each key of the simulator in DISTURBANCES."""
    return {key: float(rng.uniform(*getattr(ranges, key))) for key in DISTURBANCES}


def drawn_robot(name: str, ranges: TrialRanges, rng: np.random.Generator) -> Robot:
    """A disc or a rectangle, as often, whose length is not less than its width, with limits and a lidar."""

    def draw(key: str) -> float:
        return float(rng.uniform(*getattr(ranges, key)))

    width, length = sorted((draw("size"), draw("size")))
    disc = rng.random() < 0.5
    footprint = Footprint(radius=length / 2) if disc else Footprint(length=length, width=width)
    return Robot(
        name=name,
        footprint=footprint,
        v_max=draw("v_max"),
        omega_max=draw("omega_max"),
        alpha_v=draw("alpha_v"),
        alpha_omega=draw("alpha_omega"),
        control_rate=draw("control_rate"),
        lidar=Lidar(
            num_beams=round(draw("num_beams")),
            fov=2 * math.pi - draw("blind_arc"),
            range_min=draw("range_min"),
            range_max=draw("range_max"),
            x=draw("mount") * length / 2,
            y=draw("mount") * (length if disc else width) / 2,
        ),
    )


def columns_of(robot: Robot, disturbances: dict[str, float]) -> dict[str, float | str]:
    """What was drawn, by the name that it has in the records after `world_`."""
    shape, lidar = robot.footprint, robot.lidar
    disc = shape.radius is not None
    low, high = shape.outline().min(axis=0), shape.outline().max(axis=0)
    length, width = (high - low).tolist()
    return {
        "footprint": "disc" if disc else "rectangle",
        "length_m": length,
        "width_m": width,
        "v_max": robot.v_max,
        "omega_max": robot.omega_max,
        "alpha_v": robot.alpha_v,
        "alpha_omega": robot.alpha_omega,
        "control_rate_hz": robot.control_rate,
        "num_beams": float(lidar.num_beams),
        "range_min_m": lidar.range_min,
        "range_max_m": lidar.range_max,
        "blind_arc_rad": 2 * math.pi - lidar.fov,
        "lidar_x_m": lidar.x,
        "lidar_y_m": lidar.y,
        "latency_s": disturbances["latency"],
        "slip": disturbances["slip"],
        "scan_noise_m": disturbances["scan_noise"],
    }
