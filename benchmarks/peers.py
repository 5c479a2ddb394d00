"""Measures the speed of other simulators next to `sim=fast`: scan, motion and collision check of one robot, one core.

    python -m benchmarks.peers [--record]

All drive the same small circle in BARN world 200 with 540 beams, one after the other, so ratios are valid on a busy
machine too. Peers are not dependencies: the row of a missing one says so. navground and ir-sim come from pip;
Stage is built from source (github.com/rtv/Stage), and `stage` must be on the PATH. --record also writes
benchmarks/results/peers.md.
"""

import importlib
import math
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pymunk
import yaml

from benchmarks.command import run_main
from benchmarks.kernels import measure
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.config.presets import load_robot, load_settings
from lme.gym.fleet import Fleet
from lme.perception.raycast import cast_shapes
from lme.simulation.fast import FastSimulator
from lme.types import Floats, Pose, Twist
from lme.worlds.barn.map_set import Barn

Step = Callable[
    [], tuple[Sequence[float], Floats]
]  # one control period; gives the pose and the ranges from behind

TASK = Barn(load_settings("map/barn", worlds=[200])).task(200)
CIRCLES = TASK.world.circles
ROBOT = load_robot("stage")
BEAMS, RANGE_MAX, DT = ROBOT.lidar.num_beams, ROBOT.lidar.range_max, ROBOT.dt
RADIUS = ROBOT.footprint.circumscribed_radius
COMMAND = Twist(0.1, 0.5)  # a circle of 0.2 m, without contact
FOV = 2 * math.pi * (BEAMS - 1) / BEAMS  # from the first beam to the last
MANY = (16, 64, 256)  # robots at once
STAGE_S = (100, 1100)  # [s] simulated; the difference is without start and end


def main() -> None:
    """Print the report, and write it with --record."""
    show(report(), "peers", parser(__doc__, "peers").parse_args().record)


def report() -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Peers\n"
    yield f"`python -m benchmarks.peers --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield f"One robot with {BEAMS} beams up to {RANGE_MAX:g} m among the {len(CIRCLES)} cylinders of BARN world 200;"
    yield "a step is a scan, the motion of a control period, and a collision check, on one core. The scan of the first"
    yield "step is compared with that of our ray caster at the same pose, beam by beam. In ir-sim a disc is a polygon."
    yield "In Stage a cylinder has 16 sides on a grid of 2 cm, the robot has its controller `wander`, and the time is"
    yield "that of the processor; the others are in wall time, where the most counts on a shared machine.\n"
    yield "| simulator | steps/s, most | median | ours, times its most | median difference of a range [m] |"
    yield "|---|---:|---:|---:|---:|"
    fast_step = fast()
    minimum, median = measure(fast_step, 2.0)
    yield f"| lme, `sim=fast` | {_rate(minimum)} | {_rate(median)} | | |"
    for name, make_step in {"navground": navground, "ir-sim": ir_sim, "pymunk": pymunk_rays}.items():
        yield peer_row(name, make_step, minimum)
    yield stage_row(minimum)
    yield from many_robots()


def many_robots() -> Iterator[str]:
    """Yield the table of many robots at once, each in a copy of the world."""
    yield "\n## Many robots\n"
    yield f"{time.strftime('%Y-%m-%d')}, {machine()}\n"
    yield "Each robot takes the step above in such a world of its own, on one core: ours in one call of `Fleet`, the"
    yield "others one after another, since they have no such call.\n"
    yield "| simulator | robots | steps of a robot per second, most | median | ours with 256, times |"
    yield "|---|---:|---:|---:|---:|"
    rows = {f"lme, `Fleet` | {n}": [us / n for us in measure(fleet(n), 2.0)] for n in MANY}
    least = rows[f"lme, `Fleet` | {MANY[-1]}"][0]
    rows["lme, `sim=fast` | 1"] = list(measure(fast(), 2.0))
    for name, make_step in {"navground": navground, "pymunk": pymunk_rays}.items():
        try:
            rows[f"{name} {version(name)} | 1"] = list(measure(make_step(), 2.0))
        except ImportError:
            continue
    for name, (minimum, median) in rows.items():
        yield f"| {name} | {_rate(minimum)} | {_rate(median)} | {minimum / least:,.1f} |"


