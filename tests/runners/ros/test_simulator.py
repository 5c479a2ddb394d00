"""What the simulated robot sends: its messages, read as the node reads them, and their rates. ROS is a fake."""

import math
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.live.messages import imu_rotation, pose_matrix, stamp_of, tilt_of, twist_of
from lme.perception.point_cloud import cloud_points, point_times
from lme.simulation.fast import FastSimulator
from lme.simulation.simulator import Attitude, LidarCloud
from lme.types import Pose, Twist
from runners.ros.outgoing import OutgoingMessages
from runners.ros.simulator import SimulatedRobot, SimulatorConfig, check_scans
from runners.ros.topics import LiveTopicsConfig
from tests.builders import room, shipped, task
from tests.tolerances import CLOUD_RANGE

SECOND = 1_000_000_000
ODOMETRY = "nav_msgs/msg/Odometry"
LEANING = Attitude(0.3, 0.05, -0.1)


class Message(SimpleNamespace):
    """A message of any type, whose fields are messages until they are set."""

    FLOAT32 = 7

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        setattr(self, name, Message())
        return getattr(self, name)


class Ros:
    """Keeps what is published, by topic, and commands a forward velocity [m/s]."""

    def __init__(self, version=2, velocity=0.0):
        self.version, self.sent, self._velocity = version, {}, velocity

    def publisher(self, topic, kind, latched=False):
        messages = self.sent.setdefault(topic, [])
        publish = messages.append

        class Publisher:
            watched = True

            def __call__(self, message):
                publish((kind, message))

        return Publisher()

    def type(self, kind):
        zeros = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        if kind == "sensor_msgs/PointField":
            return Message

        def made(**fields):
            message = Message(**fields)
            if kind == "sensor_msgs/Imu":
                message.orientation_covariance = [0.0] * 9
            message.transform.translation, message.transform.rotation = Message(**zeros), Message(**zeros)
            return message

        made.FLOAT32 = Message.FLOAT32
        return made

    def stamp(self, time):
        sec, nanosec = divmod(time, SECOND)
        return SimpleNamespace(sec=sec, nanosec=nanosec)

    def has(self, kind):
        return True

    def subscribe(self, topic, kind, take, delivery):
        self._take = take

    def handle(self, timeout):
        self._take(Message(linear=Message(x=self._velocity), angular=Message(z=0.0)))


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("times", [None, np.array([-0.08, -0.08, 0.0])])
def test_a_cloud_is_read_as_it_was_made(version, times):
    points = np.array([[1.0, -2.0, 0.5], [0.1, 0.2, -0.3], [8.0, 0.0, 2.0]])
    message = OutgoingMessages(Ros(version)).cloud(5 * SECOND, "laser", LidarCloud(points, times))
    message.is_bigendian = False
    np.testing.assert_allclose(cloud_points(message), points, atol=CLOUD_RANGE)
    start = stamp_of(message.header)
    if times is None:
        assert point_times(message, start) is None
        assert start == 5 * SECOND
    else:
        measured_at = start / SECOND + point_times(message, start)
        np.testing.assert_allclose(measured_at, 5.0 + times, atol=1e-6)


def test_odometry_and_imu_hold_how_the_body_leans():
    make = OutgoingMessages(Ros())
    odometry = make.odometry(1, "odom", "base_link", Pose(1.0, 2.0, 2.5), Twist(0.3, -0.2), LEANING)
    matrix = pose_matrix(odometry, ODOMETRY)
    assert tilt_of(matrix) == pytest.approx(LEANING[1:])
    assert tuple(matrix[:3, 3]) == (1.0, 2.0, 0.3)
    assert math.atan2(matrix[1, 0], matrix[0, 0]) == pytest.approx(2.5)
    assert twist_of(odometry, ODOMETRY) == (0.3, -0.2)
    assert tilt_of(imu_rotation(make.imu(1, "base_link", 2.5, LEANING))) == pytest.approx(LEANING[1:])


def settings(**changes):
    values = {"speed": 1e6, "step": 0.02, "scan_rate": 10.0, "odometry_rate": 10.0, "watchdog": 0.5}
    return SimulatorConfig(**values | {"goal": "none", "pause": 0.0, "scan_frame": "laser"} | changes)


def sent(simulator, topics, robot):
    """What is sent in the first second of a drive, by topic."""
    ros = Ros(velocity=0.5)
    simulated = SimulatedRobot(settings(), ros, topics, robot, simulator)
    problem = task(room(), goal=(3.0, 0.0), time_limit=1.0)
    assert len(list(simulated.drive([(problem, np.random.default_rng(0))]))) == 1
    return ros.sent


def test_a_planar_robot_sends_level_odometry_and_scans():
    robot = replace(shipped("turtlebot2"), control_rate=50.0)
    messages = sent(FastSimulator(load_settings("sim/fast"), robot), LiveTopicsConfig(imu="imu"), robot)
    assert {kind for kind, _ in messages["scan"]} == {"sensor_msgs/LaserScan"}
    assert "imu" not in messages
    odometry = messages["odom"][-1][1]
    assert tilt_of(pose_matrix(odometry, ODOMETRY)) == (0.0, 0.0)
    assert odometry.pose.pose.position.x > 0.2


def test_a_walking_robot_sends_clouds_odometry_and_an_imu_at_their_rates():
    pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
    pytest.importorskip("onnxruntime", reason="the policy of sim=mujoco needs onnxruntime")
    from lme.simulation.mujoco import MujocoSimulator

    robot = replace(shipped("go2"), control_rate=50.0)
    simulator = MujocoSimulator(load_settings("sim/mujoco", twist="zero", registered=False), robot)
    topics = LiveTopicsConfig(scan="cloud", scan_type="PointCloud2", imu="imu")
    messages = sent(simulator, topics, robot)
    counts = Counter({topic: len(entries) for topic, entries in messages.items()})
    # 50 steps, and everything at the end.
    assert (counts["/clock"], counts["imu"], counts["odom"], counts["cloud"]) == (51, 51, 11, 11)
    twists = [twist_of(message, ODOMETRY) for _, message in messages["odom"]]
    assert set(twists) == {(0.0, 0.0)}
    assert max(abs(tilt_of(pose_matrix(message, ODOMETRY)).pitch) for _, message in messages["odom"]) > 0.005
    # The cloud is whole: most points of a Mid-360 in a room without a ceiling hit walls above the robot.
    cloud = messages["cloud"][-1][1]
    cloud.is_bigendian = False
    points = cloud_points(cloud)
    assert len(points) > 10_000
    assert (points[:, 2] > 1.0).mean() > 0.2
    assert np.ptp(point_times(cloud, stamp_of(cloud.header))) == pytest.approx(0.08)
    # At first, where the robot stands, the lidar is as high above the floor as the robot has it.
    _, mount = messages["/tf_static"][0]
    odometry = pose_matrix(messages["odom"][0][1], ODOMETRY)
    height = odometry[2, 3] + mount.transforms[0].transform.translation.z
    assert height == pytest.approx(robot.lidar.cloud.height, abs=0.01)


def test_a_planar_simulator_has_no_clouds(says):
    simulator = FastSimulator(load_settings("sim/fast"), shipped("go2"))
    topics = LiveTopicsConfig(scan_type="PointCloud2")
    with pytest.raises(InputError) as error:
        check_scans(topics, simulator)
    says(error.value)
