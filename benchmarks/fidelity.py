"""Compares sim=physics with sim=fast: the same commands in both, the same worlds in both, and disturbances.

Also compares the Jackal of sim=skid and that of sim=mujoco with the runs of benchmarks/ode_jackal.cpp.

    python -m benchmarks.fidelity [--episodes 300] [--record]

Uses fresh BARN worlds, none of the official ones. Prints the tables of research/fidelity.md.
"""

import csv
import itertools
import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.command import run_main
from benchmarks.recording import parser, show
from benchmarks.speed import machine
from lme.config.presets import load_parameters, load_robot, load_settings
from lme.geometry.skid import AXES, Chassis, WheelState, slide
from lme.guides.lme.guide import Lme
from lme.guides.target import Target, TargetConfig
from lme.navigation.episode import Episode, run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.robots import Drivetrain, Footprint, Robot
from lme.simulation.crowd import Crowd
from lme.simulation.fast import FastSimulator
from lme.simulation.mujoco.wheels import FourWheels
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.simulator import Simulator, State
from lme.types import Floats, Observation, Pose, Twist
from lme.worlds.barn.map_set import Barn
from lme.worlds.world import Task, World

FRESH_SEED = 4
DISTURBED = 100  # worlds per row of the table of disturbances
ODE = Path(__file__).parent.parent / "tests/lme/geometry/ode_jackal.csv"  # made by ode_jackal.cpp
FITTED = 4  # of the runs there: sim=mujoco was fitted to these, and is judged by the others
Settings = dict[str, Any]  # keys of `sim`
DISTURBANCES: tuple[Settings, ...] = (
    {},
    {"latency": 0.05},
    {"latency": 0.1},
    {"latency": 0.2},
    {"slip": 0.05},
    {"slip": 0.2},
    {"scan_noise": 0.01},
    {"scan_noise": 0.03},
    {"scan_noise": 0.1},
    {"scan_dropout": 0.1},
    {"scan_dropout": 0.5},
    {"goal_noise": 0.1},
    {"goal_noise": 0.5},
    {"goal_noise_yaw": 0.05},
    {"goal_noise_yaw": 0.2},
    {"goal_rate": 1.0, "goal_noise": 0.1},
    {"goal_rate": 0.2, "slip": 0.05},
)


class Drive(NamedTuple):
    """A drive. poses: (T, 3), one after each command. end: contact, arrival, or still driving."""

    commands: list[Twist]
    poses: list[tuple[float, ...]]
    end: str


