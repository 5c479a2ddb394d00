"""A node of ROS 1 (rospy)."""

from __future__ import annotations

import contextlib
import importlib
import queue
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from lme.errors import InputError
from lme.live.messages import SECOND
from runners.ros.transport import HANDLING, ActionGoal, Delivery, Publisher, Take, TopicPublisher

DEBIAN = Path("/usr/lib/python3/dist-packages")  # where Debian and Ubuntu install ROS 1
INSTALL = (
    "apt-get install --no-install-recommends ros-core python3-rospy python3-actionlib python3-move-base-msgs "
    "python3-nav-msgs python3-tf2-msgs python3-visualization-msgs python3-diagnostic-msgs (Debian 12, Ubuntu 22.04 "
    "and later), or source the setup.bash of a ROS 1 workspace"
)
_QUEUE = 1  # a robot needs only the newest message
_SHUTDOWN_S = 3.0  # for a node's last commands when ROS ends it


def check_installed() -> None:
    """Raise InputError unless ROS 1 can be imported. Debian's packages are also found from a virtual environment.

    Debian's folder is last in the search path, so the environment's own packages take precedence.
    """
    if find_spec("rospy") is None and (DEBIAN / "rospy").is_dir():
        sys.path.append(str(DEBIAN))
    if find_spec("rospy") is None:
        raise InputError(f"ROS 1 is not installed: {INSTALL}")
    if find_spec("rclpy") is not None:
        raise InputError(
            "this Python finds rospy and rclpy, whose message packages have the same names: "
            "use a virtual environment without ROS 2"
        )


class Ros1:
    """A node. arguments: ROS's own, such as `__name:=drive` and `scan:=front/scan`.

    Raises InputError if ROS 1 is not installed or no master answers.
    """

    version = 1

    def __init__(self, name: str, arguments: Sequence[str] = ()) -> None:
        check_installed()
        import rosgraph
        import rospy

        if not rosgraph.is_master_online():
            raise InputError(f"no ROS master answers at {rosgraph.get_master_uri()}: start roscore")
        rospy.init_node(name, argv=[name, *arguments], disable_signals=True)
        self._rospy = rospy
        self._inbox: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._closed = threading.Event()
        rospy.on_shutdown(self._end)
        self.sim_time = bool(rospy.get_param("/use_sim_time", False))

    def has(self, kind: str) -> bool:
        """Return whether the package of a message type is installed."""
        return find_spec(kind.partition("/")[0]) is not None

    def type(self, kind: str) -> Any:
        """Return the class of a message. Raises InputError if its package is not installed."""
        package, _, name = kind.partition("/")
        try:
            return getattr(importlib.import_module(f"{package}.msg"), name)
        except ImportError as error:
            debian_package = f"python3-{package.replace('_', '-')}"
            raise InputError(
                f"{kind} needs the package {package}: apt-get install {debian_package}"
            ) from error

    def stamp(self, time: int) -> Any:
        """Return a message's time from nanoseconds."""
        return self._rospy.Time(*divmod(time, SECOND))

    def subscribe(self, topic: str, kind: str, take: Take, delivery: Delivery) -> None:
        """Call `take` with the messages. In ROS 1, the publisher decides whether to send an earlier one."""
        size = _QUEUE if delivery is Delivery.NEWEST else None
        self._rospy.Subscriber(
            topic, self.type(kind), self._enqueued(take), queue_size=size, tcp_nodelay=True
        )

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Publisher:
        """Return a publisher. latched: later subscribers receive the last message."""
        ros_publisher = self._rospy.Publisher(
            topic, self.type(kind), queue_size=_QUEUE, latch=latched, tcp_nodelay=True
        )
        return TopicPublisher(ros_publisher.publish, ros_publisher.get_num_connections)

    def serve(
        self, action: str, accept: Callable[[ActionGoal], None], cancel: Callable[[ActionGoal | None], None]
    ) -> bool:
        """Serve the action move_base_msgs/MoveBase; return False if its package is not installed."""
        if not (self.has("actionlib/x") and self.has("move_base_msgs/x")):
            return False
        import actionlib
        from move_base_msgs.msg import MoveBaseAction

        goals: dict[str, _Ros1ActionGoal] = {}

        def begin(handle: Any) -> None:
            goals[handle.get_goal_id().id] = goal = _Ros1ActionGoal(handle)
            accept(goal)

        def stop(handle: Any) -> None:
            goal = goals.get(handle.get_goal_id().id)
            if goal is not None:
                cancel(goal)

        server = actionlib.ActionServer(
            action, MoveBaseAction, self._enqueued(begin), self._enqueued(stop), auto_start=False
        )
        server.start()
        self._server = server
        return True

    def client(self, action: str) -> Publisher:
        """Return a publisher that sends PoseStamped as goals of the action move_base_msgs/MoveBase."""
        self.type("move_base_msgs/MoveBaseAction")
        return _Ros1ActionClient(action)

    def handle(self, timeout: float) -> None:
        """Wait at most `timeout` [s] for messages, then deliver all that arrived, for at most `HANDLING`."""
        # Wait for the first message, then deliver without waiting until none is left.
        with contextlib.suppress(queue.Empty):
            self._inbox.get(timeout=max(timeout, 0.0))()
            deadline = time.monotonic() + HANDLING
            while time.monotonic() < deadline:
                self._inbox.get_nowait()()

    def close(self) -> None:
        """Shut the node down."""
        self._closed.set()
        self._rospy.signal_shutdown("done")

    def _end(self) -> None:
        """End as Ctrl-C does when ROS ends the node, as by `rosnode kill`, and keep the topics open until then."""
        if not self._closed.is_set():
            self._inbox.put(_interrupt)
            self._closed.wait(_SHUTDOWN_S)

    def _enqueued(self, take: Take) -> Take:
        """Defer `take`: rospy calls back in its own threads, while `handle` delivers in the caller's."""
        return lambda message: self._inbox.put(partial(take, message))


def _interrupt() -> None:
    raise KeyboardInterrupt


class _Ros1ActionClient:
    def __init__(self, action: str) -> None:
        import actionlib
        from move_base_msgs.msg import MoveBaseAction

        self._client = actionlib.SimpleActionClient(action, MoveBaseAction)

    @property
    def watched(self) -> bool:
        return bool(self._client.action_client.pub_goal.get_num_connections())

    def __call__(self, message: Any) -> None:
        from move_base_msgs.msg import MoveBaseGoal

        self._client.send_goal(MoveBaseGoal(target_pose=message))


class _Ros1ActionGoal:
    """A goal of move_base_msgs/MoveBase. Its states are those of actionlib."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self.pose = handle.get_goal().target_pose
        handle.set_accepted()

    def feedback(self, pose: Any, distance: float, time: int) -> None:
        from move_base_msgs.msg import MoveBaseFeedback

        self._handle.publish_feedback(MoveBaseFeedback(base_position=pose))

    def succeed(self) -> None:
        self._handle.set_succeeded(text="arrived")

    def cancel(self, reason: str) -> None:
        self._handle.set_canceled(text=reason)

    def abort(self, reason: str) -> None:
        self._handle.set_aborted(text=reason)
