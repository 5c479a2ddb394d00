"""The node, which passes messages to the driver, asks it for a step every period, and publishes the result."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

from lme.errors import InputError
from lme.guides.lme.explanation import Explanation, reason
from lme.live.config import LiveConfig
from lme.live.driver import LiveDriver
from lme.live.messages import SECOND, nanoseconds
from lme.live.step import STILL, LiveState, LiveStep
from lme.types import Twist
from runners.ros.outgoing import OK, WARN, OutgoingMessages, markers
from runners.ros.topics import IMU_KIND, TF, TF_MESSAGE, LiveTopicsConfig
from runners.ros.transport import ActionGoal, Delivery, Transport

_AT_REST = 1.0  # [s] for which zero velocity is repeated without a goal; after that, others may drive
_SHUTDOWN_STOPS = 3  # times that zero velocity is sent at shutdown
_DIAGNOSTICS = "lme: navigation"  # name of the status on /diagnostics
_DIAGNOSTICS_PERIOD = 1.0  # [s] of real time between messages on /diagnostics


@dataclass(slots=True)
class NodeConfig(LiveConfig):
    """The config of the driver, extended by that of the node."""

    use_sim_time: bool | None = None


class Node:
    """A navigation node of either version of ROS."""

    Config = NodeConfig

    def __init__(
        self,
        config: NodeConfig,
        transport: Transport,
        topics: LiveTopicsConfig,
        driver: LiveDriver,
        period: float,
    ) -> None:
        """Connect to ROS. period: between decisions [s], on the node's clock."""
        self._config, self._ros, self._driver = config, transport, driver
        self._topics = topics
        self._period = round(period * SECOND)
        self._make = OutgoingMessages(transport)
        self._due = 0  # [ns] due time of the next decision
        self._goal: ActionGoal | None = None
        self._goal_time = 0  # [ns] when it arrived
        self._previous_explanation: Explanation | None = None
        self._resting: int | None = None  # [ns] since when the robot has had no goal; None while it has one
        self._status = Status()
        self._listeners: list[Callable[[LiveStep], None]] = []
        self._clock = self._connect()
        self._watchdog = Watchdog(config.stale, self._halt)

    def listen(self, listener: Callable[[LiveStep], None]) -> None:
        """Call `listener(step)` after every control period."""
        self._listeners.append(listener)

    def run(self) -> None:
        """Drive until an exception, such as KeyboardInterrupt; then stop the robot."""
        try:
            with self._watchdog:
                while True:
                    self._ros.handle(self._remaining_s())
                    self._act()
                    self._watchdog.feed()
        finally:
            self._shut_down()

    def _remaining_s(self) -> float:
        """Return the longest real time to wait for a message [s]."""
        time_ns = self._clock.now()
        if time_ns is None or isinstance(self._clock, TopicClock):
            return self._config.stale / 4
        return min(max(self._due - time_ns, 0), self._period) / SECOND

    def _act(self) -> None:
        """Ask the driver for a step if one is due, or if the clock stands still, so that the driver notices."""
        time_ns = self._clock.now()
        if time_ns is None:
            return
        waits = self._due - self._period <= time_ns < self._due  # else a step is due, or time has jumped
        if waits and self._clock.seconds_still < self._config.stale / 4:
            return
        if not waits:
            delay_ns = time_ns - self._due
            self._due = (self._due if 0 <= delay_ns < self._period else time_ns) + self._period
        self._publish(self._driver.tick(time_ns))

    def _publish(self, step: LiveStep) -> None:
        """Send the command and its explanation, and report to the action's client."""
        # Without a goal, repeat zero velocity for a moment, then leave the topic to others.
        if step.state in (LiveState.DRIVING, LiveState.STOPPED):
            self._resting = None
        elif self._resting is None:
            self._resting = step.stamp
        rested = 0 if self._resting is None else step.stamp - self._resting
        if step.state is not LiveState.IDLE and rested < _AT_REST * SECOND:
            self._send(step.command, step.stamp)
        self._explain(step)
        self._report(step)
        for listener in self._listeners:
            listener(step)
        self._status.count(step)
        if self._status.due:
            self._diagnostics(self._status.message(step, self._driver.soft_stops, self._make))

    def _halt(self) -> None:
        """Stop the robot while the node is blocked, for example by a planner that does not return."""
        if self._resting is None:
            self._send(STILL, self._clock.now() or 0)

    def _send(self, command: Twist, stamp: int) -> None:
        kind, base = self._topics.command_type, self._driver.frames.base
        self._command(self._make.command(kind, stamp, base, command))

    def _explain(self, step: LiveStep) -> None:
        """Publish subgoal, markers and reason of a decision, or why there is none. Cheap without subscribers."""
        # Without a decision, only the reason is published.
        if step.observation is None or step.guidance is None:
            self._previous_explanation = None
            if step.reason and self._reason.watched:
                self._reason(self._make.text(f"{step.state}: {step.reason}"))
            return
        # Publish the subgoal always, the others only for subscribers.
        base, make = self._driver.frames.base, self._make
        self._subgoal(make.point(step.stamp, base, step.guidance.subgoal))
        if not (self._markers.watched or self._reason.watched):
            self._previous_explanation = None
            return
        explanation = step.explanation
        if self._markers.watched:
            explained_markers = markers(step.observation, step.guidance, explanation)
            self._markers(make.markers(step.stamp, base, explained_markers))
        if explanation is not None and self._reason.watched:
            self._reason(make.text(step.reason or reason(explanation, self._previous_explanation)))
        self._previous_explanation = explanation

    def _report(self, step: LiveStep) -> None:
        """Send feedback and result to the client of the action."""
        if self._goal is None:
            return
        if step.state is LiveState.ARRIVED:
            self._goal.succeed()
            self._goal = None
        elif step.observation is not None:
            observation = step.observation
            pose = self._make.pose(step.stamp, self._driver.frames.odom, observation.odometry)
            self._goal.feedback(pose, math.hypot(*observation.target), step.stamp - self._goal_time)

    def _take_goal(self, pose: Any, goal: ActionGoal | None = None) -> None:
        """Drive to a PoseStamped instead of the previous goal."""
        time_ns, point = self._clock.now() or 0, pose.pose.position
        try:
            self._driver.set_goal((point.x, point.y), pose.header.frame_id, time_ns)
        except InputError as error:
            print(error, file=sys.stderr)
            if goal is not None:
                goal.abort(str(error))
            return
        if self._goal is not None:
            self._goal.cancel("another goal replaces it")
        self._goal, self._goal_time = goal, time_ns

    def _cancel(self, goal: ActionGoal | None = None) -> None:
        """Cancel a goal; None: the current one, if any. A goal that is no longer the current one is ignored."""
        if goal is not None and goal is not self._goal:
            return
        if self._goal is not None:
            self._goal.cancel("cancelled")
        self._goal = None
        self._driver.cancel()

    def _shut_down(self) -> None:
        step = self._driver.stop("the node shuts down")
        for _ in range(_SHUTDOWN_STOPS):
            self._send(step.command, step.stamp)
            time.sleep(0.02)
        if self._goal is not None:
            self._goal.abort("the node shuts down")
            self._ros.handle(0.1)  # time for ROS to send the result

    def _connect(self) -> SystemClock | TopicClock:
        """Subscribe and advertise; return the node's clock."""
        ros, topics, driver = self._ros, self._topics, self._driver
        # Advertise what the node publishes.
        self._command = ros.publisher(topics.command, topics.command_kind)
        self._subgoal = ros.publisher(topics.subgoal, "geometry_msgs/PointStamped")
        self._markers = ros.publisher(topics.markers, "visualization_msgs/MarkerArray")
        self._reason = ros.publisher(topics.reason, "std_msgs/String")
        self._diagnostics = ros.publisher(topics.diagnostics, "diagnostic_msgs/DiagnosticArray")
        # Subscribe to the clock and to the sensors; each message gets the time of its arrival.
        clock = self._connect_clock()

        def stamped(handler: Any) -> Any:
            return lambda message: handler(message, clock.now() or 0)

        ros.subscribe(topics.scan, topics.scan_kind, stamped(driver.take_scan), Delivery.NEWEST)
        if topics.pose != TF:
            ros.subscribe(topics.pose, topics.pose_kind, stamped(driver.take_odometry), Delivery.NEWEST)
        if topics.imu is not None:
            ros.subscribe(topics.imu, IMU_KIND, stamped(driver.take_imu), Delivery.NEWEST)
        if topics.pose == TF or ros.has(TF_MESSAGE):
            fixed = partial(driver.take_transforms, static=True)
            ros.subscribe(topics.tf, TF_MESSAGE, stamped(driver.take_transforms), Delivery.ALL)
            ros.subscribe(topics.tf_static, TF_MESSAGE, stamped(fixed), Delivery.LATCHED)
        # Goals: a topic, or the action if its package is installed.
        ros.subscribe(topics.goal_in(ros.version), "geometry_msgs/PoseStamped", self._take_goal, Delivery.ALL)
        ros.subscribe(topics.cancel, "std_msgs/Empty", lambda _: self._cancel(), Delivery.ALL)
        action = topics.action_in(ros.version)
        self.serves_action = ros.serve(action, lambda goal: self._take_goal(goal.pose, goal), self._cancel)
        return clock

    def _connect_clock(self) -> SystemClock | TopicClock:
        use_sim_time = self._config.use_sim_time
        if not (self._ros.sim_time if use_sim_time is None else use_sim_time):
            return SystemClock()
        clock = TopicClock()
        self._ros.subscribe(self._topics.clock, "rosgraph_msgs/Clock", clock.take, Delivery.NEWEST)
        return clock


