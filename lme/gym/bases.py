"""Bases of many robots: wheels that follow commands at once, wheels in substeps, and wheels that slide.

To the last bit, each moves as in `sim=fast` or `sim=skid`.
"""

from __future__ import annotations

import math
from dataclasses import asdict

import numpy as np

from lme.geometry.skid import AXES, Chassis, WheelState
from lme.gym.kernels.crowds import Crowds, Walkers
from lme.gym.kernels.delays import Gaits, Queues
from lme.gym.kernels.poses import compose
from lme.gym.kernels.rolling import Encoders, reckon, roll
from lme.gym.kernels.sliding import slide_all
from lme.gym.kernels.steps import Bodies, Obstacles, Places, States, advance
from lme.robots import Robot
from lme.simulation.disturbances import Disturbances
from lme.simulation.fast import FastConfig, num_substeps
from lme.simulation.gait import damping_ratio, transition_of
from lme.simulation.skid.simulator import MAX_SUBSTEP, ODOMETRY_RATE, SkidConfig, check_base
from lme.simulation.substeps import track
from lme.types import Floats, Ints

Generators = list[np.random.Generator]
Scene = tuple[States, Bodies, Places, Obstacles]
Movers = tuple[Crowds | None, Walkers | None]
NOTHING_MOVES: Movers = (None, None)


class ExactBases:
    """Wheels that follow commands at once, within the limits: `sim=fast` without substeps and movers."""

    def __init__(self, config: FastConfig, dt: float, states: States) -> None:
        """states: of N robots, whose twists and poses are what the encoders report."""
        odometry = np.zeros_like(states.poses)
        self.encoders = Encoders(states.twists, odometry, states.twists, states.poses)
        self._timing = dt, float(config.max_step), config.even_ramp
        self._starts = np.zeros_like(odometry) if config.disturbs_sensors else None

    def begin(self, i: int, robot: Robot, rng: np.random.Generator, start: Floats) -> None:
        """Put robot i at rest at the start of an episode."""
        self.encoders.odometry[i] = 0.0
        if self._starts is not None:
            self._starts[i] = start

    def advance(self, robots: Ints, scene: Scene, commands: Floats, movers: Movers = NOTHING_MOVES) -> None:
        """Drive robots (K,) for one control period, or until contact or arrival. commands (N, 2) [m/s, rad/s].

        movers: not among these robots.
        """
        advance(robots, *scene, commands, *self._timing)
        if self._starts is not None:
            reckon(robots, scene[0].poses, self._starts, self.encoders.odometry)


class DelayedBases:
    """What other bases of N robots have in common: the queue of commands, the gait and the wheels' slip."""

    def __init__(self, config: Disturbances, dt: float, n: int) -> None:
        self.encoders = Encoders(*(np.zeros((n, size)) for size in (2, 3, 2, 3)))
        self._config, self._dt, self._starts = config, dt, np.zeros((n, 3))
        self._slip_rngs: Generators = [np.random.default_rng(0)] * n
        self._factors = np.ones((n, 2))  # ground per metre of tread, left and right
        size = int(config.latency / dt) + 4
        first, counts = np.zeros(n, np.int64), np.zeros(n, np.int64)
        self._queues = Queues(np.zeros((n, size)), np.zeros((n, size, 2)), first, counts, np.zeros((n, 2)))
        self._frequencies = config.natural_frequency_v, config.natural_frequency_omega
        self._dampings = [damping_ratio(share) for share in (config.overshoot_v, config.overshoot_omega)]
        is_followed = np.array(self._frequencies)
        self._gaits = Gaits(np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2, 3, 3)), is_followed)

    def begin(self, i: int, robot: Robot, rng: np.random.Generator, start: Floats) -> None:
        """Put robot i at rest at the start of an episode."""
        self._starts[i] = self.encoders.scans[i] = start
        arrays = (*self.encoders[:3], *self._queues[2:], self._gaits.twists, self._gaits.rates)
        for array in arrays:
            array[i] = 0

    def _set_gait(self, i: int, dt: float) -> None:
        """Prepare the gait of robot i for steps of `dt` [s]."""
        for axis, frequency in enumerate(self._frequencies):
            if frequency > 0.0:
                self._gaits.transitions[i, axis] = transition_of(frequency, self._dampings[axis], dt)

    def _draw_slip(self, robots: Ints) -> None:
        """Draw how far the wheels of robots (K,) slip in the next period."""
        if self._config.slip > 0.0:
            for i in robots.tolist():
                self._factors[i] = 1.0 + self._config.slip * self._slip_rngs[i].standard_normal(2)


