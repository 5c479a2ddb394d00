"""Driver of a robot: it takes the sensors' messages as they arrive, and gives a safe command every control period."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from threading import Lock
from time import monotonic_ns
from typing import Any, NamedTuple

import numpy as np

from lme.errors import InputError
from lme.inputs.user_code import show_traceback, user_error
from lme.live.config import LiveConfig, ScanConfig
from lme.live.frames import Carrier, Frames, FramesConfig
from lme.live.goal import Goal
from lme.live.messages import SECOND, frame
from lme.live.pilot import Pilot
from lme.live.poses import Posture, StampedMotion
from lme.live.scan_source import ScanSource
from lme.live.sensors import LiveSensors, LiveSight
from lme.live.step import STILL, LiveState, LiveStep, NotReadyError
from lme.navigation.navigator import Navigator
from lme.robots import Robot
from lme.types import Floats

_ANY_TIME = 1 << 62  # [ns]
_JITTER = SECOND // 10  # [ns] threads may read the clock in one order and report it in another


class _FirstScan(NamedTuple):
    """A scan for whose lidar guide and planner are built.

    mount: (4, 4) from its frame to the base frame, by tf; None if tf has none. carrier: what its frame moves with.
    """

    scan: Any
    mount: Floats | None
    carrier: Carrier
    posture: Posture | None


class LiveDriver:
    """One robot with one guide and one planner.

    make_navigator builds them for the robot with the lidar in use, which the first scan shows (`ScanConfig.lidar`).
    Messages are duck-typed. `now_ns` is the time on the node's clock [ns], the one that stamps messages; `wall` a
    monotonic time [ns]. Methods may be called from several threads, `tick` from one. measured_twists: velocities are
    the twists of the odometry, until these contradict the poses; otherwise they are the slope of the poses.

    The robot stands in these cases, checked in this order: after shutdown; after a jump of the clock, which also
    discards the sensor data, and while the clock stands still; without a goal; without a fresh scan that measures
    something; without a fresh pose; on a scan that is not plausible (`ScanSource.blinding_fault`); while the frame of
    the goal is unknown or stale; at the goal; after an exception in guide or planner, a command that is not finite, or
    a decision that took longer than `stale`; before contact.
    """

    def __init__(
        self,
        make_navigator: Callable[[Robot], Navigator],
        robot: Robot,
        config: LiveConfig | None = None,
        scan_config: ScanConfig | None = None,
        frames: FramesConfig | None = None,
        wall: Callable[[], int] = monotonic_ns,
        measured_twists: bool = True,
    ) -> None:
        self.config = config or LiveConfig()
        self._make_navigator, self._configured = make_navigator, robot
        self._scan_config = scan_config or ScanConfig()
        self._stale = round(self.config.stale * SECOND)
        self._sensors = LiveSensors(self.config, frames or FramesConfig(), measured_twists)
        self._wall = wall
        self._clock = Clock(round(self.config.time_jump * SECOND), wall)
        self._lock = Lock()
        self._pilot: Pilot | None = None
        self._goal: Goal | None = None
        self._number = 0  # of the newest goal
        self._idle_reason = ("no goal", LiveState.IDLE)
        self._shutdown_reason = self._jump = ""
        self._last_step = LiveStep(0, LiveState.IDLE, "no goal")
        self.soft_stops = 0

    @property
    def robot(self) -> Robot:
        """The robot, with the lidar in use once a scan has arrived."""
        return self._configured if self._pilot is None else self._pilot.robot

    @property
    def mounted_by(self) -> str:
        """Source of the lidar's mount: scan.mount, tf or the robot; "" before the first scan."""
        return "" if self._pilot is None else self._pilot.source.mounted_by

    @property
    def frames(self) -> Frames:
        """Names of the odometry frame and the base frame, as far as messages have named them."""
        with self._lock:
            return self._sensors.frames

    @property
    def motion(self) -> StampedMotion | None:
        """The latest pose and twist; None before the first, and after a jump of the clock."""
        with self._lock:
            return self._sensors.track.latest

    def take_scan(self, message: Any, now_ns: int) -> None:
        """Take a LaserScan or PointCloud2."""
        self._take("scan", now_ns, lambda: self._sensors.take_scan(message, now_ns))

    def take_odometry(self, message: Any, now_ns: int) -> None:
        """Take an Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped of the robot's pose."""
        self._take("pose", now_ns, lambda: self._sensors.take_pose(message, now_ns))

    def take_imu(self, message: Any, now_ns: int) -> None:
        """Take an Imu, whose orientation levels clouds while the poses hold no roll and pitch."""
        self._take("imu", now_ns, lambda: self._sensors.take_imu(message, now_ns))

    def take_transforms(self, message: Any, now_ns: int, static: bool = False) -> None:
        """Take a TFMessage. static: it came on tf_static, so it holds forever; others go stale."""
        self._take("tf", now_ns, lambda: self._sensors.take_transforms(message, now_ns, static))

    def set_goal(self, position: Sequence[float], frame_id: str, now_ns: int) -> None:
        """Drive to a position (x, y) [m]; an older goal is dropped.

        frame_id: any frame that tf connects; "" for the odometry frame. Raises InputError unless the position is
        finite.
        """
        point = np.array(position, dtype=np.float64)[:2]
        if point.shape != (2,) or not np.isfinite(point).all():
            raise InputError(f"goal is {list(position)}: must be two finite numbers [m]")
        with self._lock:
            self._goal = Goal(point, frame(frame_id), now_ns)
            self._number += 1

    def cancel(self) -> None:
        """Drop the goal; the robot stands."""
        with self._lock:
            if self._goal is not None:
                self._end_goal(LiveState.CANCELLED, "cancelled")

    def tick(self, now_ns: int) -> LiveStep:
        """Return the step of one control period. Never raises.

        Call it once a control period on the node's clock. While that clock stands still, keep calling it by wall
        time: it returns the last step again, and after `stale` the robot stands.
        """
        try:
            self._last_step = self._step(now_ns)
        except NotReadyError as error:
            self._last_step = self._standing_step(now_ns, str(error), error.state)
        except Exception as error:
            show_traceback(error)
            reason = user_error(error) or f"{type(error).__name__}: {error}"
            self._last_step = self._standing_step(now_ns, reason)
        return self._last_step

    def stop(self, reason: str) -> LiveStep:
        """Shut down: the robot stands from now on."""
        with self._lock:
            self._shutdown_reason = reason
        self._last_step = self._standing_step(self._last_step.stamp, reason)
        return self._last_step

    def _take(self, kind: str, now_ns: int, take: Callable[[], None]) -> None:
        """Take a message. One that cannot be read is ignored."""
        with self._lock:
            self._read_clock(now_ns)
            try:
                take()
            except Exception as error:
                self._sensors.note_problem(kind, f"{type(error).__name__}: {error}")

    def _read_clock(self, now_ns: int) -> None:
        jump = self._clock.read(now_ns)
        if jump:
            self._jump = jump
            self._sensors.forget()

    def _step(self, now_ns: int) -> LiveStep:
        with self._lock:
            self._check_clock(now_ns)
            if self._already_decided(now_ns):
                return self._last_step
            first = self._scan_to_prepare_for()
        if first is not None:
            if self._last_step.command != STILL:  # stop first, since preparing takes seconds
                raise NotReadyError("guide and planner must be prepared for another lidar")
            self._prepare(first)
            raise NotReadyError("guide and planner were being prepared")
        with self._lock:
            sight, target, number = self._decision_inputs(now_ns)
        return self._decide(sight, target, number, now_ns)

    def _check_clock(self, now_ns: int) -> None:
        """Raise NotReadyError after shutdown, after a jump of the clock, or if it stands still."""
        if self._shutdown_reason:
            raise NotReadyError(self._shutdown_reason)
        self._read_clock(now_ns)
        jump, self._jump = self._jump, ""
        if jump:
            raise NotReadyError(jump)
        if self._clock.stalled_for > self._stale:
            raise NotReadyError("the clock stands still")

    def _already_decided(self, now_ns: int) -> bool:
        """Return whether the last step is already the decision for this time and goal."""
        decided = self._last_step.observation is not None and now_ns <= self._last_step.stamp
        return decided and self._goal is not None and self._number == self._last_step.goal

    def _scan_to_prepare_for(self) -> _FirstScan | None:
        """The latest scan if guide and planner must still be built for its lidar, else None."""
        sensors, scan, mount = self._sensors, self._sensors.scan, self._sensors.mount
        if scan is None:
            return None
        if self._pilot is not None:
            source = self._pilot.source
            is_known_lidar = not source.exceeded_by(scan) and source.carrier is sensors.carrier
            if is_known_lidar and (mount is None or not source.mounted_by.startswith("robot=")):
                return None
        return _FirstScan(scan, mount, sensors.carrier, sensors.posture)

    def _prepare(self, first: _FirstScan) -> None:
        """Build guide and planner for the lidar of a scan, and warm them up. Raises NotReadyError if it is faulty."""
        source = ScanSource(self._scan_config, first.scan, first.mount, self._configured, first.carrier)
        fault = source.blinding_fault(first.scan, first.posture)
        if fault is not None:  # such a scan shows its lidar wrongly, so build nothing for it
            raise NotReadyError(fault)
        pilot = Pilot(source, self._make_navigator(source.robot), self.config.seed, self._wall)
        pilot.warm_up(first.scan, first.posture)
        self._pilot = pilot

    def _decision_inputs(self, now_ns: int) -> tuple[LiveSight, Floats, int]:
        """Collect what a decision needs: sensor data, target (2,) [m] at the stamp of the scan, number of the goal.

        Raises NotReadyError if the robot must stand.
        """
        if self._goal is None:
            raise NotReadyError(*self._idle_reason)
        # The sensor data must be fresh, and the scan plausible.
        sensors, goal = self._sensors, self._goal
        sight, frames, tree = sensors.look(now_ns), sensors.frames, sensors.tree
        fault = None if self._pilot is None else self._pilot.source.blinding_fault(sight.scan, sight.posture)
        if fault is not None:
            raise NotReadyError(fault)
        # The goal is a target at the stamp of the scan; at the latest pose, it tells whether the robot has arrived.
        sensors.check_transforms(tree.chain(goal.frame, frames.odom), now_ns)
        goal.place(frames, tree, sensors.track, _ANY_TIME)
        target, remaining = (goal.target(motion, frames, tree) for motion in (sight.motion, sight.newest))
        if target is None or remaining is None:
            raise NotReadyError(f"tf does not connect the frame of the goal, {goal.frame}, to {frames.odom}")
        if math.hypot(*remaining) <= self.config.goal_tolerance:
            self._end_goal(LiveState.ARRIVED, "arrived")
            raise NotReadyError(*self._idle_reason)
        return sight, target, self._number

    def _end_goal(self, state: LiveState, reason: str) -> None:
        self._goal, self._idle_reason = None, (reason, state)

    def _decide(self, sight: LiveSight, target: Floats, number: int, now_ns: int) -> LiveStep:
        """Ask guide and planner. Raises NotReadyError if the goal changes meanwhile, and whatever these raise."""
        pilot, last_command = self._pilot, self._last_step.command
        assert pilot is not None
        step = pilot.decide(sight, target, number, last_command, now_ns)
        with self._lock:  # the goal may have changed meanwhile
            if self._shutdown_reason:
                raise NotReadyError(self._shutdown_reason)
            if self._goal is None:
                raise NotReadyError(*self._idle_reason)
            if number != self._number:
                raise NotReadyError("a new goal was set during the decision")
        if step.decision_us > self.config.stale * 1e6:
            return _halt(step, f"the decision took {step.decision_us / 1e6:.2f} s")
        if self.config.soft_stop and pilot.leads_into_contact(step, last_command):
            self.soft_stops += 1
            return _halt(step, "soft stop: the command leads into contact")._replace(soft_stopped=True)
        return step

    def _standing_step(self, now_ns: int, reason: str, state: LiveState = LiveState.STOPPED) -> LiveStep:
        return LiveStep(now_ns, state, reason, STILL, self._number, motion=self.motion)


def _halt(step: LiveStep, reason: str) -> LiveStep:
    return step._replace(state=LiveState.STOPPED, reason=reason, command=STILL)


class Clock:
    """The latest time on the node's clock. Simulated time may jump or stand still.

    time_jump [ns]: a clock that advances by more than this between two readings has jumped. wall: monotonic time [ns].
    """

    def __init__(self, time_jump: int, wall: Callable[[], int]) -> None:
        self._time_jump, self._wall = time_jump, wall
        self._latest: int | None = None
        self._advanced_at = wall()

    def read(self, now_ns: int) -> str:
        """Note the time `now_ns`, and describe how the clock has jumped; "" if it has not."""
        latest, self._latest = self._latest, now_ns
        if latest is None or now_ns > latest:
            self._advanced_at = self._wall()
        if latest is None or -_JITTER <= now_ns - latest <= self._time_jump:
            self._latest = now_ns if latest is None else max(now_ns, latest)
            return ""
        direction = "forwards" if now_ns > latest else "backwards"
        return f"the clock jumped {direction} by {abs(now_ns - latest) / SECOND:.3g} s"

    @property
    def stalled_for(self) -> int:
        """Wall time since the clock last advanced [ns]."""
        return self._wall() - self._advanced_at
