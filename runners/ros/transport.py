"""The interface that the node and the simulated robot need from ROS.

`ros1.py` and `ros2.py` provide it; nothing else imports ROS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Protocol

Take = Callable[[Any], None]
HANDLING = 0.05  # [s] in one call of `handle`: messages that arrive too fast must not delay commands


class Delivery(Enum):
    """The messages that a subscriber receives."""

    NEWEST = auto()  # for sensors: older messages may be lost
    ALL = auto()
    LATCHED = auto()  # all, and the last one sent before subscribing


class Publisher(Protocol):
    """A publisher on one topic."""

    @property
    def watched(self) -> bool:
        """Return whether anybody subscribes."""

    def __call__(self, message: Any) -> None:
        """Send a message."""


@dataclass(frozen=True, slots=True)
class TopicPublisher:
    """A publisher on a topic, whose parts have other names in rospy and rclpy. subscribers: returns their number."""

    publish: Take
    subscribers: Callable[[], int]

    @property
    def watched(self) -> bool:
        """Return whether anybody subscribes."""
        return bool(self.subscribers())

    def __call__(self, message: Any) -> None:
        """Send a message."""
        self.publish(message)


class ActionGoal(Protocol):
    """A goal of an action client. It ends with one of `succeed`, `cancel` and `abort`."""

    pose: Any  # PoseStamped

    def feedback(self, pose: Any, distance: float, time: int) -> None:
        """Report the robot's PoseStamped, its distance to the goal [m], and the time since the goal arrived [ns]."""

    def succeed(self) -> None:
        """End the goal because the robot has arrived."""

    def cancel(self, reason: str) -> None:
        """End the goal because the client has cancelled it, or another goal has replaced it."""

    def abort(self, reason: str) -> None:
        """End the goal because it cannot be reached."""


class Transport(Protocol):
    """A node of ROS 1 or ROS 2, named by `version`. Message types are named as in "sensor_msgs/LaserScan".

    All messages are delivered in `handle`, in the thread that calls it.
    """

    version: int
    sim_time: bool  # whether ROS's own parameter use_sim_time is set

    def has(self, kind: str) -> bool:
        """Return whether the package of a message type is installed."""

    def type(self, kind: str) -> Any:
        """Return the class of a message. Raises InputError if its package is not installed."""

    def stamp(self, time: int) -> Any:
        """Return a message's time from nanoseconds."""

    def subscribe(self, topic: str, kind: str, take: Take, delivery: Delivery) -> None:
        """Call `take` with the messages."""

    def publisher(self, topic: str, kind: str, latched: bool = False) -> Publisher:
        """Return a publisher. latched: later subscribers receive the last message."""

    def serve(
        self, action: str, accept: Callable[[ActionGoal], None], cancel: Callable[[ActionGoal | None], None]
    ) -> bool:
        """Serve the navigation action; return False if its package is not installed."""

    def client(self, action: str) -> Publisher:
        """Return a publisher that sends PoseStamped as goals of the navigation action.

        Raises InputError if its package is not installed.
        """

    def handle(self, timeout: float) -> None:
        """Wait at most `timeout` [s] for messages, then deliver all that arrived, for at most `HANDLING`."""

    def close(self) -> None:
        """Shut the node down."""