class Tape:
    """A simulator that keeps its commands and the poses after them."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator

    @property
    def obstacles(self) -> tuple[Floats, Floats]:
        """The obstacles of the simulator."""
        return self._simulator.obstacles

    @property
    def people(self) -> tuple[Floats, Floats]:
        """The people of the simulator."""
        return self._simulator.people

    def reset(self, task: Task, rng: np.random.Generator) -> Observation:
        """Reset the simulator and forget the last drive."""
        self.commands: list[Twist] = []
        self.poses: list[tuple[float, ...]] = []
        observation = self._simulator.reset(task, rng)
        self.state: State = self._simulator.state
        return observation

    def step(self, command: Twist) -> Observation:
        """Step the simulator, and keep the command and the pose."""
        observation = self._simulator.step(command)
        self.state = self._simulator.state
        self.commands.append(command)
        self.poses.append(tuple(self.state.pose))
        return observation

    def drive(self) -> Drive:
        """The drive since the reset."""
        ending = "contact" if self.state.contact else "arrival" if self.state.arrived else "still driving"
        return Drive(self.commands, self.poses, ending)


def main() -> None:
    """Print the report, and write it with --record."""
    options = parser(__doc__, "fidelity")
    options.add_argument("--episodes", type=int, default=300, help="fresh worlds, one episode each")
    arguments = options.parse_args()
    show(report(arguments.episodes), "fidelity", arguments.record)


def report(episodes: int) -> Iterator[str]:
    """Yield the lines of the report in Markdown."""
    yield "# Fidelity\n"
    yield f"`python -m benchmarks.fidelity --record`, {time.strftime('%Y-%m-%d')}, {machine()}\n"
    tasks = fresh_tasks(episodes)
    yield f"{episodes} fresh BARN worlds (`fresh_seed` {FRESH_SEED}), one episode each.\n"
    yield "## The same commands in both\n"
    yield "| robot | who drove | same verdict | arrival / contact / time-out | apart: median / 99 % / most [mm] |"
    yield "|---|---|---:|---:|---:|"
    jackal = load_robot("jackal")
    robots = {
        "jackal": jackal,
        "jackal, 458 × 416 mm": replace(jackal, footprint=Footprint(length=0.458, width=0.416)),
        "stage": load_robot("stage"),
    }
    for name, guide in itertools.product(robots, ("lme", "target", "random")):
        yield open_loop_row(name, robots[name], guide, tasks)
    yield "\n## The same worlds in both, LME on `jackal`\n"
    yield "| simulator | success | collision | time-out | mean time [s] | steps per CPU second |"
    yield "|---|---:|---:|---:|---:|---:|"
    for settings in ({}, {"grip": 2.5}, {"grip": 1.0}, {"grip": 0.6}):
        if not settings:
            yield closed_loop_row("fast", tasks, {})
        yield closed_loop_row("physics", tasks, settings)
    yield f"\n## Disturbed, LME on `jackal`, {min(DISTURBED, episodes)} of the worlds\n"
    yield "| disturbance | success, fast | collision, fast | success, physics | collision, physics |"
    yield "|---|---:|---:|---:|---:|"
    for settings in DISTURBANCES:
        yield disturbed_row(tasks[:DISTURBED], settings)
    yield "\n## Wheels that slide, against Open Dynamics Engine\n"
    yield f"Random commands of 0.1 s. Runs 0 to {FITTED - 1} are those to which `sim=mujoco` was fitted.\n"
    yield from ode_table()


def fresh_tasks(count: int) -> list[Task]:
    """New worlds, from a seed that no tuning has used."""
    barn = Barn(load_settings("map/barn", subset="fresh", count=count, fresh_seed=FRESH_SEED))
    return [barn.task(number) for number in barn.numbers]


def open_loop_row(name: str, robot: Robot, guide: str, tasks: Sequence[Task]) -> str:
    """Compare drives in sim=fast with the same commands in sim=physics, open loop."""
    drives = [drive(robot, guide, task, seed) for seed, task in enumerate(tasks)]
    replays = [replay(robot, task, fast.commands) for task, fast in zip(tasks, drives, strict=True)]
    pairs = list(zip(drives, replays, strict=True))
    agreement = np.mean([fast.end == physics.end for fast, physics in pairs])
    ends = Counter(fast.end for fast in drives)
    mix = " / ".join(str(ends[end]) for end in ("arrival", "contact", "still driving"))
    distances_mm = np.array([furthest_apart(fast.poses, physics.poses) for fast, physics in pairs]) * 1000.0
    median, high = np.percentile(distances_mm, [50, 99])
    return f"| `{name}` | {guide} | {agreement:.1%} | {mix} | {median:.2f} / {high:.1f} / {distances_mm.max():.1f} |"


def drive(robot: Robot, guide: str, task: Task, seed: int) -> Drive:
    """One episode in sim=fast."""
    tape = Tape(FastSimulator(load_settings("sim/fast"), robot))
    rng = np.random.default_rng([FRESH_SEED, seed])
    if guide == "random":
        wander(task, tape, rng)
    else:
        run_episode(task, navigator(robot, guide), tape, rng)
    return tape.drive()


def wander(task: Task, tape: Tape, rng: np.random.Generator) -> None:
    """Give random commands, mostly forward, for half a minute, to make contact in many ways."""
    limits = tape.reset(task, rng).limits
    for _ in range(300):
        if tape.state.contact or tape.state.arrived:
            break
        v, omega = rng.uniform(-0.3, 1.0) * limits.v_max, rng.uniform(-1.0, 1.0) * limits.omega_max
        tape.step(Twist(v, omega))


def replay(robot: Robot, task: Task, commands: Sequence[Twist]) -> Drive:
    """The same commands in sim=physics, until they or the drive end."""
    tape = Tape(PhysicsSimulator(load_settings("sim/physics"), robot))
    tape.reset(task, np.random.default_rng(0))
    for command in commands:
        tape.step(command)
        if tape.state.contact or tape.state.arrived:
            break
    return tape.drive()


def furthest_apart(path: Sequence[tuple[float, ...]], other_path: Sequence[tuple[float, ...]]) -> float:
    """Greatest distance between positions at the same time [m]; without the last, whose period may be cut short."""
    together = min(len(path), len(other_path)) - 1
    return max(
        (math.dist(a[:2], b[:2]) for a, b in zip(path[:together], other_path[:together], strict=True)),
        default=0.0,
    )


def closed_loop_row(sim: str, tasks: Sequence[Task], settings: Settings) -> str:
    """LME in one of the simulators, with the same seed per world in both."""
    start = time.process_time()
    episodes = closed_loop(sim, tasks, settings)
    rate = sum(episode.steps for episode in episodes) / (time.process_time() - start)
    success, collision, timeout = (
        share(episodes, outcome) for outcome in ("success", "collision", "timeout")
    )
    seconds = np.mean([episode.time for episode in episodes])
    label = " ".join([f"sim={sim}", *(f"sim.{key}={value}" for key, value in settings.items())])
    return f"| `{label}` | {success:.3f} | {collision:.3f} | {timeout:.3f} | {seconds:.2f} | {rate:,.0f} |"


def disturbed_row(tasks: Sequence[Task], settings: Settings) -> str:
    """LME under a disturbance, in both simulators."""
    label = " ".join(f"`sim.{key}={value}`" for key, value in settings.items()) or "none"
    by_simulator = [closed_loop(sim, tasks, settings) for sim in ("fast", "physics")]
    rates = [f"{share(episodes, end):.2f}" for episodes in by_simulator for end in ("success", "collision")]
    return f"| {label} | {' | '.join(rates)} |"


def closed_loop(sim: str, tasks: Sequence[Task], settings: Settings) -> list[Episode]:
    """One episode of LME on jackal in each world."""
    robot = load_robot("jackal")
    simulator: Simulator = (
        FastSimulator(load_settings("sim/fast", **settings), robot)
        if sim == "fast"
        else PhysicsSimulator(load_settings("sim/physics", **settings), robot)
    )
    driver = navigator(robot, "lme")
    return [
        run_episode(task, driver, simulator, np.random.default_rng([FRESH_SEED, seed]))
        for seed, task in enumerate(tasks)
    ]


def ode_table() -> Iterator[str]:
    """Root mean square differences of a Jackal's motion from the runs of ode_jackal.cpp, by frame of the friction."""
    simulators = {"skid": skid_rows, "mujoco": mujoco_rows}
    if find_spec("mujoco") is None:
        del simulators["mujoco"]
    measures = "v [m/s] / sideways [m/s] / ω [rad/s] / position after 1 s [mm]"
    yield " | ".join(["| friction | runs", *(f"`sim={name}`: {measures}" for name in simulators)]) + " |"
    yield "|---|---|" + "---:|" * len(simulators)
    runs = ode_runs()
    last = max(number for _, number in runs)
    for axes, numbers in itertools.product(AXES, (range(FITTED), range(FITTED, last + 1))):
        tables = [runs[axes, number] for number in numbers]
        cells = [ode_difference(rows, axes, tables) for rows in simulators.values()]
        yield f"| {axes} | {numbers[0]}–{numbers[-1]} | {' | '.join(cells)} |"


