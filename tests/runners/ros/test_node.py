"""The node's commands, with a driver and a ROS that are none, and its watchdog."""

import threading
import time
from types import SimpleNamespace

import pytest

from lme.live.frames import Frames
from lme.live.messages import SECOND
from lme.live.step import STILL, LiveState, LiveStep
from lme.types import Twist
from runners.ros.node import Node, NodeConfig, Watchdog
from runners.ros.topics import LiveTopicsConfig

DRIVES = LiveStep(0, LiveState.DRIVING, "", Twist(0.3, 0.0), 1)


class Ros:
    """Keeps what is published on cmd_vel."""

    version, sim_time = 1, False

    def __init__(self):
        self.sent, self.heard = [], {}

    def publisher(self, topic, kind, latched=False):
        return self.sent.append if topic == "cmd_vel" else SimpleNamespace(watched=False)

    def type(self, kind):
        return lambda: SimpleNamespace(linear=SimpleNamespace(), angular=SimpleNamespace())

    def has(self, kind):
        return False

    def serve(self, *_):
        return False

    def subscribe(self, topic, kind, take, delivery):
        self.heard[topic] = kind

    def handle(self, timeout):
        pass

    @property
    def velocities(self):
        return [message.linear.x for message in self.sent]


class Driver:
    """Gives the steps of a script, which may be functions, and then ends the node."""

    take_scan = take_odometry = take_imu = take_transforms = None
    frames, soft_stops = Frames("odom", "base_link"), 0

    def __init__(self, *script):
        self._script = iter(script)

    def tick(self, now):
        step = next(self._script, None)
        if step is None:
            raise KeyboardInterrupt
        return step() if callable(step) else step

    def stop(self, reason):
        return LiveStep(0, LiveState.STOPPED, reason)


def sent(*script, stale=5.0):
    """Forward velocities of the commands of a node [m/s]."""
    ros = Ros()
    node = Node(NodeConfig(stale=stale), ros, LiveTopicsConfig(), Driver(*script), 0.001)
    with pytest.raises(KeyboardInterrupt):
        node.run()
    return ros.velocities


FAREWELL = [0.0] * 3


@pytest.mark.parametrize("imu", [None, "utlidar/imu"])
def test_the_node_hears_an_imu_where_one_is_given(imu):
    ros = Ros()
    Node(NodeConfig(), ros, LiveTopicsConfig(imu=imu), Driver(), 0.1)
    assert {kind for kind in ros.heard.values() if "Imu" in kind} == ({"sensor_msgs/Imu"} if imu else set())
    assert ros.heard.get("utlidar/imu") == (imu and "sensor_msgs/Imu")


@pytest.mark.parametrize("state", [LiveState.CANCELLED, LiveState.ARRIVED])
def test_the_node_sends_zero_velocity_however_late_it_hears_that_the_goal_is_gone(state):
    end = LiveStep(20 * SECOND, state, str(state), STILL, 1)
    rested = end._replace(stamp=22 * SECOND)
    assert sent(DRIVES, end, rested) == [0.3, 0.0, *FAREWELL]


def test_the_node_sends_zero_velocity_while_a_decision_does_not_end():
    def slow():
        time.sleep(0.5)
        return DRIVES

    assert sent(DRIVES, slow, stale=0.1)[:3] == [0.3, 0.0, 0.0]


def test_the_node_sends_nothing_while_it_has_no_goal():
    def slow():
        time.sleep(0.3)
        return idle

    idle = LiveStep(0, LiveState.IDLE, "no goal")
    assert sent(idle, slow, stale=0.1) == FAREWELL


def test_the_watchdog_halts_the_robot_repeatedly_until_it_is_fed():
    halted = threading.Semaphore(0)
    with Watchdog(0.02, halted.release):
        assert all(halted.acquire(timeout=10.0) for _ in range(3))


def test_the_watchdog_does_not_disturb_a_running_loop():
    halts = []
    with Watchdog(5.0, lambda: halts.append(1)) as watchdog:
        for _ in range(20):
            watchdog.feed()
            time.sleep(0.005)
    assert not halts
