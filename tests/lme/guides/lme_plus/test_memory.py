"""What LME+ remembers lies where it was seen, though nothing but the twist carries its frame."""

import math

import numpy as np
import pytest

import lme
from lme.geometry.frames import to_robot
from lme.guides.lme_plus.memory import Memory
from lme.types import Pose, Twist
from tests.builders import escape, stage, wander
from tests.tolerances import KERNEL

REACH = 12.0  # [m]


def test_the_frame_is_carried_with_the_robot():
    memory = Memory(stage(), REACH)
    seen, poses = wander(even=False)
    for view, pose in zip(seen, poses, strict=True):
        memory.see(view)
        assert tuple(memory.pose) == pytest.approx(
            tuple(pose), abs=0.005
        )  # arcs are chords here, 5 of them a second


def test_points_out_of_reach_come_back_with_the_robot():
    """A post seen at the start is in use again when the robot has gone 20 m away, blind, and returned."""
    memory, robot = Memory(stage(), 6.0), stage()
    memory.see(scan_of([(2.0, 2.0, 0.3)], []))
    there = memory.points.copy()
    assert len(there)
    blind = scan_of([], [])
    blind = blind._replace(scan=blind.scan._replace(ranges=np.zeros_like(blind.scan.ranges)))
    for v in (1.0, -1.0):
        for _ in range(round(20.0 / robot.dt)):
            memory.see(blind._replace(twist=Twist(v, 0.0)))
            assert not len(memory.points) or memory.pose.x < 12.0
    assert memory.pose.x == pytest.approx(0.0, abs=2.0)
    np.testing.assert_array_equal(np.sort(memory.points, axis=0), np.sort(there, axis=0))


def test_points_of_the_scan_are_known_from_the_first_look_on():
    memory = Memory(stage(), 30.0)
    seen = escape(steps=5)
    for view in seen:
        memory.see(view)
        known = to_robot(memory.points, memory.pose)
        away = np.hypot(*(known[:, None] - memory.seen).transpose(2, 0, 1)).min(axis=0)
        assert away.max() <= 0.05 * math.sqrt(2.0)  # one point per square
    assert memory.seen.shape[1] == 2


def test_without_kept_the_memory_holds_the_last_scan_alone():
    memory = Memory(stage(), REACH, keeps=False)
    seen = escape(steps=5)
    for view in seen:
        memory.see(view)
    alone = Memory(stage(), REACH, keeps=False)
    alone.see(seen[-1])
    assert (
        abs(len(memory.points) - len(alone.points)) <= 0.1 * len(alone.points) + KERNEL
    )  # squares lie otherwise


def scan_of(circles, pedestrians, turn=0.0):
    """What a robot at the origin, turned by an angle, sees of discs; people are given in the world."""
    robot, pose = stage(), Pose(0.0, 0.0, turn)
    scan = lme.cast(robot.lidar, pose, np.array(circles, dtype=float), np.empty((0, 4)))
    people = np.array(pedestrians, dtype=float).reshape(-1, 4)
    people = np.column_stack((to_robot(people[:, :2], pose), to_robot(people[:, 2:], pose)))
    return lme.Observation(scan, np.array([9.0, 0.0]), Twist(0.0, 0.0), robot.limits, pose, people)


def test_points_of_tracked_people_are_known_but_never_remembered():
    post, person = (2.0, 0.0, 0.3), (2.0, 2.0, 0.3)
    hidden = (4.0, 4.0, 0.5)  # a post that hides the place behind it
    memory = Memory(stage(), REACH)
    memory.see(scan_of([post, person], [(2.0, 2.0, 0.5, -1.0)]))
    away = np.hypot(*(memory.points - person[:2]).T)
    assert away.min() > 0.5  # not the person
    assert (
        np.hypot(*(memory.known - person[:2]).T).min() < 0.35
    )  # but the planner and straight ways know them
    assert memory.people == pytest.approx(np.array([[2.0, 2.0, 0.5, -1.0, 0.3, 0.0]]), abs=0.02)
    memory.see(scan_of([post, hidden], []))
    assert not len(memory.people)
    assert np.hypot(*(memory.known - person[:2]).T).min() > 0.5  # nobody is left behind
    plain = Memory(stage(), REACH, people=False)
    plain.see(scan_of([post, person], [(2.0, 2.0, 0.5, -1.0)]))
    assert np.hypot(*(plain.points - person[:2]).T).min() < 0.35
    assert not len(plain.people)


def test_people_are_carried_in_the_frame_of_the_points():
    """The robot turned by 0.5 rad while it was watching: places and velocities are those of the first frame."""
    memory, turning = Memory(stage(), REACH), Twist(0.0, 0.5 / stage().dt)
    memory.see(scan_of([], [])._replace(twist=turning))
    memory.see(scan_of([(2.0, 1.0, 0.3)], [(2.0, 1.0, 0.4, 0.3)], turn=0.5)._replace(twist=turning))
    assert memory.people == pytest.approx(np.array([[2.0, 1.0, 0.4, 0.3, 0.3, 0.0]]), abs=0.02)


def test_who_stands_is_timed_until_they_walk_on():
    memory, dt = Memory(stage(), REACH), stage().dt
    stood = []
    for vx in (0.0, 0.0, 0.0, 0.8, 0.0):
        memory.see(scan_of([(2.0, 1.0, 0.3), (-2.0, 1.0, 0.3)], [(2.0, 1.0, vx, 0.0), (-2.0, 1.0, 0.5, 0.0)]))
        stood.append(memory.people[:, 5])
    assert np.array(stood) == pytest.approx(
        np.array([[0.0, 0.0], [dt, 0.0], [2 * dt, 0.0], [0.0, 0.0], [dt, 0.0]])
    )
