"""Measures `Fleet`, many robots in one compiled call: by number of robots, obstacles and threads; a step, by part.

    python -m benchmarks.fleet [--record]

Configurations take turns in one process, so ratios are valid on a busy machine too. Times are processor times, the
tenth percentile of many short turns; those of threads are wall times, the least. --record also writes
benchmarks/results/fleet.md.
"""

from __future__ import annotations

import itertools
import math
import os
import time
import tracemalloc
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.config.presets import load_robot, load_settings
from lme.gym.fleet import Fleet
from lme.gym.kernels.steps import advance, look
from lme.perception.raycast import cast
from lme.perception.scan_points import obstacle_points
from lme.simulation.fast import FastSimulator
from lme.types import Floats, Pose, Twist
from lme.worlds.contours import outlines
from lme.worlds.movers import ORCA, SCRIPTED, SOCIAL_FORCE, Mover
from lme.worlds.world import Task, World

SECONDS = 3.0  # of a comparison
JACKAL = load_robot("jackal")
LIDAR = replace(JACKAL.lidar, num_beams=720, fov=2 * math.pi, range_max=12.0, noise_std=0.0)
ROBOT = replace(JACKAL, lidar=LIDAR)
CIRCLE = (1.0, 4.0)  # [m/s, rad/s] a circle of 25 cm, without contact


class OneWorld:
    """A map set of one world, whose goal is out of reach."""

    numbers = (0,)

    def __init__(self, world: World) -> None:
        rules = (0.1, 1e9, 0.0)
        self._task = Task("bench", 0, world, Pose(0.0, 0.0, 0.0), np.array([300.0, 0.0]), *rules, 30.0, 15.0)

    def task(self, number: int) -> Task:
        return self._task


def discs(count: int, side: float, radii: tuple[float, float] = (0.1, 0.3)) -> World:
    """Discs in a square [m], none within a metre of the start."""
    rng = np.random.default_rng(0)
    circles = np.column_stack([rng.uniform(-side / 2, side / 2, (count, 2)), rng.uniform(*radii, count)])
    return World(circles=circles[np.hypot(circles[:, 0], circles[:, 1]) > 1.0])


def halls() -> World:
    """Rough walls of cells of 5 cm around rooms of 4 m."""
    solid = np.zeros((720, 1080), dtype=bool)
    solid[::80], solid[:, ::80] = True, True
    solid |= (np.random.default_rng(0).random(solid.shape) < 0.3) & (
        np.roll(solid, 1, 0) | np.roll(solid, 1, 1)
    )
    for door in range(40, 1080, 80):
        solid[:, door - 12 : door + 12] &= (
            solid[:, door - 12 : door + 12] & (np.arange(720) % 80 > 2)[:, None]
        )
    return World(polygons=tuple(outline * 0.05 - [26.0, 18.0] for outline in outlines(solid)))


def among(motion: str, count: int = 8) -> World:
    """A hundred discs, and movers that go to and fro on the sides of a polygon around the start."""
    turns = 2 * math.pi * np.arange(count + 1) / count
    corners = 6.0 * np.column_stack([np.cos(turns), np.sin(turns)])
    sides = itertools.pairwise(corners)
    movers = [
        Mover(path=np.array(side), radius=0.25, motion=motion, repeat="back_and_forth") for side in sides
    ]
    return replace(discs(100, 20.0), movers=tuple(movers))


WORLDS = {
    "100 discs in 20 × 20 m": discs(100, 20.0),
    "10,000 discs in 200 × 200 m": discs(10_000, 200.0),
    "10,000 discs in 20 × 20 m": discs(10_000, 20.0, (0.02, 0.05)),
}
MOVERS = {"cylinders": SCRIPTED, "people (ORCA)": ORCA, "people (social force)": SOCIAL_FORCE}
FEW, MANY = list(WORLDS)[:2]


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "fleet", parser(__doc__, "fleet").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Many robots in one call\n"
    yield f"`python -m benchmarks.fleet --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"A Jackal with {LIDAR.num_beams} beams over 360°, up to {LIDAR.range_max:g} m, without noise; one thread.\n"
    yield "| robots | world | steps of a robot per second | µs |"
    yield "|---:|---|---:|---:|"
    steps = {(n, name): (step_of(world, n), n) for name, world in WORLDS.items() for n in (1, 16, 256)}
    for (n, name), us in turns(steps).items():
        yield f"| {n} | {name} | {1e6 / us:,.0f} | {us:.2f} |"
    met = ", ".join(f"{discs_met(world)} of the {name}" for name, world in WORLDS.items())
    yield f"\nA scan from the start meets {met}."
    yield "\n## Against the simulator of one robot\n"
    yield "| world | edges | simulator alone [µs] | 64 robots [µs each] | times as fast |"
    yield "|---|---:|---:|---:|---:|"
    moving = {f"100 discs and 8 {who}": among(motion) for who, motion in MOVERS.items()}
    for name, world in {**WORLDS, "walls on a lattice": halls(), **moving}.items():
        alone_us, many_us = turns({"alone": (alone(world), 1), "many": (step_of(world, 64), 64)}).values()
        yield f"| {name} | {len(world.edges):,} | {alone_us:.1f} | {many_us:.2f} | {alone_us / many_us:.1f} |"
    yield "\n## Threads\n"
    yield f"{FEW}; least wall time of a step. The last column is what the machine has to give: two fleets that share"
    yield f"nothing, a thread each. The load average before was {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores.\n"
    yield "| robots | one thread [µs per robot] | two | times as fast | two fleets, times as fast |"
    yield "|---|---:|---:|---:|---:|"
    for n in (256, 1024, 4096):
        pair = {threads: (step_of(WORLDS[FEW], n, threads), n) for threads in (1, 2)}
        times = turns({**pair, "apart": (apart(WORLDS[FEW], n), n)}, time.perf_counter, 0.0)
        two, ceiling = times[1] / times[2], times[1] / times["apart"]
        yield f"| {n} | {times[1]:.2f} | {times[2]:.2f} | {two:.2f} | {ceiling:.2f} |"
    yield "\n## A step by part, 256 robots\n"
    yield "| world | motion and contact [µs per robot] | scan | the rest |"
    yield "|---|---:|---:|---:|"
    for name, world in WORLDS.items():
        yield part_row(name, world)
    yield f"\nArrays of 4,096 robots in {MANY}, observations included: {memory():.0f} MB."


