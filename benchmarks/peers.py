"""Measures the speed of other simulators next to `sim=fast`: one robot, and many robots that follow a policy.

    python -m benchmarks.peers [--record]

One robot drives a small circle in BARN world 200 with 540 beams. Many robots look around with 720 beams among a hundred
discs, and a policy answers each scan; there the simulators take turns, and the clock counts processor time, so ratios
are valid on a busy machine too. Peers are not dependencies: a line says how to install a missing one. Stage is built
from source (github.com/rtv/Stage), and `stage` must be on the PATH. irsim-x holds a package of the same name as ir-sim,
so install it elsewhere (`pip install --no-deps --target DIR irsim-x`) and name DIR in a .pth file of the environment.
--record also writes benchmarks/results/peers.md.
"""

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.command import run_main
from benchmarks.fleet import OneWorld, discs
from benchmarks.kernels import measure
from benchmarks.peer_steps import (
    CELL,
    Scene,
    Step,
    fast,
    fleet,
    ir_sim,
    irsim_x,
    jaxnav,
    mujoco_rays,
    navground,
    pymunk_rays,
    stage_world,
)
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.config.presets import load_robot, load_settings
from lme.perception.raycast import cast_shapes
from lme.types import Floats, Pose
from lme.worlds.barn.map_set import Barn

ROBOT = load_robot("stage")
BARN = Scene(Barn(load_settings("map/barn", worlds=[200])).task(200), ROBOT)
DISCS = Scene(
    OneWorld(discs(100, 20.0)).task(0),
    replace(ROBOT, lidar=replace(ROBOT.lidar, num_beams=720, range_max=12.0)),
)
COMMAND = np.array([[0.1, 0.5]])  # a circle of 0.2 m, without contact
ROUNDS, TURN_S = 7, 0.5  # the least and the most of 7 rounds hold the median with a confidence of 98 %
LOOKS = 20  # steps whose scans are compared
STAGE_S = (100, 1100)  # [s] simulated; the difference is without start and end
MANY: tuple[
    tuple[str, str, Callable[..., Step], tuple[int, ...]], ...
] = (  # name, package, numbers of robots
    ("lme, `Fleet`", "", fleet, (256, 16)),
    ("lme, `sim=fast`", "", fast, (1,)),
    ("irsim-x", "irsim-x", irsim_x, (256, 16)),
    ("MuJoCo", "mujoco", mujoco_rays, (1,)),
    ("navground", "navground", navground, (1,)),
    ("JaxNav", "jaxmarl jax", jaxnav, (256, 16)),
    ("pymunk", "pymunk", pymunk_rays, (1,)),
    ("ir-sim", "ir-sim", ir_sim, (1,)),
)
NOTES = f"""
They do not compute the same, and a beam that grazes a disc hits in one and misses in another:

- lme: float64, beams meet only the discs in the cells that they cross; commands obey the robot's accelerations.
- irsim-x, a fork of ir-sim in C++: float32 with AVX2. All robots, octagons, share one world and obey no acceleration.
  Where the processor has AVX-512, 1.1.4 as pip builds it neither moves nor scans every second eight robots; build it
  with `-march=x86-64-v3` in place of `-march=native`.
- MuJoCo: `mj_step` once a period, with contacts in three dimensions, for a disc whose velocity is set; `mj_multiRay`
  against cylinders.
- navground: a world for each robot, with the actuation of a two-wheeled agent; float32.
- JaxNav: `step_env` with observation and reward, without the reset that its `step` computes as well. The discs are
  a grid map with cells of {CELL:g} m, those of its own BARN maps, and a beam looks at it every 5 cm, the default, so
  its ranges are as coarse. It is made for accelerators; here XLA runs it on the processor.
- pymunk: a query from Python for each beam.
- ir-sim: Python with shapely, where discs are polygons."""
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "JAX_PLATFORMS": "cpu",
}


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "peers", parser(__doc__, "peers").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    lidar = ROBOT.lidar
    yield "# Peers\n"
    yield f"`python -m benchmarks.peers --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"One robot with {lidar.num_beams} beams up to {lidar.range_max:g} m among the"
    yield f"{len(BARN.task.world.circles)} cylinders of BARN world 200;"
    yield "a step is a scan, the motion of a control period, and a collision check, on one core. The scan of the first"
    yield "step is compared with that of our ray caster at the same pose, beam by beam. In ir-sim a disc is a polygon."
    yield "In Stage a cylinder has 16 sides on a grid of 2 cm, the robot has its controller `wander`, and the time is"
    yield "that of the processor; the others are in wall time, where the most counts on a shared machine.\n"
    yield "| simulator | steps/s, most | median | ours, times its most | median difference of a range [m] |"
    yield "|---|---:|---:|---:|---:|"
    fast_step = fast(BARN)
    minimum, median = measure(lambda: fast_step(COMMAND), 2.0)
    yield f"| lme, `sim=fast` | {_rate(minimum)} | {_rate(median)} | | |"
    for name, make_step in {"navground": navground, "ir-sim": ir_sim, "pymunk": pymunk_rays}.items():
        yield peer_row(name, make_step, minimum)
    yield stage_row(minimum)
    yield from many_robots()


def peer_row(name: str, make_step: Callable[[Scene], Step], our_least: float) -> str:
    """The row of a simulator that Python can import."""
    try:
        step = make_step(BARN)
    except ImportError as error:
        return f"| {name} | not measured: {error}; `pip install {name}` | | | |"
    off = float(np.median(differences(step, BARN, 1, looks=1)))
    minimum, median = measure(lambda: step(COMMAND), 2.0)
    speeds = f"{_rate(minimum)} | {_rate(median)} | {minimum / our_least:,.0f}"
    return f"| {name} {version(name)} | {speeds} | {off:.1g} |"


