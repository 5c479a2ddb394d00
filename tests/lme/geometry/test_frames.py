import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.geometry.frames import compose, relative, to_robot, to_world, wrap_angle
from lme.types import Pose
from tests.tolerances import KERNEL

COORDINATE = st.floats(-100, 100)
POSES = st.builds(Pose, COORDINATE, COORDINATE, st.floats(-10, 10))


@given(st.floats(-1e6, 1e6))
def test_wrapping_keeps_the_direction_and_lands_in_the_half_open_turn(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=KERNEL)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=KERNEL)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(math.pi, math.pi), (-math.pi, math.pi), (3 * math.pi, math.pi), (0.25, 0.25), (-3.0, -3.0)],
)
def test_wrapping_at_the_seam(angle, wrapped):
    assert wrap_angle(angle) == wrapped


def test_a_point_ahead_of_a_robot_that_faces_north():
    # At (1, 2), facing +y: one metre ahead is (1, 3), one metre to the left is (0, 2).
    robot = Pose(1.0, 2.0, math.pi / 2)
    points = to_world(np.array([[1.0, 0.0], [0.0, 1.0]]), robot)
    assert points == pytest.approx(np.array([[1.0, 3.0], [0.0, 2.0]]), abs=KERNEL)


@given(POSES, COORDINATE, COORDINATE)
def test_robot_frame_undoes_world_frame(pose, x, y):
    point = np.array([x, y])
    assert to_robot(to_world(point, pose), pose) == pytest.approx(point, abs=KERNEL)


@given(POSES, POSES, COORDINATE, COORDINATE)
def test_composed_frames_move_points_as_one_after_the_other(pose, child, x, y):
    point = np.array([x, y])
    assert to_world(point, compose(pose, child)) == pytest.approx(
        to_world(to_world(point, child), pose), abs=KERNEL
    )


@given(POSES, POSES)
def test_relative_undoes_compose(frame, child):
    back = relative(compose(frame, child), frame)
    assert back[:2] == pytest.approx(child[:2], abs=1e-9)
    assert abs(wrap_angle(back.yaw - child.yaw)) < 1e-9