class SystemClock:
    """The system clock: time since 1970, as in the stamps of robots' drivers."""

    seconds_still = 0.0

    def now(self) -> int | None:
        """Return the time [ns]."""
        return time.time_ns()


class TopicClock:
    """The latest time on /clock."""

    def __init__(self) -> None:
        self._now: int | None = None
        self._moved = time.monotonic()

    def take(self, message: Any) -> None:
        """Process a rosgraph_msgs/Clock."""
        time_ns = nanoseconds(message.clock)
        if time_ns != self._now:
            self._now, self._moved = time_ns, time.monotonic()

    def now(self) -> int | None:
        """Return the time [ns]; None before the first message."""
        return self._now

    @property
    def seconds_still(self) -> float:
        """Return the real time since the clock last advanced [s]."""
        return time.monotonic() - self._moved


class Watchdog:
    """Context manager that calls `halt`, from its own thread, if `feed` was not called for `patience` [s]."""

    def __init__(self, patience: float, halt: Callable[[], None]) -> None:
        self._patience, self._halt = patience, halt
        self._fed = threading.Event()
        self._ended = False
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._ended = True
        self._fed.set()
        self._thread.join()

    def feed(self) -> None:
        """Report that the loop is running."""
        self._fed.set()

    def _watch(self) -> None:
        while not self._ended:
            if not self._fed.wait(self._patience):
                self._halt()
            self._fed.clear()