class RollingBases(DelayedBases):
    """Wheels or legs that do not slide, in substeps: `sim=fast` among movers, with a delay or with a gait."""

    def __init__(self, config: FastConfig, dt: float, n: int) -> None:
        super().__init__(config, dt, n)
        self._counts, self._tracks = np.ones(n, np.int64), np.zeros(n)
        self._rules = dt, float(config.latency), float(config.lag), config.even_ramp

    def begin(
        self, i: int, robot: Robot, rng: np.random.Generator, start: Floats, fastest_mover: float = 0.0
    ) -> None:
        """Put robot i at rest at the start of an episode. fastest_mover: greatest speed of the movers [m/s]."""
        super().begin(i, robot, rng, start)
        (self._slip_rngs[i],) = rng.spawn(1)
        assert isinstance(self._config, FastConfig)
        self._counts[i], self._tracks[i] = (
            num_substeps(robot, self._config, fastest_mover),
            track(robot.footprint),
        )
        self._set_gait(i, robot.dt / self._counts[i])

    def advance(self, robots: Ints, scene: Scene, commands: Floats, movers: Movers = NOTHING_MOVES) -> None:
        """Drive robots (K,) for one control period, or until contact or arrival. commands (N, 2) [m/s, rad/s]."""
        self._draw_slip(robots)
        sizes = self._counts, self._tracks, self._factors
        roll(robots, *scene, commands, *sizes, self._queues, self._gaits, self.encoders, self._rules, *movers)


class SlidingBases(DelayedBases):
    """Wheels that slide on the floor: `sim=skid` and `sim=gazebo`."""

    def __init__(self, config: SkidConfig, dt: float, n: int, among_movers: bool = False) -> None:
        super().__init__(config, dt, n)
        is_divided = among_movers or config.latency or config.has_gait
        self._pieces = math.ceil(dt / MAX_SUBSTEP - 1e-9) if is_divided else 1
        self._yaw_rngs: Generators = [np.random.default_rng(0)] * n
        duration = dt / self._pieces
        self._yaw_errors = np.zeros((n, self._pieces, math.ceil(duration * ODOMETRY_RATE - 1e-9)))
        self._yaw_noise, self._scan_rate, self._phases = config.yaw_noise, config.scan_rate, np.zeros(n)
        self._chassis, self._limits = np.zeros((n, len(Chassis._fields))), np.zeros((n, 4))
        self._wheels = WheelState(*(np.zeros((n, size)) for size in (6, 4, 2, 16, 2)))
        scans = float(self._scan_rate or 0.0), float(config.check_time)
        self._rules = dt, float(config.latency), AXES.index(config.friction), self._pieces, *scans

    def begin(
        self, i: int, robot: Robot, rng: np.random.Generator, start: Floats, fastest_mover: float = 0.0
    ) -> None:
        """Put robot i at rest at the start of an episode. fastest_mover: does not matter here."""
        check_base(robot)
        super().begin(i, robot, rng, start)
        self._set_gait(i, self._dt / self._pieces)
        self._slip_rngs[i], self._yaw_rngs[i], phase_rng = rng.spawn(3)
        self._phases[i] = phase_rng.uniform() / self._scan_rate if self._scan_rate else 0.0
        # Drivetrain, and the state of the wheels and of the centre of mass.
        assert robot.drivetrain is not None
        parameters = asdict(robot.drivetrain)
        controller, _, _ = (parameters.pop(key) for key in ("controller", "contact", "solid"))
        multiplier, _ = controller.pop("separation_multiplier"), controller.pop("timeout")
        self._chassis[i] = Chassis(**parameters, separation_multiplier=multiplier, lag=self._config.lag)
        self._limits[i] = list(controller.values())
        for array in self._wheels:
            array[i] = 0.0
        self._wheels.body[i, :3] = compose(tuple(start), (robot.drivetrain.com_x, 0.0, 0.0))
        self._wheels.odometry[i] = start[:2]

    def advance(self, robots: Ints, scene: Scene, commands: Floats, movers: Movers = NOTHING_MOVES) -> None:
        """Drive robots (K,) for one control period, or until contact or arrival. commands (N, 2) [m/s, rad/s]."""
        self._draw_slip(robots)
        if self._yaw_noise > 0.0:
            for i in robots.tolist():
                noise = self._yaw_rngs[i].standard_normal(self._yaw_errors[i].size)
                self._yaw_errors[i] = self._yaw_noise * noise.reshape(self._yaw_errors[i].shape)
        drive = self._chassis, self._limits, self._factors, self._yaw_errors, self._wheels
        origin = self._starts, self._phases
        delays = self._queues, self._gaits
        slide_all(robots, *scene, commands, *drive, *origin, *delays, self.encoders, self._rules, *movers)