def ode_runs() -> dict[tuple[str, int], Floats]:
    """Runs by axes and number: rows (T, 8) of commanded v and ω, and x, y, yaw, v, sideways speed and ω after 0.1 s."""
    with ODE.open(encoding="utf-8") as file:
        rows = list(csv.reader(file))[1:]
    return {
        (axes, int(number)): np.array([row[2:] for row in run], dtype=float)
        for (axes, number), run in itertools.groupby(rows, key=lambda row: (row[0], row[1]))
    }


def ode_difference(rows: Callable[[Floats, str], Floats], axes: str, tables: Sequence[Floats]) -> str:
    """Drive the commands of some runs, and return the differences in one cell of the table."""
    pairs = [(rows(table[:, :2], axes), table[:, 2:]) for table in tables]
    errors = np.vstack([driven[:, 3:] - ode[:, 3:] for driven, ode in pairs])
    ends = [math.dist(driven[9, :2], ode[9, :2]) for driven, ode in pairs]
    v, sideways, omega = np.sqrt(np.mean(errors**2, axis=0))
    return f"{v:.3f} / {sideways:.3f} / {omega:.3f} / {1000 * math.sqrt(np.mean(np.square(ends))):.0f}"


def skid_rows(commands: Floats, axes: str) -> Floats:
    """Drive the kernel of sim=skid: rows (T, 6) of x, y, yaw, v, sideways speed and ω of the base."""
    drivetrain = jackal_drivetrain()
    parameters = asdict(drivetrain)
    chassis = Chassis(
        **{name: parameters[name] for name in Chassis._fields if name in parameters},
        separation_multiplier=drivetrain.controller.separation_multiplier,
    )
    state = WheelState(np.zeros(6), np.zeros(4), np.zeros(2), np.zeros(16), np.zeros(2))
    state.body[0] = drivetrain.com_x
    controller = drivetrain.controller
    limits = (controller.v_max, controller.omega_max, controller.alpha_v, controller.alpha_omega)
    rows = np.empty((len(commands), 6))
    for row, command in zip(rows, commands.tolist(), strict=True):
        row[:3] = slide(
            state, chassis, tuple(command), limits, (1.0, 1.0), AXES.index(axes), np.zeros(1), 0.1, 1
        )[-1]
        cos, sin = math.cos(row[2]), math.sin(row[2])
        vx, vy, omega = state.body[3:].tolist()
        row[3:] = vx * cos + vy * sin, vy * cos - vx * sin - omega * drivetrain.com_x, omega
    return rows