class Status:
    """Statistics of the steps since the last message on /diagnostics."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._decisions: list[float] = []
        self._tracking: list[float] = []
        self._people = 0

    def count(self, step: LiveStep) -> None:
        """Add a step."""
        if step.guidance is not None:
            self._decisions.append(step.decision_us)
        if step.people is not None:
            self._tracking.append(step.people_us)
            self._people = len(step.people.names)

    @property
    def due(self) -> bool:
        """Return whether the next message is due."""
        return time.monotonic() - self._began >= _DIAGNOSTICS_PERIOD

    def message(self, step: LiveStep, soft_stops: int, make: OutgoingMessages) -> Any:
        """Return a diagnostic_msgs/DiagnosticArray for the time since the last one. soft_stops: total so far."""
        seconds = time.monotonic() - self._began
        decision_times = self._decisions
        values = {
            "state": step.state,
            "decisions per second": round(len(decision_times) / seconds, 1),
            "median decision [ms]": round(sorted(decision_times)[len(decision_times) // 2] / 1000.0, 2)
            if decision_times
            else "-",
            "longest decision [ms]": round(max(decision_times) / 1000.0, 2) if decision_times else "-",
            "soft stops": soft_stops,
        }
        if self._tracking:
            middle = sorted(self._tracking)[len(self._tracking) // 2]
            values |= {"people": self._people, "median tracking [ms]": round(middle / 1000.0, 2)}
        level = WARN if step.state is LiveState.STOPPED else OK
        text = f"{step.state}: {step.reason}" if step.reason else str(step.state)
        self._began, self._decisions, self._tracking = time.monotonic(), [], []
        return make.diagnostics(step.stamp, _DIAGNOSTICS, level, text, values)
