"""Navigation on recorded messages: one decision per control period, without executing any command.

The goal is a fixed point, or the messages of a topic.
"""

from __future__ import annotations

import math
import warnings
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from time import perf_counter_ns
from typing import Any, NamedTuple, Protocol

import numpy as np

from lme.errors import InputError
from lme.geometry.collision import sweep
from lme.geometry.frames import to_robot
from lme.geometry.motion import drive
from lme.guides.lme.explanation import Explanation
from lme.guides.lme.maintenance import Choice
from lme.live.frames import TransformTree
from lme.live.goal import Goal
from lme.live.messages import SECOND, frame, twist_of
from lme.live.poses import Posture, StampedMotion, Track
from lme.live.scan_source import ScanSource
from lme.navigation.navigator import Navigator
from lme.perception.scan_check import ScanTally
from lme.perception.scan_points import obstacle_points
from lme.robots import Robot
from lme.types import Floats, Observation, Pose, Twist
from runners.recordings.bags import Message
from runners.recordings.posed_scans import PosedScans
from runners.recordings.recording import Recording

_HERE = Pose(0.0, 0.0, 0.0)
_NO_EDGES = np.empty((0, 4))
_STEP = 0.02  # [m] furthest that a point of the footprint moves between collision checks
_SAMPLE = 60  # minimum number of decisions kept for the pictures, if there are enough
_TIMES_TOO_FAST = 3.0  # by which a recorded motion exceeds the limits if its unit is another one
_FAR = 1000.0  # [m] from the end of the drive, where a goal is more likely in another unit or frame
LAST = "last"


class ReplayStep(NamedTuple):
    """A tick: input and decision. target, subgoal (2,) and scan points (M, 2) are in the robot frame [m]."""

    time_s: float
    motion: StampedMotion
    target: Floats
    points: Floats
    subgoal: Floats
    command: Twist


Listener = Callable[[ReplayStep], None]


@dataclass(slots=True)
class Log:
    """Results of a replay.

    rows: columns by name, one row per tick. commands: the recorded (stamp [ns], v [m/s], ω [rad/s]). skipped: number
    of ticks without a decision, by reason. scans: number of scans. tally: counts over the scans of the decisions.
    sample: steps spread over the recording.
    """

    rows: list[dict[str, Any]] = field(default_factory=list)
    commands: list[tuple[int, float, float]] = field(default_factory=list)
    skipped: dict[str, int] = field(default_factory=lambda: {"no pose": 0, "no goal": 0})
    scans: int = 0
    tally: ScanTally = field(default_factory=ScanTally)
    sample: list[ReplayStep] = field(default_factory=list)


