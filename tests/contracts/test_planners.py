"""What every reactive planner must do, whatever it computes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.planners.apf import Apf
from lme.planners.dwa import Dwa
from lme.planners.eband.planner import EBand
from lme.planners.lics import Lics
from lme.planners.min_time.planner import MinTime
from lme.planners.motion_tubes.planner import MotionTubes
from lme.planners.motion_tubes.tube_vote import TubeVote
from lme.planners.mppi.planner import Mppi
from lme.planners.orca import Orca
from lme.planners.ros_dwa.planner import RosDwa
from lme.planners.ros_eband.planner import RosEBand
from lme.planners.s3_fisvfh.planner import S3Fisvfh
from lme.planners.teb.planner import Teb
from lme.planners.vfh_plus import VfhPlus
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.world import World
from tests.builders import SHIPPED, observation, shipped
from tests.lme.planners.drives import drive, plan
from tests.tolerances import KERNEL

PLANNERS = {
    "apf": Apf,
    "dwa": Dwa,
    "eband": EBand,
    "lics": Lics,
    "min_time": MinTime,
    "motion_tubes": MotionTubes,
    "mppi": Mppi,
    "orca": Orca,
    "ros_dwa": RosDwa,
    "ros_eband": RosEBand,
    "s3_fisvfh": S3Fisvfh,
    "teb": Teb,
    "tube_vote": TubeVote,
    "vfh_plus": VfhPlus,
}
every_planner = pytest.mark.parametrize("name", PLANNERS)
every_robot = pytest.mark.parametrize("robot", SHIPPED)


def planner(name, robot):
    made = PLANNERS[name](load_settings(f"planner/{name}"), robot)
    made.reset(np.random.default_rng(0))
    return made


@every_planner
@every_robot
def test_any_scan_gives_a_finite_command_within_limits(name, robot):
    """From rest and from full speed. The ranges may be no numbers, or none, and the path a point or two of one."""
    robot = shipped(robot)
    beams = robot.lidar.num_beams
    mixed = np.resize(np.array([math.nan, 0.05, 1.0], dtype=np.float32), beams)
    scans = (np.full(beams, value, np.float32) for value in (0.0, math.nan, math.inf, -1.0, 0.3, 5.0, 1e9))
    fast = Twist(robot.v_max, -robot.omega_max)
    for ranges in (mixed, np.empty(0, np.float32), *scans):
        made = planner(name, robot)
        for twist, target, path in (
            (Twist(0.0, 0.0), (0.0, 0.0), None),
            (fast, (3.0, 1.0), [(0.0, 0.0), (0.0, 0.0), (3.0, 1.0), (3.0, 1.0)]),
            (Twist(0.0, 0.0), (-2.0, 0.0), [(0.0, 0.0)]),
            (fast, (1e-12, -1e-12), None),
        ):
            view = observation(target, ranges, twist, robot)
            command = made.plan(view, Guidance(view.target, None if path is None else np.array(path)))
            assert np.isfinite(command).all()
            assert abs(command.v) <= robot.v_max + KERNEL
            assert abs(command.v - twist.v) <= robot.alpha_v * robot.dt + KERNEL
            assert abs(command.omega) <= robot.omega_max + KERNEL
            assert abs(command.omega - twist.omega) <= robot.alpha_omega * robot.dt + KERNEL


# ORCA leaves the side open where the target lies behind.
@pytest.mark.parametrize(
    ("name", "rear"), [("apf", -5.0), ("min_time", -5.0), ("orca", 0.1), ("vfh_plus", -5.0)]
)
@given(
    st.sampled_from(["stage", "jackal", "go2"]),
    st.lists(st.floats(0.25, 3.0), min_size=12, max_size=12),
    st.tuples(st.floats(0, 1), st.floats(0.01, 5)),
    st.tuples(st.floats(0, 0.4), st.floats(-1, 1)),
)
def test_a_mirrored_scene_gives_the_mirrored_command(name, rear, robot, arcs, target, twist):
    """Each of the arcs [m] is the range of a twelfth of the beams."""
    robot = shipped(robot)
    lidar, x, y = robot.lidar, rear + (5.0 - rear) * target[0], target[1]
    arcs = 1.0137 * np.array(arcs)  # not on a threshold
    ranges = np.repeat(arcs.astype(np.float32), -(-lidar.num_beams // 12))[: lidar.num_beams]
    shift = lidar.angle_min + lidar.angle_increment * (lidar.num_beams - 1) / 2

    def command(side):
        turned = Twist(twist[0], side * twist[1])
        view = observation((x, side * y), ranges[::side].copy(), turned, robot)
        view = view._replace(scan=view.scan._replace(angle_min=lidar.angle_min - shift))
        return plan(planner(name, robot), view)

    assert command(-1) == pytest.approx(command(1) * np.array([1.0, -1.0]), abs=1e-6)


@pytest.mark.parametrize(
    ("name", "robot"),
    [*((name, robot) for name in ("apf", "orca", "vfh_plus") for robot in SHIPPED), ("teb", "jackal")],
)
def test_it_drives_straight_to_the_goal_and_stays_there(name, robot):
    robot = shipped(robot)
    start = Pose(0.0, 0.0, 0.0 if name == "teb" else 0.3)
    episode = drive(
        planner(name, robot), robot, goal=(10.0, 0.0), start=start, goal_tolerance=0.0, time_limit=45.0
    )
    track = episode.trajectory
    away = np.hypot(track[:, 1] - 10.0, track[:, 2])
    assert np.abs(track[:, 2]).max() < 0.5
    assert away.min() < 0.2
    assert away[np.argmax(away < 0.2) :].max() < 0.2
    assert abs(track[-1, 4]) < 1e-3


@pytest.mark.parametrize(
    ("name", "pad"),
    [
        *((name, 0.3) for name in ("apf", "dwa", "eband", "motion_tubes", "s3_fisvfh", "vfh_plus")),
        ("apf", 0.05),
        ("vfh_plus", 0.05),
    ],
)
@every_robot
def test_a_tight_sealed_box_ends_in_a_timeout(name, robot, pad):
    """Wider ones are in test_pairs.py. pad: room on all sides [m]."""
    robot = shipped(robot)
    length, width, rounding = robot.footprint.box
    x, y = length + rounding + pad, width + rounding + pad
    corners = np.array([[-x, -y], [x, -y], [x, y], [-x, y]])
    world = World(segments=np.hstack([corners, np.roll(corners, -1, axis=0)]))
    episode = drive(planner(name, robot), robot, world, goal=(6.0, 3.0), time_limit=15.0)
    assert episode.outcome is Outcome.TIMEOUT
    assert episode.min_clearance > 0.0


@every_planner
def test_a_second_episode_is_as_the_first(name):
    robot = shipped("jackal")
    made, view = planner(name, robot), observation(robot=robot)
    first = [plan(made, view) for _ in range(3)]
    made.reset(np.random.default_rng(0))
    assert [plan(made, view) for _ in range(3)] == first
