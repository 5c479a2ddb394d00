"""Measures set-up, scans, collision checks and decisions in a building against BARN, in one process.

    python -m benchmarks.buildings [MAP] [--record]

MAP: a ROS map (.yaml); by default a floor plan of 2,000 m² with furniture, drawn by this program. Everything runs one
after the other, so ratios are valid on a busy machine too. --record also writes benchmarks/results/buildings.md.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image, ImageDraw
from scipy import ndimage

from benchmarks.command import check_named, run_main
from benchmarks.kernels import measure
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.geometry.collision import sweep
from lme.navigation.navigator import Navigator
from lme.perception.raycast import cast_grid, cast_shapes
from lme.robots import Lidar
from lme.simulation.simulator import Simulator
from lme.simulation.substeps import nearby
from lme.worlds.bitmap import read_ros_map
from lme.worlds.sampling import FreeSpace
from lme.worlds.world import FloorPlan, MapSet, Task
from runners.config import build
from runners.config.command_line import compose_job
from runners.config.composer import Composer

CELL_M, GRID_M, RADIUS_M, MARGIN_M, APART_M = 0.05, 0.05, 0.23, 0.1, 8.0
DRAWN_M = (56, 36)  # size of the floor plan that this program draws
RULES = (
    f"map.grid={GRID_M}",
    f"map.radius={RADIUS_M}",
    f"map.min_distance={APART_M}",
    "map.configurations=5",
)
BARN = ("map=barn", "map.subset=fresh", "map.worlds=[1000,1003,1006,1009,1011]")
ROBOTS = ("turtlebot2", "jackal", "go2")
SYSTEMS = ("lme", "lme_plus")
PAIRS = 50  # of starts and goals
STEPS = 300  # of an episode, at most
BOX = (0.21, 0.155, 0.0)  # of the footprint whose collisions are checked


def main() -> None:
    """Print the report, and write it with --record."""
    words = parser(__doc__, "buildings")
    words.add_argument("map", nargs="?", type=Path, help="a ROS map (.yaml) instead of the drawn floor plan")
    arguments = words.parse_args()
    check_named("MAP", arguments.map)
    with tempfile.TemporaryDirectory() as folder:
        show(report(arguments.map or draw_map(Path(folder))), "buildings", arguments.record)


def report(path: Path) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Maps as large as buildings\n"
    yield f"`python -m benchmarks.buildings --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"Map `{path.stem}`, `{' '.join(RULES)}`; five fresh BARN worlds.\n"
    yield "## Set-up\n"
    yield "Processor time [s].\n"
    yield "| what | s |"
    yield "|---|---:|"
    yield from setup_rows(path)
    map_words = (("map=file", f"map.path={path}", *RULES), BARN)
    with Composer("eval") as composer:
        drives = {
            (robot, system): [composed(composer, robot, system, words) for words in map_words]
            for robot in ROBOTS
            for system in SYSTEMS
        }
    yield "\n## Kernels\n"
    yield "Least time of a call from Python, mean over five starts [µs]. All edges: as in a small world.\n"
    yield "| robot | kernel | BARN | building, all edges | building | building / BARN |"
    yield "|---|---|---:|---:|---:|---:|"
    for robot in ROBOTS[:2]:  # the third has a 3D lidar
        building, barn = drives[robot, SYSTEMS[0]]
        yield from kernel_rows(robot, building[0], barn[0], building[3])
    yield f"\n## Closed loop, at most {STEPS} steps of five episodes\n"
    yield "Mean processor time [µs]. Simulator: motion, collision check and scan.\n"
    yield "| robot, system | what | BARN | building | building / BARN |"
    yield "|---|---|---:|---:|---:|"
    for (robot, system), (building, barn) in drives.items():
        yield from loop_rows(f"{robot}, {system}", building, barn)


def setup_rows(path: Path) -> Iterator[str]:
    """A row for each part of the set-up, which runs twice, since the first time it loads compiled code."""
    set_up(path)
    plan, space, times = set_up(path)
    across, up = np.ptp(plan.outline, axis=0)
    size = f"{across * up:,.0f} m², {len(plan.world.edges):,} edges, {space.clearance.size:,} lattice points"
    yield f"| all: {size} | {sum(times):.2f} |"
    phases = ("read the map", "free space", f"{PAIRS} starts and goals", f"{PAIRS} shortest paths")
    yield from (f"| {name} | {seconds:.2f} |" for name, seconds in zip(phases, times, strict=True))


def set_up(path: Path) -> tuple[FloorPlan, FreeSpace, list[float]]:
    """A map, its free space, and the processor times [s] of both, of drawing pairs, and of shortest paths."""
    times = [time.thread_time()]
    plan = read_ros_map(path, unknown_is_obstacle=True)
    times.append(time.thread_time())
    space = FreeSpace(plan, GRID_M, RADIUS_M, MARGIN_M)
    times.append(time.thread_time())
    pairs = [space.draw(np.random.default_rng(i), APART_M) for i in range(PAIRS)]
    times.append(time.thread_time())
    for start, goal in pairs:
        space.path_length(start, goal)
    times.append(time.thread_time())
    return plan, space, np.diff(times).tolist()


def composed(
    composer: Composer, robot: str, system: str, map_words: Sequence[str]
) -> tuple[MapSet, Navigator, Simulator, Lidar]:
    """What drives a robot and a system in a place, as `lme eval` builds it, and the robot's lidar."""
    config = compose_job(composer, [f"robot={robot}", f"system={system}", *map_words]).config
    systems = build.map_set(config), build.navigator(config), build.simulator(config)
    return *systems, config.robot.lidar