class Driver:
    """Navigation over messages in recorded order, with one decision per control period of the robot.

    Each decision uses the scan nearest to its due time, or every scan is used, and the pose at the stamp of that
    scan. horizon [s]: time over which the clearance of a command is predicted. stale [ns]: largest difference between
    the stamps of a pose and of the scan.
    """

    def __init__(
        self,
        recording: Recording,
        scan_source: ScanSource,
        navigator: Navigator,
        goal: GoalSource,
        horizon: float,
        stale: int,
        every_scan: bool,
    ) -> None:
        self._recording, self._scan_source = recording, scan_source
        self._navigator, self._goal = navigator, goal
        self._robot: Robot = scan_source.robot
        self._horizon = horizon
        ticks = None if every_scan else _Ticks(self._robot.dt, recording.scan_rate)
        self._scans = PosedScans(recording, stale, None if ticks is None else ticks.due)
        self._listeners: list[Listener] = []
        self._sampler = _Sampler()
        self.log = Log()

    def listen(self, listener: Listener) -> None:
        """Call `listener(step)` at every tick."""
        self._listeners.append(listener)

    def take(self, message: Message) -> None:
        """Process the next message. Raises InputError if time goes backwards."""
        topics, name = self._recording.topics, message.topic
        self._decide(message)
        self._scans.take(message)
        if topics.command is not None and name == topics.command.name:
            twist = twist_of(message.content, topics.command.type)
            self.log.commands.append((self._recording.stamp(message), *twist))
        if topics.goal is not None and name == topics.goal.name:
            self._goal.take(message, self._scans.track, self._scans.tree)

    def finish(self) -> Log:
        """Make the remaining decisions. Raises InputError if there was no decision at all."""
        self._decide(None)
        self.log.scans = self._scans.scans
        if not self.log.rows:
            reasons = ", ".join(
                f"{count} without a {key[3:]}" for key, count in self.log.skipped.items() if count
            )
            raise InputError(
                f"bag {self._recording.bag.path}: nothing to replay: {self.log.scans} scans"
                + (f", skipped: {reasons}" if reasons else " between start and end")
            )
        self._warn_of_motion()
        self.log.sample = self._sampler.kept
        return self.log

    def _warn_of_motion(self) -> None:
        """Warn of poses and stamps that no robot has, such as poses in millimetres."""
        rows, robot = self.log.rows, self._robot
        times, x, y, yaw = (
            np.array([row[key] for row in rows]) for key in ("time_s", "x_m", "y_m", "yaw_rad")
        )
        duration = times[-1] - times[0]
        if self.log.scans > 1 and duration == 0.0:
            warnings.warn(
                f"all {self.log.scans} scans have the same stamp: must have the times at which they were taken",
                stacklevel=2,
            )
            return
        steps = np.diff(times) > 0.0
        if not steps.any():
            return
        speed = np.hypot(np.diff(x), np.diff(y))[steps].sum() / duration
        rate = np.abs(np.remainder(np.diff(yaw) + math.pi, math.tau) - math.pi)[steps].sum() / duration
        for measured, limit, unit, key, hint in (
            (speed, robot.v_max, "m/s", "v_max", "in millimetres or centimetres"),
            (rate, robot.omega_max, "rad/s", "omega_max", "in degrees"),
        ):
            if measured > _TIMES_TOO_FAST * limit:
                warnings.warn(
                    f"the recorded poses move at {measured:.3g} {unit} on average, and robot.{key} is {limit:g} "
                    f"{unit}: are they {hint}, or of another robot?",
                    stacklevel=2,
                )

    def _decide(self, next_message: Message | None) -> None:
        """Decide on the scans whose poses are known. next_message: the next message; None at the end."""
        for message, motion, posture in self._scans.ready(next_message):
            if motion is None:
                self.log.skipped["no pose"] += 1
            else:
                self._tick(message, motion, posture)

    def _tick(self, message: Message, motion: StampedMotion, posture: Posture | None) -> None:
        target = self._goal.target(motion, self._scans.tree)
        if target is None:
            self.log.skipped["no goal"] += 1
            return
        last_command = self._commanded(motion)
        observation = self._scan_source.observation(message.content, motion, target, last_command, posture)
        self.log.tally.add(observation.scan)
        start_ns = perf_counter_ns()
        command = self._navigator.act(observation, motion.stamp / SECOND)
        decision_us = (perf_counter_ns() - start_ns) / 1000.0
        self._note(observation, motion, command, decision_us)

    def _commanded(self, motion: StampedMotion) -> Twist:
        """Return the last recorded command: zero before the first one, the robot's twist if no topic has commands."""
        commands = self.log.commands
        index = bisect_left(commands, motion.stamp, key=itemgetter(0))
        if index:
            return Twist(*commands[index - 1][1:])
        return motion.twist if self._recording.topics.command is None else Twist(0.0, 0.0)

    def _note(
        self, observation: Observation, motion: StampedMotion, command: Twist, decision_us: float
    ) -> None:
        guidance = self._navigator.guidance
        assert guidance is not None
        points = obstacle_points(observation.scan, self._robot.lidar.mount)
        time_s = self._recording.seconds(motion.stamp)
        (x, y), (subgoal_x, subgoal_y) = observation.target, guidance.subgoal
        # Add a row to the table, in SI units except for the time of the decision.
        self.log.rows.append(
            {
                "time_s": time_s,
                "stamp_ns": motion.stamp,
                **dict(zip(("x_m", "y_m", "yaw_rad"), motion.pose, strict=True)),
                **dict(zip(("v_mps", "omega_radps"), motion.twist, strict=True)),
                "target_x_m": float(x),
                "target_y_m": float(y),
                "subgoal_x_m": float(subgoal_x),
                "subgoal_y_m": float(subgoal_y),
                "switched": bool(guidance.switched),
                "blocked": bool(guidance.blocked),
                "command_v_mps": command.v,
                "command_omega_radps": command.omega,
                "scan_points": len(points),
                **self._clearances(points, motion.twist, command),
                "decision_us": decision_us,
                **_features(self._navigator.explanation()),
            }
        )
        # Pass the same on as a step, to the sample for the pictures and to the listeners.
        step = ReplayStep(time_s, motion, observation.target, points, guidance.subgoal, command)
        self._sampler.offer(step)
        for listener in self._listeners:
            listener(step)

    def _clearances(self, points: Floats, twist: Twist, command: Twist) -> dict[str, float]:
        """Return the clearance of the footprint [m]: the present one, and the smallest while each command is held."""
        circles = np.column_stack((points, np.zeros(len(points))))
        box, robot = self._robot.footprint.box, self._robot

        # The smallest clearance on the way that a command leads to within the horizon.
        def smallest(held: Twist) -> float:
            poses, _ = drive(
                _HERE,
                twist,
                held,
                robot.limits.bounds,
                self._horizon,
                _STEP,
                robot.footprint.circumscribed_radius,
            )
            return sweep(poses, box, circles, _NO_EDGES)[0]

        return {
            "clearance_m": sweep(np.array([_HERE]), box, circles, _NO_EDGES)[0],
            "command_clearance_m": smallest(command),
            "recorded_clearance_m": smallest(twist),
        }


