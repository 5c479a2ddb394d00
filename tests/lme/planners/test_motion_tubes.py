"""The planner KUL+FM: how the robot follows free tubes, stops, turns and backs up."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.guides.target import Target, TargetConfig
from lme.navigation.navigator import Navigator
from lme.perception.raycast import cast_shapes
from lme.planners.motion_tubes.planner import MotionTubes
from lme.robots import Footprint
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Pose, Twist
from lme.worlds.world import World
from tests.builders import SHIPPED, observation, room, shipped, stage, task
from tests.lme.planners.motion_tubes.scenes import COARSE, JACKAL, NO_EDGES, scattered
from tests.tolerances import KERNEL


class ByPath:
    """A guide with a fixed path in the odometry frame, what is left of it from the robot on."""

    def __init__(self, corners):
        self.lead(corners)

    def lead(self, corners):
        corners = np.array(corners, dtype=float)
        along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
        ticks = np.arange(0.0, along[-1], 0.05)
        self._points = np.column_stack([np.interp(ticks, along, corners[:, k]) for k in (0, 1)])

    def reset(self, rng):
        pass

    def guide(self, observation):
        x, y, yaw = observation.odometry
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        nearest = np.hypot(*(self._points[:40] - (x, y)).T).argmin()
        self._points = self._points[min(nearest, len(self._points) - 2) :]
        path = np.vstack(((0.0, 0.0), (self._points[1:] - (x, y)) @ turn))
        return Guidance(observation.target, path)


def drive(robot, job, steps, guide=None, **config):
    """Poses, twists and the simulator after `steps` or contact or arrival."""
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    driver = Navigator(
        guide or Target(TargetConfig(), robot),
        MotionTubes(load_settings("planner/motion_tubes", **config), robot),
    )
    driver.reset(np.random.default_rng(0))
    view = simulator.reset(job, np.random.default_rng(0))
    poses, twists = [view.odometry], [view.twist]
    for _ in range(steps):
        before, view = view.twist, simulator.step(driver.act(view))
        assert abs(view.twist.v - before.v) <= robot.alpha_v * robot.dt + KERNEL
        assert abs(view.twist.omega - before.omega) <= robot.alpha_omega * robot.dt + KERNEL
        poses.append(view.odometry)
        twists.append(view.twist)
        if simulator.state.contact or simulator.state.arrived:
            break
    return np.array(poses), np.array(twists), simulator


@pytest.mark.parametrize("goal", [(2.0, 1.0), (0.1, 0.8), (-3.0, 0.5)])
@pytest.mark.parametrize("name", SHIPPED)
def test_motion_tubes_reach_goals_on_all_sides_without_circling_them(name, goal):
    robot = shipped(name)
    poses, _, _ = drive(robot, task(goal=goal, goal_tolerance=1e-9), round(20 / robot.dt))
    away = np.hypot(*(poses[:, :2] - goal).T)
    assert away[-1] < 0.06
    near = np.flatnonzero(away < 0.2)[0]
    assert away[near:].max() < 0.25


def test_a_goal_in_front_of_a_wall_is_reached_slowly():
    wall = World(segments=np.array([[4.4, -3.0, 4.4, 3.0]]))
    poses, twists, _ = drive(JACKAL, task(wall, goal=(4.0, 0.0), goal_tolerance=0.15), 300)
    assert math.dist(poses[-1, :2], (4.0, 0.0)) < 0.16
    assert abs(twists[-1, 0]) < 0.26


def test_fewer_free_tubes_are_driven_slower():
    corridor = World(segments=np.array([[-2.0, s * 0.32, 8.0, s * 0.32] for s in (1, -1)]))
    _, narrow, _ = drive(JACKAL, task(corridor, goal=(6.0, 0.0)), 60)
    corridor = World(segments=np.array([[-2.0, s * 1.3, 8.0, s * 1.3] for s in (1, -1)]))
    _, wide, _ = drive(JACKAL, task(corridor, goal=(6.0, 0.0)), 60)
    _, free, _ = drive(JACKAL, task(goal=(6.0, 0.0)), 60)
    fastest = [twists[:, 0].max() for twists in (narrow, wide, free)]
    assert fastest == pytest.approx([0.25, 1.0, 1.75], abs=KERNEL)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_robot_slower_than_its_tubes_keeps_to_their_arcs(name):
    robot = shipped(name)
    planner = MotionTubes(load_settings("planner/motion_tubes", acceleration=50.0), robot)
    for bearing in (0.16, -0.2, 0.25):
        planner.reset(np.random.default_rng(0))
        target = 4.0 * np.array([math.cos(bearing), math.sin(bearing)])
        command = planner.plan(observation(target, None, Twist(robot.v_max, 0.0), robot), Guidance(target))
        steps = np.array([2.0, 0.9, 0.25])[:, None]
        headings = command.omega / command.v * steps / math.radians(0.5)
        assert np.abs(headings - np.rint(headings)).min() < 1e-6
        assert np.sign(command.omega) == np.sign(bearing)


@given(st.integers(0, 10**6), st.floats(-0.5, 1.0), st.floats(-1.5, 1.5))
def test_motion_tubes_can_stop_after_every_command(seed, v, omega):
    robot = stage()  # sees all around
    circles = scattered(seed, 8, low=-0.1, high=1.0)
    lidar = robot.lidar
    angles = (lidar.angle_min, lidar.angle_increment, lidar.num_beams)
    ranges = cast_shapes(lidar.mount, angles, lidar.range_max, circles, NO_EDGES)
    now = Twist(max(v, -0.5) / 2, omega)

    def stops(command):
        simulator = FastSimulator(load_settings("sim/fast"), robot)
        simulator.reset(task(World(circles=circles), goal=(90.0, 0.0)), np.random.default_rng(0))
        simulator.state = simulator.state._replace(twist=now)
        for twist in (command, *[Twist(0.0, 0.0)] * 5):
            simulator.step(twist)
            if simulator.state.contact:
                return False
        return True

    planner = MotionTubes(load_settings("planner/motion_tubes", heading_step=COARSE), robot)
    planner.reset(np.random.default_rng(0))
    view = observation((3.0, 1.0), ranges, now, robot)
    for _ in range(3):  # into recovery, too
        command = planner.plan(view, Guidance(view.target))
        assert stops(command) or not stops(Twist(0.0, 0.0))


def test_motion_tubes_follow_the_path_and_not_the_subgoal():
    points = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
    poses, _, end = drive(JACKAL, task(goal=(0.0, 2.0), goal_tolerance=0.3), 300, ByPath(points))
    assert end.state.arrived
    assert np.hypot(*(poses[:, :2] - (2.0, 0.0)).T).min() < 1.0  # by the corners, within what a tube may miss
    assert poses[:, 0].max() > 1.2


def test_motion_tubes_turn_on_the_spot_towards_a_path_that_leads_back():
    poses, twists, end = drive(JACKAL, task(goal=(-3.0, 0.5), goal_tolerance=0.2), 200)
    assert end.state.arrived
    turning = np.abs(twists[:, 1]) > 0.5
    assert np.abs(poses[turning][:10, :2]).max() < 0.05
    assert np.abs(twists[turning][:, 1]).max() <= 1.0 + KERNEL


def test_motion_tubes_back_out_where_the_robot_cannot_turn():
    # A dead end too narrow to turn in, which takes 0.26 m each way, and the goal outside.
    half = 0.23
    corridor = World(
        segments=np.array([[0.0, half, 3.0, half], [0.0, -half, 3.0, -half], [3.0, -half, 3.0, half]])
    )

    class InAndOut(ByPath):
        """Towards the end of the corridor; from 1.8 m inside, out of it to the goal."""

        _out = False

        def guide(self, observation):
            if observation.odometry.x > 2.8 and not self._out:
                self._out = True
                self.lead([(2.8, 0.0), (0.0, 0.0), (0.0, 2.0)])
            return super().guide(observation)

    job = task(corridor, start=Pose(-1.0, 0.0, 0.0), goal=(-1.0, 2.0), goal_tolerance=0.3)
    guide = InAndOut([(0.0, 0.0), (4.0, 0.0)])
    poses, twists, end = drive(JACKAL, job, 600, guide, side_margin=0.02, front_margin=0.05)
    assert poses[:, 0].max() > 2.0  # it went in
    assert twists[:, 0].min() < -0.3  # and out backwards
    assert end.state.arrived


def test_motion_tubes_do_not_back_into_unseen_space():
    # A wall behind, in the blind arc, and one ahead; sides too near to turn.
    walls = np.array([[0.35, -0.3, 0.35, 0.3], [-0.3, -0.3, -0.3, 0.3], [-0.3, 0.3, 0.35, 0.3]])
    walls = np.vstack((walls, walls[2] * (1.0, -1.0, 1.0, -1.0)))
    poses, _, end = drive(JACKAL, task(World(segments=walls), goal=(-4.0, 0.0)), 100)
    assert not end.state.contact
    assert np.abs(poses[:, :2]).max() < 0.02


def test_motion_tubes_remember_obstacles_out_of_sight():
    # A post beside the rear: seen in passing, hidden when the goal asks for a turn on the spot.
    post = World(circles=np.array([[1.6, 0.27, 0.05], [1.6, -0.27, 0.05], [2.5, 0.0, 0.1]]))
    _, _, end = drive(
        JACKAL, task(post, goal=(-4.0, 1.0)), 300, ByPath([(0.0, 0.0), (1.9, 0.0), (-4.0, 1.0)])
    )
    assert not end.state.contact


def test_a_disc_turns_where_a_rectangle_would_not():
    box = room(0.54)  # the rectangle's corners are 0.258 m off its centre
    disc, rectangle = stage(), stage(footprint=Footprint(length=0.42, width=0.3))
    for robot, turns in ((disc, True), (rectangle, False)):
        poses, _, end = drive(robot, task(box, goal=(-4.0, 0.1)), 60)
        assert not end.state.contact
        assert (np.abs(poses[:, 2]).max() > 1.0) == turns
