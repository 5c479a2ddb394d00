"""Record a simulated episode as ROS 2 messages in an MCAP file, which Foxglove, RViz and `lme replay` open.

The topic /lme carries, as JSON text, the values that no other message holds exactly; for example, ROS stores the
bearings of the beams as float32.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import lme
from lme.robots import Robot
from lme.simulation.simulator import State
from lme.types import Guidance, LaserScan, Observation, Pose, Twist
from runners.records.episode_record import EpisodeKey
from runners.workers.mcap_file import McapFile

FOLDER = "recordings"  # within a run's directory
TOPICS = {  # message types; the topics are in the order in which a control period writes them
    "/lme": "std_msgs/msg/String",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/odom": "nav_msgs/msg/Odometry",
    "/goal": "geometry_msgs/msg/PoseStamped",
    "/scan": "sensor_msgs/msg/LaserScan",
    "/subgoal": "geometry_msgs/msg/PointStamped",
    "/cmd_vel": "geometry_msgs/msg/Twist",
}
# On a robot, /cmd_vel holds what was sent to it, and these topics the planner's commands, the reasons, the state and
# the stamps of the scans [ns].
WANTED, WHY, STATE, TAKEN = "/wanted", "/why", "/state", "/taken"
LATCHED = ("/lme", "/tf_static")  # written once; late subscribers receive them as well
ODOM, BASE, LASER = "odom", "base_link", "laser"

_SECOND = 1_000_000_000
_ADVICE = "free some space there and add resume=true, or choose another directory with hydra.run.dir=PATH"


def recording_path(folder: Path, key: EpisodeKey) -> Path:
    """Return the path of the recording of one episode."""
    return folder / f"world-{key.world}-run-{key.run}.mcap"


class DecisionWriter:
    """Writer of decisions to an open recording. about: JSON values for /lme, besides the bearings of the beams."""

    def __init__(self, file: McapFile, metadata: Mapping[str, Any], robot: Robot) -> None:
        self._file, self._make = file, file.messages
        self._metadata, self._robot = metadata, robot
        self._has_begun = False

    def decision(self, observation: Observation, guidance: Guidance, time_ns: int) -> None:
        """Write the observation and the subgoal, at the time `time_ns`."""
        if not self._has_begun:
            self._begin(observation.scan, time_ns)
        self.motion(observation.odometry, observation.twist, time_ns)
        write, make = self._file.write, self._make
        target, subgoal = observation.target, guidance.subgoal
        write(
            "/goal", make.pose_stamped(time_ns, BASE, Pose(float(target[0]), float(target[1]), 0.0)), time_ns
        )
        write("/scan", make.scan(time_ns, LASER, observation.scan, self._robot.dt), time_ns)
        write("/subgoal", make.point(time_ns, BASE, float(subgoal[0]), float(subgoal[1])), time_ns)

    def motion(self, pose: Pose, twist: Twist, time_ns: int) -> None:
        """Write a pose and a twist."""
        self._file.write("/tf", self._make.transform(time_ns, ODOM, BASE, pose), time_ns)
        self._file.write("/odom", self._make.odometry(time_ns, ODOM, BASE, pose, twist), time_ns)

    def twist(self, topic: str, twist: Twist, time_ns: int) -> None:
        """Write a command."""
        self._file.write(topic, self._make.twist(twist), time_ns)

    def text(self, topic: str, text: str, time_ns: int) -> None:
        """Write a line of text."""
        self._file.write(topic, self._make.text(text), time_ns)

    def _begin(self, scan: LaserScan, time_ns: int) -> None:
        self._has_begun = True
        beams = {name: float(value) for name, value in scan._asdict().items() if name != "ranges"}
        self.text("/lme", json.dumps({**self._metadata, "version": lme.__version__, "scan": beams}), time_ns)
        mount = self._make.transform(time_ns, BASE, LASER, self._robot.lidar.mount)
        self._file.write("/tf_static", mount, time_ns)


class Recorder:
    """Writer of what the policy receives and decides while it drives; an `lme.navigation.episode.Observer`.

    Use as a context manager around one episode; see `McapFile` and `DecisionWriter`.
    """

    def __init__(self, path: Path, metadata: Mapping[str, Any], robot: Robot) -> None:
        self._file = McapFile(path, TOPICS, LATCHED, _ADVICE)
        self._metadata, self._robot = metadata, robot

    def __enter__(self) -> Self:
        self._writer = DecisionWriter(self._file.__enter__(), self._metadata, self._robot)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.__exit__(kind, error, trace)

    def decided(self, observation: Observation, guidance: Guidance, command: Twist, state: State) -> None:
        """Write a control period: the observation, the subgoal and the command."""
        time_ns = round(state.time * _SECOND)
        self._writer.decision(observation, guidance, time_ns)
        self._writer.twist("/cmd_vel", command, time_ns)

    def ended(self, observation: Observation, state: State) -> None:
        """Write the final pose. No decision follows it, so there is no scan."""
        self._writer.motion(observation.odometry, observation.twist, round(state.time * _SECOND))
