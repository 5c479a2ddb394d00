"""Measures the speed of kernels against their plain twins, of a decision, the closed loop and whole commands.

    python -m benchmarks.speed [--record]

Everything runs one after the other, the library on one core, so ratios are valid on a busy machine too.
--record also writes benchmarks/results/speed.md.
"""

import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import numpy as np

from benchmarks.command import run_main
from benchmarks.kernels import kernel_rows, measure
from benchmarks.recording import parser, show
from benchmarks.step import step_rows
from lme.config.presets import load_parameters, load_robot, load_settings
from lme.guides.lme.guide import Lme
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.robots import Cap, Robot
from lme.simulation.fast import FastSimulator
from lme.simulation.simulator import Simulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.worlds.barn.map_set import Barn
from lme.worlds.indoor.map_set import Indoor
from lme.worlds.scene import Scene
from lme.worlds.world import MapSet


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "speed", parser(__doc__, "speed").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Speed\n"
    yield f"`python -m benchmarks.speed --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield "## Kernels, called from Python, one core\n"
    yield "µs, least / median; the twin is the plain numpy version that the tests hold the kernel to.\n"
    yield "| scene | kernel | least | median | twin | times | pymunk rays | times |"
    yield "|---|---|---:|---:|---:|---:|---:|---:|"
    yield from kernel_rows()
    yield "\n## Decision and closed loop, one core\n"
    yield "A decision in wall time, least / median; steps per second of processor time.\n"
    yield "| what | figure |"
    yield "|---|---:|"
    yield from loop_rows("stage", "540 beams, 360°")
    yield from loop_rows("jackal", "720 beams, 270°")
    yield cloud_row()
    yield skid_row()
    yield "\nOther simulators: [peers.md](peers.md).\n"
    yield "## Where a step spends its time\n"
    yield "µs of processor time, the kernels with the call from Python; the fastest of five runs."
    go2, stage = load_robot("go2"), load_robot("stage")
    offices = Indoor(load_settings("map/indoor", count=25, radius=go2.footprint.circumscribed_radius))
    for name, maps, robot in (("BARN", Barn(load_settings("map/barn")), stage), ("offices", offices, go2)):
        yield f"\n### `{robot.name}`, {name}\n"
        yield "| what | µs | share | calls |"
        yield "|---|---:|---:|---:|"
        yield from step_rows(maps, lme_on(robot), FastSimulator(load_settings("sim/fast"), robot))
    yield "\n## Whole commands, wall time\n"
    yield "| command | median [s] | least [s] | peak memory, all processes [MB] |"
    yield "|---|---:|---:|---:|"
    yield from command_rows()


def loop_rows(name: str, lidar: str) -> Iterator[str]:
    """Rows for one decision in BARN world 200, and for closed-loop steps per second over twenty worlds."""
    robot = load_robot(name)
    navigator = lme_on(robot)
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    observations = []
    task = Barn(load_settings("map/barn", worlds=[200])).task(200)
    observation = simulator.reset(task, np.random.default_rng(0))
    navigator.reset(np.random.default_rng(0))
    while not (simulator.state.arrived or simulator.state.contact):
        observations.append(observation)
        observation = simulator.step(navigator.act(observation))

    def decide_all() -> None:
        navigator.reset(np.random.default_rng(0))
        for scene in observations:
            navigator.guide.guide(scene)

    least, median = (figure / len(observations) for figure in measure(decide_all, 2.0))
    what = f"decision, `{name}` ({lidar}), 300 candidates, BARN world 200"
    yield f"| {what} | {least:.0f} / {median:.0f} µs |"
    yield rate_row(f"`{name}`", Barn(load_settings("map/barn")), navigator, simulator)


def skid_row() -> str:
    """The row of closed-loop steps per second with wheels that slide."""
    robot = load_robot("jackal").capped(Cap(1.0, 1.57))
    simulator = SkidSimulator(load_settings("sim/skid"), robot)
    return rate_row("`jackal`, `sim=skid`", Barn(load_settings("map/barn")), lme_on(robot), simulator)


def rate_row(name: str, maps: MapSet, navigator: Navigator, simulator: Simulator) -> str:
    """A row with the median of three measurements of closed-loop steps per second."""
    rates = [closed_loop(maps, navigator, simulator) for _ in range(3)]
    label = f"closed-loop steps, {name}: scan, decision, control, motion, collision"
    return f"| {label} | {statistics.median(rates):,.0f} per second |"


def cloud_row() -> str:
    """The row of closed-loop steps per second of the robot with a 3D lidar, in its own scene."""
    scene = Scene(load_settings("map/_scene", name="go2_a"))
    robot = load_robot("go2")
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    closed_loop(scene, lme_on(robot), simulator)  # compiles
    return rate_row("`go2` through its Mid-360", scene, lme_on(robot), simulator)


def lme_on(robot: Robot) -> Navigator:
    """LME with the published parameters and its own planner."""
    guide = Lme(load_settings("guide/lme", parameters=load_parameters("published")), robot)
    return Navigator(guide, Simple(load_settings("planner/simple"), robot))


def closed_loop(maps: MapSet, navigator: Navigator, simulator: Simulator) -> float:
    """Steps per second of processor time over every fifth task: twenty episodes of BARN."""
    tasks = [maps.task(number) for number in maps.numbers[::5]]
    start = time.process_time()
    episodes = [run_episode(task, navigator, simulator, np.random.default_rng(1)) for task in tasks]
    return sum(episode.steps for episode in episodes) / (time.process_time() - start)


def command_rows() -> Iterator[str]:
    """Rows for commands as a user types them, with compiled code in the cache."""
    lme = str(Path(sys.executable).parent / "lme")
    two = ["executor.workers=2"]
    for words in (
        [],
        ["eval", "--help"],
        ["eval", "map=barn", *two, "tracking=none"],
        ["eval", "map=barn", *two],
    ):
        with tempfile.TemporaryDirectory() as folder:
            runs = [timed([lme, *words], folder) for _ in range(4)][1:]
        seconds = [run[0] for run in runs]
        memory = max(run[1] for run in runs)
        name = " ".join(["lme", *words])
        yield f"| `{name}` | {statistics.median(seconds):.2f} | {min(seconds):.2f} | {memory:.0f} |"


def timed(command: list[str], folder: str) -> tuple[float, float]:
    """Wall time [s], and peak memory of all processes together [MB], as proportional set size."""
    start = time.perf_counter()
    process = subprocess.Popen(
        command, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    peak = 0.0
    while process.poll() is None:
        peak = max(peak, memory_of_session(process.pid))
        time.sleep(0.02)
    assert process.returncode == 0, f"{command} failed"
    return time.perf_counter() - start, peak


def memory_of_session(session: int) -> float:
    """Memory of all processes of a session [MB]; shared pages count once. 0 except on Linux."""
    total = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if int((folder / "stat").read_text().rpartition(")")[2].split()[3]) == session:
                total += int(re.findall(r"Pss: +(\d+)", (folder / "smaps_rollup").read_text())[0])
        except (OSError, ValueError, IndexError):
            continue  # the process has ended
    return total / 1024


def machine() -> str:
    """The processor, Python and packages of this machine."""
    cpu = next(
        (line.split(":")[1].strip() for line in cpu_info() if line.startswith("model name")),
        platform.machine(),
    )
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "pymunk", "mlflow"))
    return f"{cpu}, {os.cpu_count()} cores, shared; Python {platform.python_version()}, {packages}"


def cpu_info() -> list[str]:
    path = Path("/proc/cpuinfo")
    return path.read_text().splitlines() if path.exists() else []


if __name__ == "__main__":
    run_main(main)
