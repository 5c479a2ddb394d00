"""`lme live`: the node, or the simulated robot."""

from __future__ import annotations

import signal
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from types import FrameType
from typing import Any

import numpy as np

from lme.errors import InputError, require
from lme.live.config import ScanConfig
from lme.live.driver import LiveDriver
from lme.live.frames import FramesConfig
from lme.live.step import LiveStep
from lme.navigation.navigator import Navigator
from lme.robots import Robot
from lme.worlds.check import check_task
from lme.worlds.world import Task
from runners.config import build
from runners.config.instantiate import configured, fill_dataclass
from runners.config.job import Job
from runners.config.quoting import key_of
from runners.config.schema import LiveCommandConfig, Record
from runners.ros import ros1, ros2
from runners.ros.mcap_drives import LiveRecorder
from runners.ros.node import Node, NodeConfig
from runners.ros.simulator import Outcomes, SimulatedRobot, check_scans
from runners.ros.topics import LiveTopicsConfig
from runners.ros.transport import Transport
from runners.workers.episodes import episode_rng
from runners.workers.mcap_episodes import check_installed as check_mcap

SIMULATOR = "simulator"
_INSTALLED = {1: ros1.check_installed, 2: ros2.check_installed}
_NODES_ONLY = ("guide", "planner", "weights", "ablation", "system", "frames", "scan", "people", "record")
_SIMULATOR_ONLY = ("map", "sim", "runs")


def validate(job: Job[LiveCommandConfig]) -> None:
    """Check the job, and that its version of ROS is installed. Raises InputError."""
    config = job.config
    if config.ros not in _INSTALLED:
        raise InputError(
            f"ros is {config.ros}: must be 1 or 2; lme live ros1, lme live ros2 and --ros1, --ros2 set it"
        )
    _check_keys(job)
    require("seed", config.seed, at_least=0)
    topics = fill_dataclass(LiveTopicsConfig, config.topics, "topics")
    configured(config.live, "live")
    # The simulator needs maps, the node what it reads and how it decides.
    if _simulates(job):
        require("runs", config.runs, at_least=1)
        maps = build.map_set(config)
        check_task(maps.task(maps.numbers[0]), config.robot)
        check_scans(topics, build.simulator(_finely_stepped(config)))
    else:
        fill_dataclass(ScanConfig, config.scan, "scan")
        fill_dataclass(FramesConfig, config.frames, "frames")
        if config.record is Record.mcap:
            check_mcap()
        build.refuse_truth(config)
        build.navigator(config)
    _INSTALLED[config.ros]()


def drive(job: Job[LiveCommandConfig], arguments: Sequence[str] = ()) -> None:
    """Drive until Ctrl-C, or until the simulator has driven all worlds. arguments: ROS's own."""
    signals: list[int] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        """End as Ctrl-C does, with the robot at rest."""
        signals.append(number)
        raise KeyboardInterrupt

    # Let every signal that ends the command stop the robot first.
    previous_handlers = {number: signal.signal(number, interrupt) for number in _ends()}
    transport = None
    try:
        transport = connect(job.config.ros, SIMULATOR if _simulates(job) else "lme", arguments)
        (_simulate if _simulates(job) else drive_robot)(job, transport)
    except (KeyboardInterrupt, RuntimeError) as error:
        # pybind11, in rclpy, turns an interrupt during a conversion into a RuntimeError.
        if isinstance(error, RuntimeError) and not signals:
            raise
        print("stopped")
    finally:
        if transport is not None:
            transport.close()
        for number, handler in previous_handlers.items():
            signal.signal(number, handler)


def connect(version: int | None, name: str, arguments: Sequence[str]) -> Transport:
    """Return a node of ROS 1 or 2. Raises InputError if it is not installed, or if ROS 1 has no master."""
    return ros1.Ros1(name, arguments) if version == 1 else ros2.Ros2(name, arguments)


