"""Observations of a user's own program: what cannot be used is refused before anything changes, what is odd is said."""

import math

import numpy as np
import pytest

import lme
from lme.errors import InputError
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.types import LaserScan, Pose, Twist
from tests.builders import CLUTTER, observation, shipped

JACKAL = shipped("jackal")


def looking(robot=JACKAL, **changes):
    """What the robot sees among the clutter, with other values for parts of its scan or of its observation."""
    scan = lme.cast(robot.lidar, Pose(0.0, 0.0, 0.0), CLUTTER.circles, CLUTTER.segments)
    parts = {key: changes.pop(key) for key in list(changes) if key in LaserScan._fields}
    return observation(robot=robot)._replace(scan=scan._replace(**parts), **changes)


def driver(system="lme_plus"):
    made = lme.load_system(system, "jackal")
    made.reset(np.random.default_rng(0))
    return made


def test_lists_and_other_numbers_are_taken():
    plain = looking()
    lists = plain._replace(target=[4, 0], twist=(0, 0), odometry=[0, 0, 0], pedestrians=[[2, 1, 0, 0]])
    lists = lists._replace(scan=plain.scan._replace(ranges=plain.scan.ranges.tolist()))
    expected = driver().act(plain._replace(pedestrians=np.array([[2.0, 1.0, 0.0, 0.0]])))
    assert driver().act(lists) == expected


RANGES = looking().scan.ranges
WRONG = {
    "target with nan": {"target": np.array([math.nan, 0.0])},
    "target of three": {"target": np.zeros(3)},
    "twist": {"twist": Twist(0.0, math.inf)},
    "no odometry": {"odometry": None},
    "backing up forwards": {"limits": JACKAL.limits._replace(v_min=0.2)},
    "negative limits": {"limits": JACKAL.limits._replace(v_max=-1.0)},
    "last command": {"last_command": Twist(math.nan, 0.0)},
    "pedestrians of five": {"pedestrians": np.zeros((1, 5))},
    "one pedestrian": {"pedestrians": np.zeros(4)},
    "ranges of two dimensions": {"ranges": RANGES[None]},
    "no ranges": {"ranges": RANGES[:0]},
    "millimetres": {"ranges": RANGES * 1000.0},
    "whole millimetres": {"ranges": (RANGES * 1000.0).astype(np.int32)},
    "nothing measured": {"ranges": np.full_like(RANGES, math.nan)},
    "no increment": {"angle_increment": 0.0},
    "degrees": {"angle_min": -135.0, "angle_increment": 0.375},
    "no range_max": {"range_max": 0.0},
}


@pytest.mark.parametrize("changes", WRONG.values(), ids=WRONG)
def test_what_cannot_be_used_is_refused(changes, says):
    with says.raises(InputError):
        driver().act(looking(**changes))


def test_a_part_of_the_beams_is_said(says):
    with says.warns():
        driver().act(looking(ranges=RANGES[:100]))


def turning(scale_m=1.0, scale_rad=1.0):
    """Give a navigator the odometry of a circle, in these units."""
    made = driver("lme")
    for k in range(12):
        yaw = 0.05 * k
        pose = Pose(scale_m * math.sin(yaw), scale_m * (1.0 - math.cos(yaw)), scale_rad * yaw)
        made.act(looking(odometry=pose, twist=Twist(1.0, 1.0)))


@pytest.mark.parametrize("scales", [(1000.0, 1.0), (1.0, math.degrees(1.0))], ids=["millimetres", "degrees"])
def test_odometry_in_another_unit_is_said_once(scales, says):
    with says.warns(match="odometry"):
        turning(*scales)


def test_odometry_may_jump_at_a_correction(recwarn):
    turning()
    made = driver("lme")
    for k in range(12):
        made.act(looking(odometry=Pose(0.05 * k + 3.0 * (k > 5), 0.0, 0.0), twist=Twist(0.5, 0.0)))
    assert not recwarn


def test_a_refused_observation_changes_nothing():
    steps = [looking(odometry=Pose(0.1 * k, 0.0, 0.0), twist=Twist(1.0, 0.0)) for k in range(4)]
    undisturbed, disturbed = driver(), driver()
    for step in steps:
        expected = undisturbed.act(step)
        for bad in ({"odometry": Pose(math.nan, 0.0, 0.0)}, {"target": np.array([0.0, math.nan])}):
            with pytest.raises(InputError, match="finite"):
                disturbed.act(step._replace(**bad))
        with pytest.raises(InputError, match="no beam"):
            disturbed.act(step._replace(scan=step.scan._replace(ranges=np.full_like(RANGES, np.nan))))
        assert disturbed.act(step) == expected


def test_beams_that_fail_now_and_then_are_no_fault():
    made = driver()
    made.act(looking())
    ranges = RANGES.copy()
    ranges[::3] = math.nan
    assert made.act(looking(ranges=ranges)) is not None


def test_a_navigator_of_ones_own_parts_refuses_what_is_not_finite(says):
    guide, planner = (
        lme.Target(lme.load_settings("guide/target"), JACKAL),
        Simple(lme.load_settings("planner/simple"), JACKAL),
    )
    made = Navigator(guide, planner)
    made.reset(np.random.default_rng(0))
    with says.raises(InputError):
        made.act(looking(odometry=Pose(0.0, math.nan, 0.0)))
