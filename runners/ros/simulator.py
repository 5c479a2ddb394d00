"""The simulator behind a real robot's topics, and the table of what came of its episodes.

It publishes clock, scans or clouds, odometry, the orientation of an IMU, tf and goals, and takes commands.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from lme import metrics
from lme.errors import InputError, require
from lme.geometry.frames import relative
from lme.live.messages import SECOND, twist_of
from lme.navigation.episode import Progress
from lme.robots import Robot
from lme.simulation.simulator import Attitude, Simulator, tilting_of
from lme.types import Observation, Outcome, Pose, Twist
from lme.worlds.world import Task
from runners.ros.outgoing import OutgoingMessages
from runners.ros.topics import CLOUD, IMU_KIND, TF_MESSAGE, LiveTopicsConfig
from runners.ros.transport import Delivery, Publisher, Transport

ODOM, BASE = "odom", "base_link"
GOALS = ("topic", "action", "none")
_REST = Twist(0.0, 0.0)
TABLE = "outcomes.csv"
COLUMNS = (
    "world",
    "run",
    "outcome",
    "time_s",
    "barn_metric",
    "spl",
    "path_length_m",
    "min_clearance_m",
    "final_distance_m",
)
BARN = ("barn", "dynabarn")  # maps whose tables have the metric


@dataclass(slots=True)
class SimulatorConfig:
    """Speed of the simulator, and what it publishes."""

    speed: float
    step: float
    scan_rate: float
    odometry_rate: float
    watchdog: float
    goal: str
    pause: float
    scan_frame: str

    def __post_init__(self) -> None:
        require("speed", self.speed, above=0.0)
        require("step", self.step, above=0.0, at_most=0.1)
        for key in ("scan_rate", "odometry_rate"):
            require(key, getattr(self, key), above=0.0, at_most=1.0 / self.step)
        require("watchdog", self.watchdog, above=0.0)
        require("pause", self.pause, at_least=0.0)
        if self.goal not in GOALS:
            raise InputError(f"live.goal is {self.goal}: must be one of {', '.join(GOALS)}")
        if self.scan_frame in ("", ODOM, BASE):
            raise InputError(
                f"live.scan_frame is {self.scan_frame!r}: must be another name than {ODOM} and {BASE}"
            )


class Driven(NamedTuple):
    """An episode over ROS. time: on the task's clock [s]. path_length, min_clearance, final_distance: [m]."""

    task: Task
    outcome: Outcome
    time: float
    path_length: float
    min_clearance: float
    final_distance: float


def check_scans(topics: LiveTopicsConfig, simulator: Simulator) -> None:
    """Raise InputError if the topics want clouds and the simulator has none."""
    if topics.scan_type == CLOUD and tilting_of(simulator) is None:
        raise InputError(
            f"topics.scan_type is {CLOUD}: of all simulators, only sim=mujoco with robot=go2 sends clouds; choose it, "
            "or topics.scan_type=LaserScan"
        )


