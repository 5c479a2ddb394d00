"""What passes out of sight is remembered where it stands, and only for as long as it cannot be seen."""

import math

import numpy as np
import pytest

from lme.perception.scan_points import BlindArc, obstacle_points
from lme.types import Pose
from tests.builders import observation, stage

ROBOT = stage(fov=math.radians(270.0), num_beams=541)


def view(odometry, post=None, robot=ROBOT):
    """A post of 0.1 m at `post` in the odometry frame, as seen from there."""
    lidar = robot.lidar
    ranges = np.full(lidar.num_beams, lidar.range_max, dtype=np.float32)
    if post is not None:
        dx, dy = post[0] - odometry.x, post[1] - odometry.y
        bearing = math.remainder(math.atan2(dy, dx) - odometry.yaw, math.tau)
        bearings = lidar.angle_min + lidar.angle_increment * np.arange(lidar.num_beams)
        ranges[np.abs(bearings - bearing) < 0.05] = math.hypot(dx, dy)
    return observation(ranges=ranges, robot=robot, odometry=odometry)


@pytest.mark.parametrize("side", [1, -1])
def test_a_post_that_passes_behind_is_remembered_where_it_stands(side):
    arc, post = BlindArc(ROBOT.lidar.mount, 2.0), (0.5, 0.5 * side)
    assert len(arc.points(view(Pose(0, 0, 0), post))) > 0
    behind = arc.points(view(Pose(1.5, 0, 0.2 * side)))
    assert len(behind) > 0
    # 1.0 m back and 0.5 m aside, turned by 0.2.
    bearing = math.atan2(0.5, -1.0) - 0.2
    expected = math.hypot(1.0, 0.5) * np.array([math.cos(bearing), side * math.sin(bearing)])
    assert behind.mean(axis=0) == pytest.approx(expected, abs=0.02)


def test_points_in_view_come_from_the_scan_alone():
    arc = BlindArc(ROBOT.lidar.mount, 2.0)
    arc.points(view(Pose(0, 0, 0), (1.0, 0.3)))
    assert len(arc.points(view(Pose(0, 0, 0)))) == 0  # gone
    assert len(arc.points(view(Pose(2.5, 0, 0)))) == 0  # and forgotten


def test_far_points_of_the_blind_arc_are_forgotten():
    arc = BlindArc(ROBOT.lidar.mount, 1.0)
    arc.points(view(Pose(0, 0, 0), (0.5, 0.5)))
    assert len(arc.points(view(Pose(0.9, 0, -0.6)))) > 0
    assert len(arc.points(view(Pose(3.0, 0, -0.6)))) > 0  # it was near when it was last thought of
    assert len(arc.points(view(Pose(0.9, 0, -0.6)))) == 0


def test_a_full_circle_has_nothing_to_remember():
    robot = stage()
    arc = BlindArc(robot.lidar.mount, 2.0)
    seen = view(Pose(0, 0, 0), (0.5, 0.5), robot)
    assert np.array_equal(arc.points(seen), obstacle_points(seen.scan, robot.lidar.mount))
    assert len(arc.points(view(Pose(1.5, 0, 0), robot=robot))) == 0


def test_smaller_cells_keep_more_and_more_exact_points():
    wall, rough, fine = (
        view(Pose(0, 0, 0), (0.3, -0.6)),
        *(BlindArc(ROBOT.lidar.mount, 2.0, c) for c in (0.05, 0.01)),
    )
    seen = obstacle_points(wall.scan, ROBOT.lidar.mount)
    behind = view(Pose(0.0, 0.0, 2.2))
    off = []
    for arc in (rough, fine):
        arc.points(wall)
        kept = arc.points(behind)
        turned = kept @ np.array([[math.cos(2.2), math.sin(2.2)], [-math.sin(2.2), math.cos(2.2)]])
        off.append(np.hypot(*(turned[:, None] - seen).T).min(axis=1).max())
    assert off[1] < 0.01 < off[0]
