"""Where the lidar of a scan or a cloud is, how high, and what is said if that is in doubt."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.errors import InputError
from lme.live.config import CloudConfig, ScanConfig
from lme.live.scan_source import ScanSource
from lme.perception.point_cloud import rigid_transform
from lme.robots import Cloud
from tests import builders
from tests.made_bags import BagMaker

ABOVE_FLOOR = 0.45  # [m] the lidar of the Go2
GO2 = replace(builders.shipped("go2"), collision_radius=None)
TURTLEBOT = builders.shipped("turtlebot2")


def at(height, roll=0.0, pitch=0.0, yaw=0.0):
    return rigid_transform((0.0, 0.0, height, roll, pitch, yaw))


def wall(height, frame="livox"):
    """A cloud of a low wall 2 m ahead, 0.1 to 0.3 m above the floor, from a lidar at a height."""
    across, up = np.meshgrid(np.linspace(-1.0, 1.0, 100), [0.1, 0.2, 0.3])
    message = BagMaker().cloud(0, np.column_stack((np.full(300, 2.0), across.ravel(), up.ravel() - height)))
    message.header.frame_id = frame
    return message


def read(message, by_tf, robot, **config):
    """The nearest range, and the warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        source = ScanSource(ScanConfig(**config), message, by_tf, robot)
        ranges = source.read(message).ranges
    nearest = np.nanmin(ranges) if np.isfinite(ranges).any() else math.nan
    return nearest, [str(one.message) for one in caught], source


@pytest.mark.parametrize(
    ("in_base", "robot"),
    [(ABOVE_FLOOR, GO2), (0.4, GO2), (ABOVE_FLOOR, TURTLEBOT)],
    ids=["as the robot", "nearly", "robot without a cloud"],
)
def test_a_mount_by_tf_above_the_floor_is_taken_as_it_is(in_base, robot):
    nearest, said, source = read(wall(in_base), at(in_base), robot)
    assert nearest == pytest.approx(2.0, abs=0.01)
    assert said == []
    assert source.mounted_by == "tf"


@pytest.mark.parametrize("in_base", [0.0, 0.15, -0.1], ids=["the base is the lidar", "base_link", "below it"])
def test_a_base_frame_above_the_floor_is_seen_by_the_height_of_the_robots_lidar(in_base, says):
    nearest, said, source = read(wall(ABOVE_FLOOR), at(in_base), GO2)
    assert nearest == pytest.approx(2.0, abs=0.01)
    (text,) = said
    assert f"{ABOVE_FLOOR - in_base:.2f} m above the floor" in text
    says(text)
    assert source.mounted_by == "tf"


def test_tf_that_has_the_lidar_higher_than_the_robot_is_right_but_said():
    nearest, said, _ = read(wall(0.8), at(0.8), GO2)
    assert nearest == pytest.approx(2.0, abs=0.01)
    assert "tf is used" in said[0]


def test_a_cloud_on_the_floor_by_the_name_of_its_frame_is_not_lifted():
    nearest, said, _ = read(wall(0.0, "base_footprint"), at(0.0), GO2)
    assert nearest == pytest.approx(2.0, abs=0.01)
    assert said == []


def test_heights_below_the_base_frame_are_those_of_a_base_frame_above_the_floor():
    cloud = CloudConfig(min_height=0.05 - ABOVE_FLOOR, max_height=0.0)
    for mount in (at(0.0), None):
        nearest, said, _ = read(wall(ABOVE_FLOOR), mount, GO2, cloud=cloud)
        assert nearest == pytest.approx(2.0, abs=0.01)
        assert said == []