def kernel_rows(robot: str, building: MapSet, barn: MapSet, lidar: Lidar) -> Iterator[str]:
    """Rows for a scan and a collision check."""
    angles = (lidar.native.angle_min, lidar.native.angle_increment, lidar.native.num_beams)

    def scan(task: Task, in_grid: bool) -> object:
        world = task.world
        if not in_grid:
            return cast_shapes(task.start, angles, lidar.range_max, world.circles, world.edges)
        return cast_grid(task.start, angles, lidar.range_max, world.grid, world.lattice)

    def check(task: Task, in_grid: bool) -> object:
        poses = np.array(task.start) + np.linspace(0.025, 0.2, 8)[:, None] * [1.0, 0.0, 0.0]
        obstacles = task.world.circles, task.world.edges
        return sweep(poses, BOX, *(nearby(task.world, poses, BOX, *obstacles) if in_grid else obstacles))

    kernels: dict[str, Callable[[Task, bool], object]] = {
        f"scan, {angles[2]} beams, {lidar.range_max:g} m": scan,
        "collision check": check,
    }
    for name, kernel in kernels.items():
        small_us, barn_us, large_us = (
            np.mean([measure(partial(kernel, maps.task(number), tree), 0.05)[0] for number in maps.numbers])
            for maps, tree in ((barn, False), (building, False), (building, True))
        )
        yield f"| {robot} | {name} | {small_us:.1f} | {barn_us:.1f} | {large_us:.1f} | {large_us / small_us:.1f} |"


def loop_rows(name: str, building: Sequence[Any], barn: Sequence[Any]) -> Iterator[str]:
    """Rows for the decision and for the simulator."""
    times = [steps_us(*setup[:3]) for setup in (barn, building)]
    for phase, small, large in zip(("decision", "simulator"), *times, strict=True):
        yield f"| {name} | {phase} | {small:.0f} | {large:.0f} | {large / small:.1f} |"


def steps_us(maps: MapSet, navigator: Navigator, simulator: Simulator) -> tuple[float, float]:
    """Mean processor time of a decision and of a step of the simulator [µs]; the first episode only compiles."""
    for i, number in enumerate((maps.numbers[0], *maps.numbers)):
        if i < 2:
            seconds, steps = np.zeros(2), 0
        observation = simulator.reset(maps.task(number), np.random.default_rng(number))
        navigator.reset(np.random.default_rng(number))
        for _ in range(STEPS):
            times = [time.thread_time()]
            command = navigator.act(observation)
            times.append(time.thread_time())
            observation = simulator.step(command)
            times.append(time.thread_time())
            seconds, steps = seconds + np.diff(times), steps + 1
            if simulator.state.contact or simulator.state.arrived:
                break
    decision, step = (seconds / steps * 1e6).tolist()
    return decision, step


def draw_map(folder: Path) -> Path:
    """A ROS map of an office: rooms on both sides of corridors, with furniture and rough walls."""
    rng = np.random.default_rng(0)
    width, height = (round(side / CELL_M) for side in DRAWN_M)
    picture = Image.new("L", (width, height), 254)
    pen = ImageDraw.Draw(picture)

    def box(x: float, y: float, across: float, up: float, shade: int = 0) -> None:
        pen.rectangle([x / CELL_M, y / CELL_M, (x + across) / CELL_M - 1, (y + up) / CELL_M - 1], fill=shade)

    for low in (0.0, 12.0, 24.0):  # a strip: a row of rooms, a corridor of 2 m, a row of rooms
        for bottom, door in ((low, low + 4.8), (low + 7.0, low + 7.0)):
            for left in np.arange(0.0, DRAWN_M[0], 4.0):
                box(left, bottom, 4.0, 5.0)
                box(left + 0.1, bottom + 0.1, 3.8, 4.8, 254)
                box(left + rng.uniform(0.3, 2.5), door, 1.2, 0.2, 254)
                for _ in range(4):
                    box(
                        left + rng.uniform(0.2, 3.2),
                        bottom + rng.uniform(1.2, 3.2),
                        *rng.uniform(0.1, 0.7, 2),
                    )
    for left in (12.0, 40.0):
        box(left, 0.3, 2.0, DRAWN_M[1] - 0.6, 254)
    occupied = np.asarray(picture) == 0
    rough = ndimage.binary_dilation(occupied) & (rng.random(occupied.shape) < 0.3)
    Image.fromarray(np.where(occupied | rough, 0, 254).astype(np.uint8)).save(folder / "office.png")
    path = folder / "office.yaml"
    rules = {"resolution": CELL_M, "origin": [0.0, 0.0, 0.0], "negate": 0}
    path.write_text(
        yaml.safe_dump({"image": "office.png", **rules, "occupied_thresh": 0.65, "free_thresh": 0.196})
    )
    return path


if __name__ == "__main__":
    run_main(main)