class _Ticks:
    """Selection of the scans on which decisions are made."""

    def __init__(self, dt: float, scan_rate: float) -> None:
        self._period = round(dt * SECOND)
        self._slack = round(min(0.5 * SECOND / scan_rate, 0.5 * self._period)) if scan_rate else 0
        self._next: int | None = None

    def due(self, stamp: int) -> bool:
        """Return whether to decide on the scan with this stamp [ns]; always true for the first scan."""
        if self._next is not None and stamp < self._next - self._slack:
            return False
        # Count on from the due time, unless the recording has a gap: then from this scan.
        is_late = self._next is None or stamp > self._next + self._slack
        self._next = (stamp if is_late or self._next is None else self._next) + self._period
        return True


def _features(explanation: Explanation | None) -> dict[str, Any]:
    """Return how the current subgoal was chosen, its score, and its value in each criterion."""
    if explanation is None:
        return {}
    is_kept = explanation.decision.choice is Choice.KEPT and explanation.old_features is not None
    values = explanation.old_features if is_kept else explanation.features[:, explanation.new]
    score = explanation.old_score if is_kept else explanation.scores[explanation.new]
    values_by_name = zip(explanation.names, np.asarray(values), strict=True)
    return {
        "choice": str(explanation.decision.choice.value),
        "score": float(score if score is not None else math.nan),
        **{f"feature_{name}": float(value) for name, value in values_by_name},
    }


class _Sampler:
    """An evenly spaced sample of steps, whose number need not be known in advance."""

    def __init__(self) -> None:
        self.kept: list[ReplayStep] = []
        self._stride = 1
        self._seen = 0

    def offer(self, step: ReplayStep) -> None:
        if self._seen % self._stride == 0:
            self.kept.append(step)
            if len(self.kept) == 2 * _SAMPLE:
                del self.kept[1::2]
                self._stride *= 2
        self._seen += 1


class GoalSource(Protocol):
    """A source of the goal, which may move."""

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Process a message of the goal's topic."""

    def target(self, motion: StampedMotion, tree: TransformTree) -> Floats | None:
        """Return the goal (2,) in the robot frame [m]; None if there is none yet."""


class FixedGoal:
    """A fixed point (2,) in the odometry frame [m]."""

    def __init__(self, point: Sequence[float]) -> None:
        self._point = np.array(point, dtype=np.float64)

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Do nothing, since the goal does not move."""

    def target(self, motion: StampedMotion, tree: TransformTree) -> Floats | None:
        """Return the point in the robot frame [m]."""
        return to_robot(self._point, motion.pose)


class TopicGoal:
    """The last pose on a topic, in any frame that tf connects to the odometry frame."""

    def __init__(self, recording: Recording, tolerance: int) -> None:
        self._recording = recording
        self._tolerance = tolerance
        self._goal: Goal | None = None

    def take(self, message: Message, track: Track, tree: TransformTree) -> None:
        """Keep the pose. Raises InputError if tf does not connect its frame to the odometry frame."""
        frames, name = self._recording.frames, frame(message.content.header.frame_id)
        if name and all(tree.lookup(frame_name, name) is None for frame_name in frames):
            raise InputError(
                f"goal: it is given in the frame {name}, which tf does not connect to {frames.odom}: "
                "give [x, y] in the odometry frame"
            )
        position = message.content.pose.position
        point = np.array([float(position.x), float(position.y)])
        self._goal = Goal(point, name, self._recording.stamp(message))
        self._goal.place(frames, tree, track, self._tolerance)

    def target(self, motion: StampedMotion, tree: TransformTree) -> Floats | None:
        """Return the goal (2,) in the robot frame [m]; None before the first message."""
        return None if self._goal is None else self._goal.target(motion, self._recording.frames, tree)


def goal_source(requested: Any, recording: Recording, stop: int | None, tolerance: int) -> GoalSource:
    """Return the source of the goal that `goal=` gives. stop: end of the replay [ns, clock of the file]."""
    if recording.topics.goal is not None:
        return TopicGoal(recording, tolerance)
    end = recording.last_pose(stop)[:2]
    if requested is None or requested == LAST:
        return FixedGoal(end)
    away = math.dist(requested, end)
    if away > _FAR:
        warnings.warn(
            f"goal is {list(requested)}: {away:,.0f} m from where the recorded drive ends: must be in metres in the "
            "odometry frame; is it in millimetres, or in another frame?",
            stacklevel=2,
        )
    return FixedGoal(requested)


def topic_of(requested: Any) -> str | None:
    """Return the topic that `goal=` names; None for a point or no value. Raises InputError for anything else."""
    if requested is None or isinstance(requested, str):
        return None if requested in (None, LAST) else requested
    numbers = isinstance(requested, Sequence) and all(isinstance(v, int | float) for v in requested)
    if not numbers or len(requested) != 2 or not np.isfinite(list(requested)).all():
        raise InputError(
            f"goal is {requested!r}: must be [x, y] in the odometry frame [m], a topic, or {LAST}"
        )
    return None
