"""Drives a robot: takes the messages of its sensors as they come, and gives a safe command once a control period."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from threading import Lock
from time import monotonic_ns
from typing import Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.geometry.frames import relative
from lme.live.clock import Clock
from lme.live.config import LiveConfig
from lme.live.frames import Frames, FramesConfig
from lme.live.goal import Goal
from lme.live.messages import SECOND, frame
from lme.live.safety import limited, touches
from lme.live.scan_source import ScanConfig, ScanSource
from lme.live.sensors import Sensors, Sight
from lme.live.step import STILL, LiveState, LiveStep, NotReadyError
from lme.live.track import StampedMotion
from lme.navigator import Navigator
from lme.policy.explanation import Decision, Explanation
from lme.robots import Robot
from lme.sensing.scan_points import obstacle_points
from lme.types import Floats, Observation, Pose, Twist

_ANY_TIME = 1 << 62  # [ns]
_WARM_UPS = 3  # decisions; the first ones load compiled code, which takes seconds
_AHEAD = np.array([1.0, 0.0])  # [m] the target of these decisions


class _Ready(NamedTuple):
    """All that a decision needs. target: (2,) [m] at the stamp of the scan."""

    sight: Sight
    target: Floats
    number: int


class LiveDriver:
    """One robot with one guide and one planner.

    make_navigator builds them for the robot with the lidar in use, which the first scan shows (`ScanConfig.lidar`).
    Messages are duck-typed. `now` is the time on the node's clock [ns], the one that stamps messages; `wall` a
    monotonic time [ns]. Methods may be called from several threads, `tick` from one.

    The robot stands, in this order, after shutdown; after a jump of the clock, which also makes it forget its
    sensors, and while the clock stands still; without a goal; without a fresh scan that measures something; without
    a fresh pose; while the frame of the goal is not known or stale; at the goal; after an exception in guide or
    planner, a command that is not finite, or a decision that took longer than `stale`; before contact.
    """

    def __init__(
        self,
        make_navigator: Callable[[Robot], Navigator],
        robot: Robot,
        config: LiveConfig | None = None,
        scan_config: ScanConfig | None = None,
        frames: FramesConfig | None = None,
        wall: Callable[[], int] = monotonic_ns,
    ) -> None:
        self.config = config or LiveConfig()
        self._make_navigator, self._configured = make_navigator, robot
        self._scan_config = scan_config or ScanConfig()
        self._stale = round(self.config.stale * SECOND)
        self._sensors = Sensors(self.config, frames or FramesConfig())
        self._wall = wall
        self._clock = Clock(round(self.config.time_jump * SECOND), wall)
        self._lock = Lock()
        self._source: ScanSource | None = None
        self._navigator: Navigator | None = None
        self._goal: Goal | None = None
        self._number = self._driven = 0  # of the newest goal, and of the one that the navigator was reset for
        self._ended = ("no goal", LiveState.IDLE)
        self._shut = self._jump = ""
        self._explained: Decision | None = None
        self._last = LiveStep(0, LiveState.IDLE, "no goal")
        self.soft_stops = 0

    @property
    def robot(self) -> Robot:
        """The robot, with the lidar in use once a scan has come."""
        return self._configured if self._source is None else self._source.robot

    @property
    def mounted_by(self) -> str:
        """What says where the lidar is: scan.mount, tf or the robot; "" before the first scan."""
        return "" if self._source is None else self._source.mounted_by

    @property
    def frames(self) -> Frames:
        """Names of the odometry frame and the base frame, as far as messages have shown them."""
        with self._lock:
            return self._sensors.frames

    @property
    def motion(self) -> StampedMotion | None:
        """The latest pose and twist; None if none has come, or since the last jump of the clock."""
        with self._lock:
            newest = self._sensors.track.newest
            return None if newest is None else self._sensors.track.at(newest, 0)

    def take_scan(self, message: Any, now: int) -> None:
        """Take a LaserScan or PointCloud2."""
        self._take("scan", now, lambda: self._sensors.take_scan(message, now))

    def take_odometry(self, message: Any, now: int) -> None:
        """Take an Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped of the robot's pose."""
        self._take("pose", now, lambda: self._sensors.take_pose(message, now))

    def take_transforms(self, message: Any, now: int, static: bool = False) -> None:
        """Take a TFMessage. static: it came on tf_static, so it holds for ever; others go stale."""
        self._take("tf", now, lambda: self._sensors.take_transforms(message, now, static))

    def set_goal(self, position: Sequence[float], frame_id: str, now: int) -> None:
        """Drive to a position (x, y) [m]; an older goal is dropped. frame_id: any that tf connects; "": odometry.

        Raises InputError unless the position is finite.
        """
        point = np.array(position, dtype=np.float64)[:2]
        if point.shape != (2,) or not np.isfinite(point).all():
            raise InputError(f"goal is {list(position)}: must be two finite numbers [m]")
        with self._lock:
            self._goal = Goal(point, frame(frame_id), now)
            self._number += 1

    def cancel(self) -> None:
        """Drop the goal; the robot stands."""
        with self._lock:
            if self._goal is not None:
                self._end(LiveState.CANCELLED, "cancelled")

    def tick(self, now: int) -> LiveStep:
        """The step of one control period. Never raises.

        Call it once a control period on the node's clock. While that clock stands still, call it all the same, by
        wall time: the last step is given again, and after `stale` the robot stands.
        """
        try:
            self._last = self._step(now)
        except NotReadyError as why:
            self._last = self._stand(now, str(why), why.state)
        except Exception as error:
            self._last = self._stand(now, f"{type(error).__name__}: {error}")
        return self._last

    def stop(self, reason: str) -> LiveStep:
        """Shut down: the robot stands from now on."""
        with self._lock:
            self._shut = reason
        self._last = self._stand(self._last.stamp, reason)
        return self._last

    def _take(self, what: str, now: int, take: Callable[[], None]) -> None:
        """Take a message. One that cannot be read is as if it had not come."""
        with self._lock:
            self._read_clock(now)
            try:
                take()
            except Exception as error:
                self._sensors.complain(what, f"{type(error).__name__}: {error}")

    def _read_clock(self, now: int) -> None:
        jump = self._clock.read(now)
        if jump:
            self._jump = jump
            self._sensors.forget()

    def _step(self, now: int) -> LiveStep:
        with self._lock:
            self._check_clock(now)
            if self._last.state is LiveState.DRIVING and now <= self._last.stamp and self._same_goal():
                return self._last
            first = self._unprepared()
        if first is not None:
            self._prepare(*first)
            raise NotReadyError("guide and planner were being prepared")
        with self._lock:
            ready = self._ready(now)
        return self._decide(ready, now)

    def _check_clock(self, now: int) -> None:
        """Raise NotReadyError after shutdown, after a jump of the clock, or if it stands still."""
        if self._shut:
            raise NotReadyError(self._shut)
        self._read_clock(now)
        jump, self._jump = self._jump, ""
        if jump:
            raise NotReadyError(jump)
        if self._clock.stood > self._stale:
            raise NotReadyError("the clock stands still")

    def _same_goal(self) -> bool:
        return self._goal is not None and self._number == self._last.goal

    def _unprepared(self) -> tuple[Any, Floats | None] | None:
        """A scan, and its mount by tf, if guide and planner are still to be built for its lidar."""
        scan, mount = self._sensors.scan, self._sensors.mount
        guessed = self.mounted_by not in ("scan.mount", "tf")
        if scan is None or (self._source is not None and not (guessed and mount is not None)):
            return None
        return scan, mount

    def _prepare(self, scan: Any, mount: Floats | None) -> None:
        """Build guide and planner. Their first decisions load compiled code, which takes seconds."""
        source = ScanSource(self._scan_config, scan, mount, self._configured)
        navigator = self._make_navigator(source.robot)
        navigator.reset(np.random.default_rng(self.config.seed))
        standing = StampedMotion(0, Pose(0.0, 0.0, 0.0), STILL)
        for _ in range(_WARM_UPS):
            observation = source.observation(scan, standing, _AHEAD)
            wanted = navigator.act(observation)
            navigator.explanation()
            self._contact(source, observation, standing, wanted)
        self._source, self._navigator, self._driven = source, navigator, 0

    def _ready(self, now: int) -> _Ready:
        """Everything for a decision. Raises NotReadyError if the robot must stand."""
        if self._goal is None:
            raise NotReadyError(*self._ended)
        sensors, goal = self._sensors, self._goal
        sight, frames, tree = sensors.look(now), sensors.frames, sensors.tree
        sensors.check_transforms(tree.chain(goal.frame, frames.odom), now)
        goal.place(frames, tree, sensors.track, _ANY_TIME)
        target, left = (goal.target(at, frames, tree) for at in (sight.motion, sight.newest))
        if target is None or left is None:
            raise NotReadyError(f"tf does not connect the frame of the goal, {goal.frame}, to {frames.odom}")
        if math.hypot(*left) <= self.config.goal_tolerance:
            self._end(LiveState.ARRIVED, "arrived")
            raise NotReadyError(*self._ended)
        return _Ready(sight, target, self._number)

    def _end(self, state: LiveState, reason: str) -> None:
        self._goal, self._ended = None, (reason, state)

    def _decide(self, ready: _Ready, now: int) -> LiveStep:
        """Ask guide and planner. Raises NotReadyError if the decision comes too late, and whatever they raise."""
        source, navigator = self._source, self._navigator
        assert source is not None
        assert navigator is not None
        if self._driven != ready.number:
            navigator.reset(goal_rng(self.config.seed, ready.number))
            self._driven = ready.number
        observation = source.observation(ready.sight.scan, ready.sight.motion, ready.target)
        began = self._wall()
        wanted = navigator.act(observation)
        took = self._wall() - began
        if took > self._stale:
            raise NotReadyError(f"the decision took {took / SECOND:.2f} s")
        with self._lock:
            self._check_goal(ready.number)
        command = limited(wanted, self._last.command, source.robot.limits, source.robot.dt)
        step = LiveStep(
            now,
            LiveState.DRIVING,
            "",
            command,
            ready.number,
            observation,
            navigator.guidance,
            self._new_explanation(navigator),
            wanted,
            decision_us=took / 1000.0,
            motion=ready.sight.newest,
        )
        if self.config.soft_stop and self._contact(source, observation, ready.sight.newest, command):
            self.soft_stops += 1
            reason = "soft stop: the command leads into contact"
            step = step._replace(state=LiveState.STOPPED, reason=reason, command=STILL, soft_stopped=True)
        return step

    def _check_goal(self, number: int) -> None:
        """Raise NotReadyError if the goal has changed during the decision."""
        if self._shut:
            raise NotReadyError(self._shut)
        if self._goal is None:
            raise NotReadyError(*self._ended)
        if number != self._number:
            raise NotReadyError("a new goal came during the decision")

    def _contact(
        self, source: ScanSource, observation: Observation, newest: StampedMotion, command: Twist
    ) -> bool:
        """Whether the command leads the robot, which has moved on since the scan, into contact."""
        points = obstacle_points(observation.scan, source.robot.lidar.mount)
        here = relative(newest.pose, observation.odometry)
        return touches(points, here, newest.twist, command, source.robot)

    def _new_explanation(self, navigator: Navigator) -> Explanation | None:
        """The explanation if the guide made a decision in this period."""
        why = navigator.explanation()
        if why is None or why.decision is self._explained:
            return None
        self._explained = why.decision
        return why

    def _stand(self, now: int, reason: str, state: LiveState = LiveState.STOPPED) -> LiveStep:
        return LiveStep(now, state, reason, STILL, self._number, motion=self.motion)


def goal_rng(seed: int, number: int) -> np.random.Generator:
    """The random generator of the navigator on the way to goal `number`: that of an episode's in this world."""
    return np.random.default_rng(np.random.SeedSequence([seed, number, 0])).spawn(2)[0]