def _simulate(job: Job[LiveCommandConfig], transport: Transport) -> None:
    config = job.config
    maps = build.map_set(config)
    simulator_config = configured(config.live, "live")[1]
    topics = fill_dataclass(LiveTopicsConfig, config.topics, "topics")
    robot = SimulatedRobot(
        simulator_config, transport, topics, config.robot, build.simulator(_finely_stepped(config))
    )
    print(
        f"simulated {config.robot.name} in ROS {config.ros}: waits for commands on {topics.command}",
        flush=True,
    )
    keys = _keys(maps.numbers, config.runs)
    with Outcomes(job.run_dir) as outcomes:
        for (world, run), result in zip(keys, robot.drive(_tasks(config)), strict=False):
            outcomes.add(world, run, result)


def _tasks(config: LiveCommandConfig) -> Iterator[tuple[Task, np.random.Generator]]:
    """Yield every task with the simulator's random numbers, as `lme eval` draws them."""
    maps = build.map_set(config)
    for world, run in _keys(maps.numbers, config.runs):
        task = maps.task(world)
        check_task(task, config.robot)
        yield task, episode_rng(config.seed, world, run).spawn(2)[1]


def _keys(worlds: Sequence[int], runs: int) -> list[tuple[int, int]]:
    return [(world, run) for run in range(runs) for world in worlds]


def _finely_stepped(config: LiveCommandConfig) -> LiveCommandConfig:
    """Return the config with the simulator's step as control period, since commands may come at any time."""
    return replace(config, robot=replace(config.robot, control_rate=1.0 / config.live["step"]))


def _simulates(job: Job[Any]) -> bool:
    return job.choices["live"] == SIMULATOR


def _check_keys(job: Job[LiveCommandConfig]) -> None:
    """Raise InputError for a key that has no meaning for the node, or for the simulator."""
    foreign, reader = (
        (_NODES_ONLY, "the nodes read") if _simulates(job) else (_SIMULATOR_ONLY, "the simulator reads")
    )
    for override in job.overrides:
        if key_of(override).partition(".")[0] in foreign:
            raise InputError(f"{override}: only {reader} this; omit it")


def _ends() -> list[signal.Signals]:
    """Return the signals that end the command. A closing terminal sends SIGHUP, which nohup ignores."""
    hears = signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN
    return [signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if hears else [])]


def drive_robot(job: Job[LiveCommandConfig], transport: Transport) -> None:
    """Drive the robot until an exception, such as KeyboardInterrupt."""
    config = job.config
    node_config: NodeConfig = configured(config.live, "live")[1]
    topics = fill_dataclass(LiveTopicsConfig, config.topics, "topics")

    def navigator(robot: Robot) -> Navigator:
        return build.navigator(config, robot)

    scan, frames = (
        fill_dataclass(ScanConfig, config.scan, "scan"),
        fill_dataclass(FramesConfig, config.frames, "frames"),
    )
    # Connect the driver to ROS.
    measured = topics.twist == "measured"
    driver = LiveDriver(navigator, config.robot, node_config, scan, frames, measured_twists=measured)
    node = Node(node_config, transport, topics, driver, config.robot.dt)
    printed_state = ""

    def print_state(step: LiveStep) -> None:
        """Print the state of the robot whenever it changes."""
        nonlocal printed_state
        if step.text != printed_state:
            printed_state = step.text
            print(step.text, flush=True)

    node.listen(print_state)
    version = transport.version
    action = f" or the action {topics.action_in(version)}" if node.serves_action else ""
    print(f"{config.robot.name} in ROS {version}: reads {topics.scan} and {topics.pose}", flush=True)
    print(f"goals on {topics.goal_in(version)}{action}, commands on {topics.command}", flush=True)
    # Record, if asked for, and drive.
    with ExitStack() as stack:
        if config.record is Record.mcap:
            node.listen(stack.enter_context(LiveRecorder(job.run_dir, config, driver)).take)
        node.run()