def fleet(count: int) -> Callable[[], object]:
    """Our simulator of many robots, on one thread."""
    robots = Fleet(Barn(load_settings("map/barn", worlds=[TASK.number])), ROBOT, count, threads=1)
    robots.reset(range(count))
    commands = np.tile(COMMAND, (count, 1))
    return lambda: robots.step(commands)


def peer_row(name: str, make_step: Callable[[], Step], our_least: float) -> str:
    """The row of a simulator that Python can import."""
    try:
        step = make_step()
    except ImportError as error:
        return f"| {name} | not measured: {error}; `pip install {name}` | | | |"
    pose, ranges = step()
    angles = (ROBOT.lidar.angle_min, ROBOT.lidar.angle_increment, BEAMS)
    off = float(
        np.median(np.abs(ranges - cast_shapes(Pose(*pose), angles, RANGE_MAX, CIRCLES, np.empty((0, 4)))))
    )
    minimum, median = measure(step, 2.0)
    speeds = f"{_rate(minimum)} | {_rate(median)} | {minimum / our_least:,.0f}"
    return f"| {name} {version(name)} | {speeds} | {off:.1g} |"


def fast() -> Callable[[], object]:
    """Our simulator."""
    simulator = FastSimulator(load_settings("sim/fast"), ROBOT)
    simulator.reset(TASK, np.random.default_rng(0))
    return lambda: simulator.step(COMMAND)


def navground() -> Step:
    """navground's world with a two-wheeled agent, its lidar and its collisions, in C++."""
    core, sim = importlib.import_module("navground.core"), importlib.import_module("navground.sim")
    world, state = sim.World(), core.SensingState()
    for x, y, r in CIRCLES:
        world.add_obstacle(core.Disc((x, y), r))
    agent = sim.Agent(
        radius=RADIUS, kinematics=core.kinematics.TwoWheelsDifferentialDriveKinematics(ROBOT.v_max, RADIUS)
    )
    agent.pose = core.Pose2(TASK.start[:2], TASK.start.yaw)
    world.add_agent(agent)
    lidar = sim.state_estimations.LidarStateEstimation(RANGE_MAX, -math.pi, FOV, BEAMS)
    lidar.prepare(agent, world)
    command = core.Twist2((COMMAND.v, 0.0), COMMAND.omega, core.Frame.relative)

    def step() -> tuple[Sequence[float], Floats]:
        agent.last_cmd = command
        world.actuate(DT)
        lidar.update(agent, world, state)
        return (*agent.position, agent.orientation), np.asarray(lidar.read_ranges(state))

    return step