class SimulatedRobot:
    """A robot in one world after another. `robot`: from the config. `simulator`: of the robot with dt = step."""

    Config = SimulatorConfig

    def __init__(
        self,
        config: SimulatorConfig,
        transport: Transport,
        topics: LiveTopicsConfig,
        robot: Robot,
        simulator: Simulator,
    ) -> None:
        self._config, self._ros, self._topics = config, transport, topics
        self._robot, self._simulator = robot, simulator
        self._tilting = tilting_of(simulator)
        self._sends_clouds = topics.scan_type == CLOUD
        if self._tilting is not None:
            self._tilting.whole_clouds = self._sends_clouds
        self._make = OutgoingMessages(transport)
        # [ns] simulated time, which never goes backwards; a stamp of 0 would mean that there is none
        self._now = SECOND
        self._step = round(config.step * SECOND)
        self._period = config.step / config.speed  # [s] of real time
        self._steps = 0
        self._scans, self._poses = (  # steps between scans, and between messages of odometry
            max(1, round(1.0 / (rate * config.step))) for rate in (config.scan_rate, config.odometry_rate)
        )
        self._next = time.monotonic()  # [s] when the next step is due
        self._command, self._commanded = _REST, 0
        self._connect()

    def drive(self, tasks: Iterable[tuple[Task, np.random.Generator]]) -> Iterator[Driven]:
        """Drive each task with its random numbers; yield the results."""
        for task, rng in tasks:
            yield self._episode(task, rng)
            for _ in range(round(self._config.pause / self._config.step)):
                self._wait()
                self._clock(self._make.clock(self._now))

    def _episode(self, task: Task, rng: np.random.Generator) -> Driven:
        """Drive an episode. Its time begins with the first command that moves the robot."""
        # The goal is sent in the odometry frame, whose origin is the start.
        observation = self._simulator.reset(task, rng)
        progress = Progress(task, self._simulator.state)
        self._command = _REST
        goal = relative(Pose(float(task.goal[0]), float(task.goal[1]), task.start.yaw), task.start)
        is_sent = has_begun = False
        waited_s = 0.0
        # The world stands still until the first command moves the robot.
        while (outcome := progress.outcome(self._simulator.state)) is None and waited_s < task.time_limit:
            self._publish(observation)
            is_sent = is_sent or self._send(goal)
            self._wait()
            command = self._current_command()
            has_begun = has_begun or command != _REST
            if has_begun:
                previous_state = self._simulator.state
                observation = self._simulator.step(command)
                progress.moved(previous_state, self._simulator.state)
            else:
                waited_s += self._config.step
        self._steps = (
            0  # everything is due, so that a node with the task's tolerance sees that it has arrived
        )
        self._publish(observation)
        state = self._simulator.state
        return Driven(
            task,
            outcome or Outcome.TIMEOUT,
            progress.time(state) if has_begun else task.time_limit,
            progress.path_length,
            progress.min_clearance,
            math.dist(state.pose[:2], task.goal),
        )

    def _current_command(self) -> Twist:
        """Return the last command; zero if it is older than the watchdog allows."""
        is_fresh = self._now - self._commanded <= self._config.watchdog * SECOND
        return self._command if is_fresh else _REST

    def _wait(self) -> None:
        """Wait for the next step and take the commands that arrive meanwhile. A late step delays the later ones."""
        while (remaining_s := self._next - time.monotonic()) > 0.0:
            self._ros.handle(remaining_s)
        self._ros.handle(0.0)
        self._next = max(self._next, time.monotonic() - self._period) + self._period
        self._now += self._step

    def _publish(self, observation: Observation) -> None:
        """Publish the sensors' data and then the time, so that a node has all data of that time."""
        time_ns, make, pose = self._now, self._make, observation.odometry
        attitude = Attitude() if self._tilting is None else self._tilting.attitude()
        if self._imu is not None:
            self._imu(make.imu(time_ns, BASE, pose.yaw, attitude))
        if self._steps % self._poses == 0:
            self._odometry(make.odometry(time_ns, ODOM, BASE, pose, observation.twist, attitude))
            if self._tf is not None:
                self._tf(make.transform(time_ns, ODOM, BASE, pose, attitude))
        if self._steps % self._scans == 0:
            self._scan(self._scan_message(observation))
        self._steps += 1
        self._clock(make.clock(time_ns))

    def _scan_message(self, observation: Observation) -> Any:
        frame = self._config.scan_frame
        if self._tilting is not None and self._sends_clouds:
            return self._make.cloud(self._now, frame, self._tilting.cloud())
        return self._make.scan(self._now, frame, observation.scan, self._scans * self._config.step)

    def _send(self, goal: Pose) -> bool:
        """Send the goal if somebody subscribes; return whether it was sent."""
        if self._goal is None:
            return True
        if not self._goal.watched:
            return False
        self._goal(self._make.pose(self._now, ODOM, goal))
        return True

    def _connect(self) -> None:
        ros, topics = self._ros, self._topics
        self._clock = ros.publisher(topics.clock, "rosgraph_msgs/Clock")
        self._odometry = ros.publisher(topics.pose, "nav_msgs/Odometry")
        self._scan = ros.publisher(topics.scan, topics.scan_kind)
        self._imu: Publisher | None = None
        if topics.imu is not None and self._tilting is not None:
            self._imu = ros.publisher(topics.imu, IMU_KIND)
        self._tf: Publisher | None = None
        if ros.has(TF_MESSAGE):
            self._tf = ros.publisher(topics.tf, TF_MESSAGE)
            height = Attitude() if self._tilting is None else Attitude(self._tilting.lidar_height())
            mount = self._make.transform(0, BASE, self._config.scan_frame, self._robot.lidar.sensor, height)
            self._mount = ros.publisher(topics.tf_static, TF_MESSAGE, latched=True)
            self._mount(mount)
        self._goal: Publisher | None = None
        if self._config.goal == "topic":
            self._goal = ros.publisher(topics.goal_in(ros.version), "geometry_msgs/PoseStamped")
        elif self._config.goal == "action":
            self._goal = ros.client(topics.action_in(ros.version))
        ros.subscribe(topics.command, topics.command_kind, self._take, Delivery.NEWEST)

    def _take(self, message: Any) -> None:
        """Take a command. A command that is not finite stops the robot."""
        twist = twist_of(message, f"geometry_msgs/msg/{self._topics.command_type}")
        self._command = twist if all(map(math.isfinite, twist)) else _REST
        self._commanded = self._now


class Outcomes:
    """Table `outcomes.csv` in a run's directory, to which episodes are added; its columns are as in `lme eval`."""

    def __init__(self, run_dir: Path) -> None:
        self._path = run_dir / TABLE
        self._successes: list[bool] = []
        self._scores: list[float] = []

    def __enter__(self) -> Self:
        self._file = self._path.open("w", newline="", encoding="utf-8")
        self._rows = csv.writer(self._file)
        self._rows.writerow(COLUMNS)
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()
        count = len(self._successes)
        if count:
            rate, scores = sum(self._successes) / count, self._scores
            metric = f", BARN metric {sum(scores) / len(scores):.3f}" if scores else ""
            print(f"{count} episodes: success {rate:.3f}{metric}. Table: {self._path}")

    def add(self, world: int, run: int, drive: Driven) -> None:
        """Print one episode and add it to the table."""
        success = drive.outcome is Outcome.SUCCESS
        score = metrics.barn_metric(success, drive.time, drive.task.optimal_time)
        spl = metrics.spl(success, drive.task.shortest_path_length, drive.path_length)
        lengths = drive.path_length, drive.min_clearance, drive.final_distance
        self._rows.writerow([world, run, drive.outcome, drive.time, score, spl, *lengths])
        self._file.flush()
        self._successes.append(success)
        # Only the worlds of BARN and DynaBARN have the metric.
        of_barn = drive.task.map_name.startswith(BARN)
        self._scores += [score] * of_barn
        metric = f"BARN metric {score:.3f}, " if of_barn else ""
        print(
            f"world {world}, run {run}: {drive.outcome} after {drive.time:.1f} s, {metric}"
            f"path {drive.path_length:.1f} m, clearance {drive.min_clearance:.2f} m",
            flush=True,
        )