def mujoco_rows(commands: Floats, axes: str) -> Floats:
    """Drive the Jackal of sim=mujoco: see `skid_rows`."""
    wheels = FourWheels(load_robot("jackal"), axes, 0.0, None)
    wheels.begin(Pose(0.0, 0.0, 0.0), np.random.default_rng(0))
    wheels.enter(World(), Crowd(()))
    rows = []
    for command in commands.tolist():
        wheels.move(Twist(*command), round(0.1 / wheels.time_step))
        rows.append((*wheels.pose, *wheels.velocity.tolist()))
    return np.array(rows)


def jackal_drivetrain() -> Drivetrain:
    """That of robot=jackal."""
    drivetrain = load_robot("jackal").drivetrain
    assert drivetrain is not None
    return drivetrain


def share(episodes: Sequence[Episode], outcome: str) -> float:
    """Share of episodes with this outcome."""
    return float(np.mean([episode.outcome == outcome for episode in episodes]))


def navigator(robot: Robot, guide: str) -> Navigator:
    """LME with the published weights, or the simple planner alone, which does not avoid obstacles."""
    chosen = (
        Lme(load_settings("guide/lme", parameters=load_parameters("published")), robot)
        if guide == "lme"
        else Target(TargetConfig(), robot)
    )
    return Navigator(chosen, Simple(load_settings("planner/simple"), robot))


if __name__ == "__main__":
    run_main(main)
