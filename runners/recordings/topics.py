"""Choice of the topics of a recording: by type, or by name if there are several of a type."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from lme.errors import InputError, nearest
from lme.live import messages
from lme.live.poses import TWISTS
from runners.recordings.bags import Bag, Topic
from runners.reports.analysis.tables import aligned

# Message types of each role in order of preference, and the usual name of such a topic in ROS.
_SCANS = (messages.LASER_SCAN, messages.POINT_CLOUD)
_POSES = (messages.ODOMETRY,)  # if there are none: tf, then _OTHER_POSES
_OTHER_POSES = (messages.POSE, messages.POSE_WITH_COVARIANCE, messages.TRANSFORM)
_COMMANDS = (messages.TWIST, messages.TWIST_STAMPED)
_GOALS = (messages.POSE,)
_IMUS = (messages.IMU,)
_USUAL = {"scan": "/scan", "pose": "/odom", "command": "/cmd_vel"}


@dataclass(slots=True)
class BagTopicsConfig:
    """Names of topics; null: chosen by type. twist: where velocities come from, the messages or the poses."""

    scan: str | None = None
    pose: str | None = None
    command: str | None = None
    imu: str | None = None
    twist: str = "measured"

    def __post_init__(self) -> None:
        if self.twist not in TWISTS:
            raise InputError(f"topics.twist is {self.twist}: must be one of {', '.join(TWISTS)}")


class ChosenTopic(NamedTuple):
    """A topic and the message type that is read."""

    name: str
    type: str


class Topics(NamedTuple):
    """The topics that are read. pose: None if poses come from tf. tf: names of the tf topics, if any.

    measured_twists: whether velocities come from the messages with poses instead of the slope of the poses.
    """

    scan: ChosenTopic
    pose: ChosenTopic | None
    command: ChosenTopic | None
    goal: ChosenTopic | None
    imu: ChosenTopic | None
    tf: tuple[str, ...]
    measured_twists: bool

    @property
    def names(self) -> set[str]:
        """Return the names of all topics that are read."""
        single = (topic.name for topic in self if isinstance(topic, ChosenTopic))
        return {*single, *self.tf}

    @property
    def imu_name(self) -> str | None:
        """Return the topic of the IMU; None if none is read."""
        return None if self.imu is None else self.imu.name

    @property
    def pose_name(self) -> str:
        """Return the source of poses: a topic, or tf."""
        return "tf" if self.pose is None else self.pose.name


def choose(bag: Bag, config: BagTopicsConfig, goal: str | None) -> Topics:
    """Choose the topics by type and name. goal: name of the goal's topic, if it has one.

    Raises InputError if a topic is missing or of the wrong type, or if there are several and none has the usual name.
    """
    # Choose a topic for each role; only the scans, and poses from some source, must be there.
    all_topics = bag.topics()
    tf = tuple(topic.name for topic in all_topics if set(topic.types) & set(messages.TF) and topic.number)
    scan = _choose(all_topics, "scan", config.scan, _SCANS)
    if scan is None:
        raise InputError(
            f"bag {bag.path}: no scans: no topic of type {_or(_SCANS)}; it has {_topic_list(all_topics)}"
        )
    kinds = _POSES if config.pose is None else (*_POSES, *_OTHER_POSES)
    pose = _choose(all_topics, "pose", config.pose, kinds)
    command = _choose(all_topics, "command", config.command, _COMMANDS)
    if command is not None and config.command is None:
        command = _without_several_types(bag, all_topics, command)
    chosen_goal = None if goal is None else _choose(all_topics, "goal", goal, _GOALS)
    imu = _choose_imu(all_topics, config.imu, scan)
    topics = Topics(scan, pose, command, chosen_goal, imu, tf, config.twist == "measured")
    return topics._replace(pose=other_pose(bag, topics)) if pose is None and not tf else topics


def _choose_imu(all_topics: Sequence[Topic], requested: str | None, scan: ChosenTopic) -> ChosenTopic | None:
    """Return the requested topic of an IMU, else the only one, which may level clouds; a LaserScan needs none."""
    if requested is not None:
        return _requested_topic(all_topics, "topics.imu", requested, _IMUS)
    imu_topics = [topic.name for topic in all_topics if messages.IMU in topic.types and topic.number]
    return (
        ChosenTopic(imu_topics[0], messages.IMU)
        if scan.type == messages.POINT_CLOUD and len(imu_topics) == 1
        else None
    )


def _without_several_types(bag: Bag, all_topics: Sequence[Topic], command: ChosenTopic) -> ChosenTopic | None:
    """Return the topic of commands; None, with a warning, if its messages have several types.

    A replay does not need commands.
    """
    types = next(topic.types for topic in all_topics if topic.name == command.name)
    if len(types) == 1:
        return command
    warnings.warn(
        f"bag {bag.path}: the commands on {command.name} are left out, because they are of several types: {_or(types)}",
        stacklevel=2,
    )
    return None


def other_pose(bag: Bag, topics: Topics) -> ChosenTopic:
    """Return a topic of poses other than odometry, e.g. of motion capture. Raises InputError if there is none."""
    all_topics = bag.topics()
    pose = _choose(all_topics, "pose", None, _OTHER_POSES, excluded=topics.goal.name if topics.goal else None)
    if pose is None:
        raise InputError(
            f"bag {bag.path}: no poses: no topic of type {_or((*_POSES, *_OTHER_POSES))} and no tf from "
            f"an odometry frame to a base frame (frames.odom, frames.base); it has {_topic_list(all_topics)}"
        )
    return pose


def table(bag: Bag) -> list[str]:
    """Return one line per topic: name, type, number of messages, rate, and its possible roles."""
    all_topics = bag.topics()
    uses = [
        ("scan", _SCANS),
        ("pose", (*_POSES, *_OTHER_POSES)),
        ("command", _COMMANDS),
        ("imu", _IMUS),
        ("tf", messages.TF),
    ]
    rows = [("topic", "type", "messages", "Hz", "can be")]
    for topic in all_topics:
        roles = [role for role, types in uses if set(topic.types) & set(types)]
        if set(topic.types) & set(_GOALS):
            roles.append("goal")
        rows.append(
            (topic.name, " | ".join(topic.types), str(topic.number), f"{topic.rate:.1f}", ", ".join(roles))
        )
    return aligned(rows, right=(2, 3))


def _choose(
    all_topics: Sequence[Topic],
    role: str,
    requested: str | None,
    types: Sequence[str],
    excluded: str | None = None,
) -> ChosenTopic | None:
    """Return the requested topic, else the only or usual one of the first of these types that occurs, else None."""
    key = "goal" if role == "goal" else f"topics.{role}"
    if requested is not None:
        return _requested_topic(all_topics, key, requested, types)
    # Take the first type that occurs; of several topics, only the usual name is clear.
    for kind in types:
        candidates = [t.name for t in all_topics if kind in t.types and t.number and t.name != excluded]
        if len(candidates) == 1 or _USUAL[role] in candidates:
            return ChosenTopic(_USUAL[role] if _USUAL[role] in candidates else candidates[0], kind)
        if candidates:
            raise InputError(
                f"{key} is null: there are several of type {kind}: choose one of {', '.join(candidates)}"
            )
    return None


def _requested_topic(
    all_topics: Sequence[Topic], key: str, requested: str, types: Sequence[str]
) -> ChosenTopic:
    names = {topic.name: topic for topic in all_topics}
    name = requested if requested in names else f"/{requested}"
    if name not in names:
        raise InputError(
            f"{key} is {requested}: no such topic; {nearest(requested, names)}it has {_topic_list(all_topics)}"
        )
    kinds = [kind for kind in types if kind in names[name].types]
    if not kinds:
        raise InputError(
            f"{key} is {requested}, of type {_or(names[name].types)}: must be of type {_or(types)}"
        )
    if not names[name].number:
        raise InputError(f"{key} is {requested}: the recording has no messages on it")
    return ChosenTopic(name, kinds[0])


def _topic_list(all_topics: Sequence[Topic]) -> str:
    suffixes = {topic.name: "" if topic.number else ", no messages" for topic in all_topics}
    return ", ".join(f"{topic.name} ({_or(topic.types)}{suffixes[topic.name]})" for topic in all_topics)


def _or(types: Sequence[str]) -> str:
    return " or ".join(kind.replace("/msg/", "/") for kind in types)