def discs_met(world: World) -> int:
    """Number of discs that a scan from the start meets."""
    scan = cast(LIDAR, Pose(0.0, 0.0, 0.0), world.circles)
    points = obstacle_points(scan, LIDAR.mount)
    gaps = np.hypot(*(points[:, None] - world.circles[:, :2]).transpose(2, 0, 1)) - world.circles[:, 2]
    return len(np.unique(np.abs(gaps).argmin(axis=1)))


def step_of(world: World, n: int, threads: int = 1) -> Callable[[], object]:
    """A function that drives a fleet for a control period."""
    fleet = fleet_in(world, n, threads)
    commands = np.tile(CIRCLE, (n, 1))
    return lambda: fleet.step(commands)


def fleet_in(world: World, n: int, threads: int = 1) -> Fleet:
    """A fleet that has been reset."""
    fleet = Fleet(OneWorld(world), ROBOT, n, load_settings("sim/fast"), threads=threads)
    fleet.reset(range(n))
    return fleet


def alone(world: World) -> Callable[[], object]:
    """A function that drives one robot in the simulator."""
    simulator = FastSimulator(load_settings("sim/fast"), ROBOT)
    simulator.reset(OneWorld(world).task(0), np.random.default_rng(0))
    return lambda: simulator.step(Twist(*CIRCLE))


def apart(world: World, n: int) -> Callable[[], object]:
    """A function that drives two fleets of half the robots for a control period, each in a thread."""
    pool, fleets = ThreadPoolExecutor(2), [step_of(world, n // 2) for _ in range(2)]
    return lambda: list(pool.map(lambda step: step(), fleets))


def turns(
    steps: Mapping[Any, tuple[Callable[[], object], int]],
    clock: Callable[[], float] = time.process_time,
    percentile: float = 10.0,
) -> dict[Any, float]:
    """Time of each function per robot [µs]; the number of robots is given with it. They take turns."""
    times: dict[Any, list[float]] = {key: [] for key in steps}
    for step, _ in steps.values():
        step()
    end = time.perf_counter() + SECONDS * len(steps) / 2
    while time.perf_counter() < end:
        for key, (step, n) in steps.items():
            calls = max(1, 64 // n)
            start = clock()
            for _ in range(calls):
                step()
            times[key].append((clock() - start) / calls / n * 1e6)
    return {key: float(np.percentile(values, percentile)) for key, values in times.items()}


def part_row(name: str, world: World) -> str:
    """The row of a world: the two kernels, and what is left of a step."""
    n = 256
    fleet = fleet_in(world, n)
    commands, robots, views = np.tile(CIRCLE, (n, 1)), np.arange(n), fleet.reset()
    scene = fleet._places, fleet._store.obstacles
    timing = (ROBOT.dt, 0.025, False)
    sensor: tuple[object, Floats] = fleet._lidar, fleet._table
    us = turns(
        {
            "move": (lambda: advance(robots, fleet._states, fleet._bodies, *scene, commands, *timing), n),
            "scan": (
                lambda: look(robots, fleet._states.poses, *scene, *sensor, views.ranges, views.targets),
                n,
            ),
            "step": (lambda: fleet.step(commands), n),
        }
    )
    return f"| {name} | {us['move']:.2f} | {us['scan']:.2f} | {us['step'] - us['move'] - us['scan']:.2f} |"


def memory() -> float:
    """Most memory of NumPy and Python for a large fleet and a step of it [MB]."""
    tracemalloc.start()
    step_of(discs(10_000, 200.0), 4096)()
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return most / 1e6


if __name__ == "__main__":
    run_main(main)