def ir_sim() -> Step:
    """ir-sim without its window, in Python with shapely."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    irsim = importlib.import_module("irsim")
    lidar = {"name": "lidar2d", "range_max": RANGE_MAX, "angle_range": FOV, "number": BEAMS}
    lidar["offset"] = [0.0, 0.0, -math.pi / BEAMS]  # its beams are symmetric about 0
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": RADIUS},
        "state": list(TASK.start),
        "sensors": [lidar],
    }
    obstacles = [
        {"shape": {"name": "circle", "radius": r}, "state": [x, y, 0.0]} for x, y, r in CIRCLES.tolist()
    ]
    world = {"world": {"step_time": DT, "height": 20, "width": 20, "offset": [-10, -5]}}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "world.yaml"
        path.write_text(yaml.safe_dump({**world, "robot": [robot], "obstacle": obstacles}))
        env = irsim.make(str(path), headless=True, log_level="WARNING")
    command = np.array([[COMMAND.v], [COMMAND.omega]])

    def step() -> tuple[Sequence[float], Floats]:
        env.step(command)
        return env.robot.state[:3, 0].tolist(), np.asarray(env.get_lidar_scan()["ranges"])

    return step


def pymunk_rays() -> Step:
    """pymunk's kinematic body, a ray query for each beam and a query of the body's disc."""
    space = pymunk.Space()
    for x, y, r in CIRCLES:
        space.add(pymunk.Circle(space.static_body, r, (x, y)))
    body = pymunk.Body(body_type=pymunk.Body.KINEMATIC)
    body.position, body.angle, body.angular_velocity = TASK.start[:2], TASK.start.yaw, COMMAND.omega
    disc = pymunk.Circle(body, RADIUS)
    space.add(body, disc)
    bearings = -math.pi + 2 * math.pi / BEAMS * np.arange(BEAMS)
    disc.filter = pymunk.ShapeFilter(group=1)
    accept = pymunk.ShapeFilter(group=1)  # rays do not hit the robot

    def step() -> tuple[Sequence[float], Floats]:
        body.velocity = body.rotation_vector * COMMAND.v
        space.step(DT)
        space.shape_query(disc)
        position, angles = body.position, body.angle + bearings
        ends = np.column_stack([np.cos(angles), np.sin(angles)]) * RANGE_MAX + position
        hits = [space.segment_query_first(position, end, 0.0, accept) for end in ends.tolist()]
        return (*position, body.angle), np.array(
            [RANGE_MAX * hit.alpha if hit else RANGE_MAX for hit in hits]
        )

    return step


def stage_row(our_least: float) -> str:
    """The row of Stage, which runs as a program and has no scan to compare."""
    program = shutil.which("stage")
    if program is None:
        return "| Stage | not measured: `stage` is not on the PATH; build github.com/rtv/Stage | | | |"
    short_s, long_s = (min(stage_time(program, seconds) for _ in range(3)) for seconds in STAGE_S)
    rate = (STAGE_S[1] - STAGE_S[0]) / DT / (long_s - short_s)
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
        path.write_text(stage_world(simulated))
        start = os.times()
        subprocess.run([program, "-g", str(path)], check=True, capture_output=True)
        end = os.times()
    return sum(end[2:4]) - sum(start[2:4])


def stage_world(simulated: float) -> str:
    """Stage's file of the world, with cylinders of 16 sides; its own controller "wander" drives there."""
    period = f"update_interval {1000 * DT:.0f}"
    sensor = f"sensor ( range [0 {RANGE_MAX}] fov 360 samples {BEAMS} )"
    body = (
        f'size [{2 * RADIUS} {2 * RADIUS} 0.2] {_disc_block()} drive "diff" localization "gps" ctrl "wander"'
    )
    x, y, yaw = TASK.start
    pose = f"pose [{x} {y} 0 {math.degrees(yaw)}]"
    lines = [f"interval_sim {1000 * DT:.0f}", f"quit_time {simulated}", "resolution 0.02"]
    lines.append(f"define lidar ranger ( {sensor} size [0.05 0.05 0.1] {period} )")
    lines.append(f"define cylinder model ( boundary 0 {_disc_block()} )")
    lines.append(f"position ( {body} {pose} {period} lidar ( pose [0 0 0 0] ) )")
    lines += [f"cylinder ( size [{2 * r} {2 * r} 1] pose [{x} {y} 0 0] )" for x, y, r in CIRCLES.tolist()]
    return "\n".join(lines)


def _disc_block(sides: int = 16) -> str:
    """A disc as one of Stage's blocks, which it stretches to the size of the model."""
    angles = 2 * math.pi / sides * np.arange(sides)
    corners = (f"point[{i}] [{math.cos(a):.4f} {math.sin(a):.4f}]" for i, a in enumerate(angles))
    return f"block ( points {sides} {' '.join(corners)} z [0 1] )"


if __name__ == "__main__":
    run_main(main)