def many_robots() -> Iterator[str]:
    """Yield the table of many robots, which a policy drives."""
    os.environ.update(ONE_THREAD)
    rows: dict[str, tuple[Step, int]] = {}
    missing = []
    for name, package, make_step, counts in MANY:
        try:
            steps = {n: make_step(DISCS) if n == 1 else make_step(DISCS, n) for n in counts}
        except ImportError as error:
            missing.append(f"\n{name}: not measured: {error}; `pip install {package}`")
            continue
        versions = [f"{part} {version(part)}" for part in package.split()]
        label = f"{name} ({', '.join(versions)})" if versions else name
        rows |= {f"{label} | {n}": (step, n) for n, step in steps.items()}
    lidar = DISCS.robot.lidar
    yield "\n## Many robots\n"
    yield f"{time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"Each robot has {lidar.num_beams} beams over 360°, up to {lidar.range_max:g} m, among"
    yield f"{len(DISCS.task.world.circles)} discs in 20 × 20 m, and a policy in NumPy answers its scan: it turns left,"
    yield "and slows down near obstacles. A step is that policy, the motion of a control period, a collision check and"
    yield "a scan, in processor time, on one thread and without compilation. The simulators took turns of"
    yield f"{TURN_S:g} s for {ROUNDS} rounds, at a load average of {os.getloadavg()[0]:.1f} in the beginning."
    yield "Speeds and ratios are medians of the rounds; in brackets are the least and the greatest ratio, which hold"
    yield "the true median with a confidence of 98 %. Ranges are compared with those of our ray caster at the same"
    yield f"poses, beam by beam, over {LOOKS} steps.\n"
    yield from table(rows)
    yield from missing
    yield NOTES


def table(rows: Mapping[str, tuple[Step, int]]) -> Iterator[str]:
    """Yield the rows, whose simulators take turns; all are compared with the first."""
    off = {name: differences(step, DISCS, n) for name, (step, n) in rows.items()}  # compiles, too
    times: dict[str, list[float]] = {name: [] for name in rows}
    for _ in range(ROUNDS):
        for name, (step, n) in rows.items():
            times[name].append(turn(step, n))
    ranges = "median difference of a range [m] | greatest"
    yield f"| simulator | robots | steps of a robot per second | ours with 256, times | {ranges} |"
    yield "|---|---:|---:|---:|---:|---:|"
    ours = np.array(next(iter(times.values())))
    for name, seconds in times.items():
        ratios = np.array(seconds) / ours
        digits = 0 if np.median(ratios) >= 20 else 1
        least, median, most = (f"{f(ratios):,.{digits}f}" for f in (np.min, np.median, np.max))
        cells = f"{_rate(1e6 * float(np.median(seconds)))} | {median} ({least}–{most})"
        yield f"| {name} | {cells} | {np.median(off[name]):.2g} | {np.max(off[name]):.2g} |"


def turn(step: Step, n: int) -> float:
    """Processor time of a robot's step, all threads together [s]."""
    commands, steps, start = np.tile(COMMAND, (n, 1)), 0, time.process_time()
    while (elapsed := time.process_time() - start) < TURN_S or not steps:
        commands = policy(step(commands)[1])
        steps += 1
    return elapsed / steps / n


def policy(ranges: NDArray[Any]) -> Floats:
    """Turn left, more slowly near obstacles: ranges (n, B) [m] to commands (n, 2)."""
    commands = np.tile(COMMAND, (len(ranges), 1))
    commands[:, 0] *= np.minimum(ranges.min(axis=1), 1.0)
    return commands


def differences(step: Step, scene: Scene, n: int, looks: int = LOOKS) -> Floats:
    """Differences of ranges from those of our ray caster at the same poses (looks, n, B) [m]."""
    lidar, commands, off = scene.robot.lidar, np.tile(COMMAND, (n, 1)), []
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    for _ in range(looks):
        poses, ranges = step(commands)
        commands = policy(ranges)
        for pose, scan in zip(poses, ranges, strict=True):
            exact = cast_shapes(
                Pose(*pose), angles, lidar.range_max, scene.task.world.circles, np.empty((0, 4))
            )
            off.append(np.abs(scan - exact))
    return np.array(off)


def stage_row(our_least: float) -> str:
    """The row of Stage, which runs as a program and has no scan to compare."""
    program = shutil.which("stage")
    if program is None:
        return "| Stage | not measured: `stage` is not on the PATH; build github.com/rtv/Stage | | | |"
    short_s, long_s = (min(stage_time(program, seconds) for _ in range(3)) for seconds in STAGE_S)
    rate = (STAGE_S[1] - STAGE_S[0]) / ROBOT.dt / (long_s - short_s)
    return f"| {stage_version(program)} | {rate:,.0f} | | {1e6 / our_least / rate:,.0f} | |"


def _rate(step_us: float) -> str:
    """Steps per second, with a decimal where they are few."""
    rate = 1e6 / step_us
    return f"{rate:,.0f}" if rate >= 10 else f"{rate:.1f}"


def stage_version(program: str) -> str:
    """Name and version, as it prints them."""
    help_text = subprocess.run([program, "-h"], capture_output=True, text=True).stdout
    return " ".join(help_text.split()[:2])


def stage_time(program: str, simulated: float) -> float:
    """Processor time [s] of Stage without a window for so many simulated seconds; it has one thread."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "barn.world"
        path.write_text(stage_world(BARN, simulated))
        start = os.times()
        subprocess.run([program, "-g", str(path)], check=True, capture_output=True)
        end = os.times()
    return sum(end[2:4]) - sum(start[2:4])


if __name__ == "__main__":
    run_main(main)