def test_scan_mount_is_taken_as_it_is():
    nearest, said, _ = read(wall(0.3), at(0.0), GO2, mount=[0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    assert nearest == pytest.approx(2.0, abs=0.01)
    assert said == []


def test_a_cloud_whose_height_nobody_knows_is_refused(says):
    with says.raises(InputError):
        read(wall(0.3), None, TURTLEBOT)


def test_a_robot_without_a_cloud_whose_base_is_the_lidar_is_warned_of(says):
    _, said, _ = read(wall(0.1, "body"), at(0.0), TURTLEBOT)
    says(said[0])
    _, said, _ = read(wall(0.0, "base_link"), at(0.0), TURTLEBOT)
    assert said == []


def test_the_heights_are_those_of_the_robots_cloud_unless_given(says):
    tall = replace(GO2, lidar=replace(GO2.lidar, cloud=Cloud(ABOVE_FLOOR, 0.35, 0.6)))
    nearest, said, _ = read(wall(ABOVE_FLOOR), at(ABOVE_FLOOR), tall)
    assert math.isnan(nearest)
    assert "between 0.35 and 0.6 m high" in said[0]
    given = CloudConfig(min_height=0.05, max_height=0.5)
    assert read(wall(ABOVE_FLOOR), at(ABOVE_FLOOR), tall, cloud=given)[0] == pytest.approx(2.0, abs=0.01)
    with says.raises(InputError, match="max_height.*0.2"):
        read(wall(ABOVE_FLOOR), at(ABOVE_FLOOR), tall, cloud=CloudConfig(max_height=0.2))


def test_points_in_range_but_not_between_the_heights_are_warned_of_once(says):
    nearest, said, source = read(wall(-1.0), at(ABOVE_FLOOR), GO2)
    assert math.isnan(nearest)
    (text,) = said
    says(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        source.read(wall(-1.0))


def scan(frame="laser"):
    message = BagMaker().scan(0, np.linspace(1.0, 2.0, 360), -math.pi, math.tau / 360)
    message.header.frame_id = frame
    return message


@pytest.mark.parametrize("tilt", [{"roll": math.pi / 2}, {"roll": -1.4}, {"pitch": math.pi / 2}])
def test_a_planar_lidar_on_its_side_is_refused(tilt, says):
    with says.raises(InputError):
        read(scan(), at(0.2, **tilt), TURTLEBOT)


@pytest.mark.parametrize("tilt", [{"pitch": 0.35}, {"roll": 0.35}, {"roll": math.pi - 0.35}])
def test_a_tilted_planar_lidar_is_warned_of(tilt, says):
    _, (text,), _ = read(scan(), at(0.2, **tilt), TURTLEBOT)
    says(text)


@pytest.mark.parametrize("tilt", [{}, {"pitch": 0.1}, {"roll": math.pi}, {"pitch": math.pi}])
def test_a_level_or_upside_down_lidar_is_not(tilt):
    assert read(scan(), at(0.2, yaw=1.0, **tilt), TURTLEBOT)[1] == []


def test_every_kind_of_fault_is_warned_of_once(says):
    wrong = scan()
    wrong.range_max = 12000.0
    _, (text,), source = read(wrong, at(0.2), TURTLEBOT)
    assert "range_max is 12000 m" in text
    assert read(wrong, at(0.2), TURTLEBOT, range_max=10.0)[1] == []
    assert source.blinding_fault(scan()) is None
    says(source.blinding_fault(scan("rear")))


def test_a_return_between_two_surfaces_is_dropped_if_the_robot_says_so():
    message = scan()
    message.ranges = np.full(len(message.ranges), 3.0, np.float32)
    message.ranges[:100], message.ranges[100] = 1.0, 2.0
    beams = {"num_beams": len(message.ranges), "fov": len(message.ranges) * message.angle_increment}
    robots = [
        replace(TURTLEBOT, lidar=replace(TURTLEBOT.lidar, **beams, native_beams=None, shadow_angle=angle))
        for angle in (None, 0.17)
    ]
    kept, dropped = (
        ScanSource(ScanConfig(), message, at(0.2), robot).read(message).ranges for robot in robots
    )
    assert np.isfinite(kept).all()
    assert np.isnan(dropped).sum() == 1
