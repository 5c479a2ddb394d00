"""A node of ROS 2 (rclpy)."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

from lme.errors import InputError
from lme.live.messages import SECOND
from runners.ros.transport import HANDLING, ActionGoal, Delivery, Publisher, Take, TopicPublisher

INSTALL = (
    "pip install ros-rclpy ros-rmw-fastrtps-cpp ros-geometry-msgs ros-sensor-msgs ros-nav-msgs ros-std-msgs "
    "ros-visualization-msgs ros-diagnostic-msgs ros-rosgraph-msgs, or source the setup.bash of a ROS 2 workspace "
    "whose Python is 3.11 or later"
)
_DEPTH = 100  # queue size


def check_installed() -> None:
    """Raise InputError unless ROS 2 can be imported."""
    if find_spec("rclpy") is None:
        raise InputError(f"ROS 2 is not installed: {INSTALL}")


class Ros2:
    """A node. arguments: ROS's own, such as `--ros-args -r scan:=front/scan`.

    Raises InputError if ROS 2 is not installed.
    """

    version = 2

    def __init__(self, name: str, arguments: Sequence[str] = ()) -> None:
        check_installed()
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        rclpy.init(args=[name, *arguments], signal_handler_options=SignalHandlerOptions.NO)
        self._rclpy = rclpy
        self._node = rclpy.create_node(name)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._handled = 0
        # Calls that the action server defers until its own part is done.
        self._later: list[Callable[[], None]] = []
        self.sim_time = bool(self._node.get_parameter("use_sim_time").value)

    def has(self, kind: str) -> bool:
        """Return whether the package of a message type is installed."""
        return find_spec(kind.partition("/")[0]) is not None

    def type(self, kind: str) -> Any:
        """Return the class of a message. Raises InputError if its package is not installed."""
        package, _, name = kind.partition("/")
        try:
            return getattr(importlib.import_module(f"{package}.msg"), name)
        except ImportError as error:
            raise InputError(
                f"{kind} needs the package {package}: pip install ros-{package.replace('_', '-')} if there is such a "
                "package, or source the setup.bash of a ROS 2 workspace"
            ) from error

    def stamp(self, time: int) -> Any:
        """Return a message's time from nanoseconds."""
        sec, nanosec = divmod(time, SECOND)
        return self.type("builtin_interfaces/Time")(sec=sec, nanosec=nanosec)

    def subscribe(self, topic: str, kind: str, take: Take, delivery: Delivery) -> None:
        """Call `take` with the messages. The newest are requested by best effort, which matches every publisher."""
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        def counted(message: Any) -> None:
            self._handled += 1
            take(message)

        profile = QoSProfile(depth=_DEPTH)
        if delivery is Delivery.NEWEST:
            profile = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        elif delivery is Delivery.LATCHED:
            profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
        self._node.create_subscription(self.type(kind), topic, counted, profile)

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Publisher:
        """Return a publisher. latched: later subscribers receive the last message."""
        from rclpy.qos import DurabilityPolicy, QoSProfile

        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        profile = QoSProfile(depth=1, durability=durability)
        ros_publisher = self._node.create_publisher(self.type(kind), topic, profile)
        return TopicPublisher(ros_publisher.publish, ros_publisher.get_subscription_count)

    def serve(
        self, action: str, accept: Callable[[ActionGoal], None], cancel: Callable[[ActionGoal | None], None]
    ) -> bool:
        """Serve the action nav2_msgs/NavigateToPose; return False if its package is not installed."""
        if not self.has("nav2_msgs/x"):
            return False
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionServer, CancelResponse

        # Accepting and cancelling are left to `handle`, when the server's own part is done.
        goals: dict[bytes, _Ros2ActionGoal] = {}

        def begin(handle: Any) -> None:
            goals[bytes(handle.goal_id.uuid)] = goal = _Ros2ActionGoal(handle, NavigateToPose)
            self._later.append(partial(accept, goal))

        def stop(handle: Any) -> Any:
            goal = goals.get(bytes(handle.goal_id.uuid))
            if goal is None:
                return CancelResponse.REJECT
            self._later.append(partial(cancel, goal))
            return CancelResponse.ACCEPT

        def end(handle: Any) -> Any:
            return goals.pop(bytes(handle.goal_id.uuid)).end()

        self._server = ActionServer(
            self._node,
            NavigateToPose,
            action,
            end,
            handle_accepted_callback=begin,
            cancel_callback=stop,
        )
        return True

    def client(self, action: str) -> Publisher:
        """Return a publisher that sends PoseStamped as goals of the action nav2_msgs/NavigateToPose.

        Raises InputError if its package is not installed.
        """
        if not self.has("nav2_msgs/x"):
            raise InputError(
                "live.goal=action needs the package nav2_msgs: source the setup.bash of a ROS 2 workspace"
            )
        return _Ros2ActionClient(self._node, action)

    def handle(self, timeout: float) -> None:
        """Wait at most `timeout` [s] for messages, then deliver all that arrived, for at most `HANDLING`."""
        handled_before = self._handled
        # Wait once, then deliver without waiting as long as messages come.
        self._executor.spin_once(timeout_sec=max(timeout, 0.0))
        deadline = time.monotonic() + HANDLING
        while self._handled != handled_before and time.monotonic() < deadline:
            handled_before = self._handled
            self._executor.spin_once(timeout_sec=0.0)
        # Do what the action server has requested.
        pending, self._later = self._later, []
        for call in pending:
            call()

    def close(self) -> None:
        """Shut the node down."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._rclpy.try_shutdown()


class _Ros2ActionClient:
    def __init__(self, node: Any, action: str) -> None:
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionClient

        self._action = NavigateToPose
        self._client = ActionClient(node, NavigateToPose, action)

    @property
    def watched(self) -> bool:
        return bool(self._client.server_is_ready())

    def __call__(self, message: Any) -> None:
        self._client.send_goal_async(self._action.Goal(pose=message))


class _Ros2ActionGoal:
    """A goal of nav2_msgs/NavigateToPose.

    rclpy is asked to execute it only when it ends. A coroutine that waits for the end would be resumed at every turn
    of the executor, before any message, and the node would no longer receive its sensors' data. Clients therefore see
    the state ACCEPTED, not EXECUTING, while the robot drives.
    """

    def __init__(self, handle: Any, action: Any) -> None:
        self._handle, self._action = handle, action
        self.pose = handle.request.pose

    def feedback(self, pose: Any, distance: float, time: int) -> None:
        feedback = self._action.Feedback(current_pose=pose, distance_remaining=distance)
        feedback.navigation_time.sec, feedback.navigation_time.nanosec = divmod(time, SECOND)
        self._handle.publish_feedback(feedback)

    def succeed(self) -> None:
        self._finish(self._handle.succeed)

    def cancel(self, reason: str) -> None:
        """Cancel the goal if the client asked for it; abort a goal that another one replaces, as Nav2 does."""
        self._finish(self._handle.canceled if self._handle.is_cancel_requested else self._handle.abort)

    def abort(self, reason: str) -> None:
        self._finish(self._handle.abort)

    def end(self) -> Any:
        """Set the final state and return the result, within the execution that `_finish` asked for."""
        self._set_state()
        return self._action.Result()

    def _finish(self, set_state: Callable[[], None]) -> None:
        self._set_state = set_state
        self._handle.execute()
