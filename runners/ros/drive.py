"""The connection between a navigator, the driver and ROS, and the drive itself."""

from __future__ import annotations

from contextlib import ExitStack

from lme.live.config import ScanConfig
from lme.live.driver import LiveDriver
from lme.live.frames import FramesConfig
from lme.live.step import LiveStep
from lme.navigation.navigator import Navigator
from lme.robots import Robot
from runners.config import build
from runners.config.instantiate import configured, fill_dataclass
from runners.config.job import Job
from runners.config.schema import LiveCommandConfig, Record
from runners.ros.node import Node, NodeConfig
from runners.ros.record import LiveRecorder
from runners.ros.topics import LiveTopicsConfig
from runners.ros.transport import Transport


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
    node.listen(_StatePrinter().take)
    version = transport.version
    action = f" or the action {topics.action_in(version)}" if node.serves_action else ""
    print(f"{config.robot.name} in ROS {version}: reads {topics.scan} and {topics.pose}", flush=True)
    print(f"goals on {topics.goal_in(version)}{action}, commands on {topics.command}", flush=True)
    # Record, if asked for, and drive.
    with ExitStack() as stack:
        if config.record is Record.mcap:
            node.listen(stack.enter_context(LiveRecorder(job.run_dir, config, driver)).take)
        node.run()


class _StatePrinter:
    """A listener that prints the state of the robot whenever it changes."""

    def __init__(self) -> None:
        self._printed_state = ""

    def take(self, step: LiveStep) -> None:
        """Print the state of a step if it is new."""
        if step.text != self._printed_state:
            self._printed_state = step.text
            print(step.text, flush=True)
