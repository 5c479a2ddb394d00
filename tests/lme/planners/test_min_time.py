"""Minimum-time arcs: safe by small steps, fast in the open, at rest where enclosed, and ahead of its own latency."""

import math
from collections import deque
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.geometry.collision import sweep
from lme.geometry.frames import to_robot
from lme.geometry.motion import drive as moved_by
from lme.planners.min_time.planner import MinTime
from lme.simulation.fast import FastSimulator
from lme.types import Guidance, Outcome, Pose, Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import observation, shipped, stage, task, without_errors
from tests.lme.planners.drives import drive
from tests.tolerances import KERNEL

JACKAL = without_errors(shipped("jackal"))
ROBOTS = [JACKAL, stage()]
NOTHING, NO_EDGES, NOBODY = np.empty((0, 2)), np.empty((0, 4)), np.empty((0, 4))
STEP = 0.01  # [m] between two poses of the slow sweep


def made(robot=JACKAL, **config):
    return MinTime(load_settings("planner/min_time", **config), robot)


def ring(radius, count=90):
    turn = np.linspace(0.0, 2 * math.pi, count, endpoint=False)
    return radius * np.column_stack((np.cos(turn), np.sin(turn)))


def moved(robot, pose, twist, command):
    """Poses on the way, and pose and twist a period later."""
    way, after = moved_by(
        pose, twist, command, robot.limits[:4], robot.dt, STEP, robot.footprint.circumscribed_radius
    )
    return way, Pose(*way[-1].tolist()), Twist(*after)


def touches(robot, way, points):
    return sweep(way, robot.footprint.box, np.column_stack((points, np.zeros(len(points)))), NO_EDGES)[1] >= 0


def asked(planner, robot, pose, twist, subgoal, points, blocked=False):
    """The planner's command at a pose among points in the world."""
    guidance = Guidance(to_robot(subgoal, pose), None, False, blocked, to_robot(points, pose))
    return planner.plan(observation(guidance.subgoal, twist=twist, robot=robot), guidance)


def follow(planner, robot, subgoal, points=NOTHING, steps=40, delay=0, blocked=False):
    """Commands, twists before them and all poses, with commands that take effect `delay` periods later."""
    pose, twist, subgoal = Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), np.asarray(subgoal, dtype=float)
    under_way = deque([Twist(0.0, 0.0)] * delay)
    commands, twists, ways = [], [], []
    for _ in range(steps):
        twists.append(twist)
        commands.append(asked(planner, robot, pose, twist, subgoal, points, blocked))
        under_way.append(commands[-1])
        way, pose, twist = moved(robot, pose, twist, under_way.popleft())
        ways.append(way)
    return np.array(commands), np.array(twists), ways


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
@settings(max_examples=15)
@given(st.integers(0, 10**6))
def test_min_time_touches_nothing_and_can_always_stop(robot, seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-3.0, 3.0, (25, 2))
    points = points[np.hypot(*points.T) > robot.footprint.circumscribed_radius + 0.1]
    commands, twists, ways = follow(made(robot), robot, rng.uniform(-3.0, 3.0, 2), points, 30)
    for (v, omega), way in zip([*twists[1:], (0.0, 0.0)], ways, strict=True):
        assert not touches(robot, way, points)
        pose, twist = Pose(*way[-1].tolist()), Twist(v, omega)
        for _ in range(math.ceil(robot.v_max / robot.alpha_v / robot.dt) + 1):
            braking, pose, twist = moved(robot, pose, twist, Twist(0.0, 0.0))
            assert not touches(robot, braking, points)
    assert np.abs(commands[:, 0]).max() <= robot.v_max + KERNEL
    assert np.abs(commands[:, 1]).max() <= robot.omega_max + KERNEL
    change = np.abs(commands - twists).max(axis=0)
    assert change[0] <= robot.alpha_v * robot.dt + KERNEL
    assert change[1] <= robot.alpha_omega * robot.dt + KERNEL


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_min_time_drives_straight_at_full_speed_in_the_open(robot):
    commands, _, ways = follow(made(robot), robot, (50.0, 0.0))
    assert commands[-1] == pytest.approx([robot.v_max, 0.0], abs=KERNEL)
    assert np.abs(ways[-1][:, 1]).max() <= KERNEL
    speeding = math.ceil(robot.v_max / (robot.alpha_v * robot.dt))
    assert commands[speeding - 1 :, 0].min() == pytest.approx(robot.v_max, abs=KERNEL)


def test_min_time_turns_to_a_subgoal_behind():
    _, _, ways = follow(made(), JACKAL, (-3.0, 0.5), steps=60)
    assert np.hypot(*(np.concatenate(ways)[:, :2] - (-3.0, 0.5)).T).min() < 0.2


def test_min_time_stands_when_enclosed():
    points = ring(JACKAL.footprint.circumscribed_radius + 0.005)
    commands, _, ways = follow(made(), JACKAL, (3.0, 0.0), points, 5)
    assert np.abs(commands[:, 0]).max() == 0.0
    assert not any(touches(JACKAL, way, points) for way in ways)


def wedge():
    """A wall at the Jackal's front and sides, nearer than any margin; free behind."""
    half_length, half_width, _ = JACKAL.footprint.box
    along = np.linspace(-half_length, half_length, 15)
    sides = [np.column_stack((along, np.full(15, side * (half_width + 0.01)))) for side in (-1, 1)]
    front = np.column_stack((np.full(15, half_length + 0.01), np.linspace(-half_width, half_width, 15)))
    return np.concatenate((*sides, front))


def test_min_time_backs_up_as_far_as_configured_when_stuck():
    _, _, ways = follow(made(), JACKAL, (3.0, 0.0), wedge(), 4, blocked=True)
    track = np.concatenate(ways)
    assert track[-1, 0] < -0.1
    assert np.abs(track[:, 1]).max() <= KERNEL
    assert not touches(JACKAL, track, wedge())
    commands, _, _ = follow(made(), JACKAL, (3.0, 0.0), wedge(), 4, blocked=False)
    assert commands[:, 0].min() >= 0.0


def test_min_time_backs_up_once_in_a_while_where_it_stands_although_the_guide_has_a_way():
    commands, _, ways = follow(made(), JACKAL, (3.0, 0.0), wedge(), 30)
    backwards = np.flatnonzero(commands[:, 0] < 0.0)
    assert round(1.0 / JACKAL.dt) <= backwards[0] <= round(1.0 / JACKAL.dt) + 2
    assert not touches(JACKAL, np.concatenate(ways), wedge())


def front():
    """A wall at the Jackal's front, nearer than any margin; free behind and beside."""
    half_length, half_width, _ = JACKAL.footprint.box
    return np.column_stack((np.full(15, half_length + 0.01), np.linspace(-half_width, half_width, 15)))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_min_time_backs_up_on_an_arc_where_something_is_behind(side):
    half_length, half_width, _ = JACKAL.footprint.box
    points = np.concatenate((front(), [[-half_length - 0.14, side * (half_width - 0.02)]]))
    commands, _, ways = follow(made(), JACKAL, (-3.0, -side * 1.0), points, 3, blocked=True)
    assert commands[0, 0] < 0.0
    assert side * commands[0, 1] > 0.0  # backwards, a turn to a side swings the rear to the other
    track = np.concatenate(ways)
    assert not touches(JACKAL, track, points)
    assert side * track[-1, 1] < 0.0


def test_min_time_backs_up_where_it_could_only_turn_but_not_again_within_a_second():
    commands, _, _ = follow(made(), JACKAL, (3.0, 0.0), front(), 40, blocked=True)
    backwards = commands[:, 0] < 0.0
    assert backwards[0]
    begins = np.flatnonzero(backwards & ~np.append(False, backwards[:-1]))
    ends = np.flatnonzero(backwards & ~np.append(backwards[1:], False))
    assert len(begins) > 1
    assert (begins[1:] - ends[:-1]).min() * JACKAL.dt > 1.0


@pytest.mark.parametrize(("v_min", "slowest"), [(-0.2, -0.2), (0.0, 0.0)])
def test_min_time_backs_up_only_as_the_robot_can(v_min, slowest):
    robot = replace(JACKAL, v_min=v_min)
    commands, _, _ = follow(made(robot), robot, (3.0, 0.0), wedge(), 4, blocked=True)
    assert commands[:, 0].min() == slowest


def test_without_backing_up_min_time_never_does():
    commands, _, _ = follow(made(parts={"backing_up": False}), JACKAL, (3.0, 0.0), wedge(), 20, blocked=True)
    assert commands[:, 0].min() >= 0.0


@pytest.mark.parametrize(("way", "person"), [(True, False), (False, False), (True, True)])
def test_min_time_makes_a_multi_point_turn_if_the_guide_tells_the_way_and_nobody_is_near(way, person):
    planner = made(parts={"backing_up": False})
    people = np.array([[1.0, 0.0, 0.0, 0.0]]) if person else NOBODY
    guidance = Guidance(np.array([3.0, 0.0]), blocked=True, points=wedge())
    guidance = guidance._replace(way=np.array([[-0.5, 0.0], [-1.0, 0.0]]) if way else None)
    view = observation(guidance.subgoal, robot=JACKAL)._replace(pedestrians=people)
    commands = np.array([planner.plan(view, guidance) for _ in range(round(2.5 / JACKAL.dt))])
    assert commands[: round(1.9 / JACKAL.dt), 0].min() >= 0.0
    assert (commands[-1, 0] < 0.0) == (way and not person)


def test_min_time_backs_up_neither_into_obstacles_nor_into_the_unknown():
    behind = np.array([[-JACKAL.footprint.box[0] - 0.02, 0.0]])
    points = np.concatenate((wedge(), behind))
    commands, _, _ = follow(made(), JACKAL, (3.0, 0.0), points, 4, blocked=True)
    assert commands[:, 0].min() >= 0.0
    near = np.full(JACKAL.lidar.num_beams, 0.2, dtype=np.float32)  # a scan with a blind arc alone
    command = made().plan(
        observation(ranges=near, robot=JACKAL), Guidance(np.array([3.0, 0.0]), blocked=True)
    )
    assert command.v >= 0.0


def test_min_time_backs_up_with_a_turn_that_it_can_brake():
    """From 1.5 rad/s at 1 rad/s² the robot turns on by 1.1 rad, past a subgoal to which .4 rad are left."""
    robot = replace(JACKAL, alpha_omega=1.0)
    planner, limits = made(robot), robot.limits
    rates = np.array([0.5, 1.5])
    times = planner._times_back(0.2, rates, 5.0 * np.array([math.cos(0.8), math.sin(0.8)]), limits)
    assert times[0] < times[1]


AGILE = stage(
    omega_max=4.0, alpha_omega=25.0, control_rate=10.0
)  # a disc, so that it can turn beside any point


def first_turn(points=NOTHING, people=NOBODY, robot=AGILE, **config):
    """By how much the turn rate is asked to change, per second, for a subgoal beside a robot at rest [rad/s²]."""
    seen = observation((0.0, 3.0), robot=robot)._replace(pedestrians=people)
    command = made(robot, **config).plan(seen, Guidance(np.array([0.0, 3.0]), points=points))
    return command.omega / robot.dt


def test_min_time_turns_calmly_in_the_open_and_with_all_it_has_near_obstacles_and_people():
    behind = AGILE.footprint.circumscribed_radius + np.array([0.14, 0.16])
    assert first_turn() == pytest.approx(10.0, abs=KERNEL)
    assert first_turn(np.array([[-behind[1], 0.0]])) == pytest.approx(10.0, abs=KERNEL)
    assert first_turn(np.array([[-behind[0], 0.0]])) > 15.0
    assert first_turn(people=np.array([[-6.0, 0.0, 0.1, 0.0]])) > 15.0
    assert first_turn(parts={"calm": False}) > 15.0
    assert first_turn(robot=stage(alpha_omega=5.0)) == pytest.approx(5.0, abs=KERNEL)


def test_min_time_asks_a_drive_that_lags_behind_for_more_and_more():
    """It still stands when it has asked: by .1 s · 10 rad/s² more each time, and in all for .1 s · 25 rad/s²."""
    planner, still = made(AGILE), observation((0.0, 3.0), robot=AGILE)
    guidance = Guidance(np.array([0.0, 3.0]), points=NOTHING)
    asked = [planner.plan(still, guidance).omega for _ in range(4)]
    assert asked == pytest.approx([1.0, 2.0, 2.5, 2.5], abs=KERNEL)


@pytest.mark.parametrize("delay", [1, 3])
def test_a_known_latency_gives_the_command_of_the_predicted_pose(delay):
    # The robot stands for `delay` periods; from then on everything is as without latency, `delay` periods later.
    points = np.array([[1.5, 0.4], [2.5, -0.5]])
    late, _, late_ways = follow(
        made(latency=delay * JACKAL.dt), JACKAL, (4.0, 1.0), points, 30 + delay, delay=delay
    )
    prompt, _, ways = follow(made(), JACKAL, (4.0, 1.0), points, 30)
    assert late[:30] == pytest.approx(prompt, abs=1e-6)
    assert np.concatenate(late_ways[delay:]) == pytest.approx(np.concatenate(ways), abs=1e-6)


class Untracked(MinTime):
    """The same planner without a tracker: people are scan points."""

    def plan(self, observation, guidance):
        return super().plan(observation._replace(pedestrians=np.empty((0, 4))), guidance)


def crossing(planner, late, speed=1.0):
    """An episode in which a person crosses the robot's way, `late` [s] after a robot at full speed is there.

    Also the person's y when the robot passes: positive if the robot passes before the person.
    """
    start = speed * (4.0 / JACKAL.v_max + late)
    person = Mover(path=np.array([[4.0, start], [4.0, start - 10.0]]), radius=0.3, speed=speed)
    made = planner(load_settings("planner/min_time"), JACKAL)
    episode = drive(made, JACKAL, World(movers=(person,)), goal=(8.0, 0.0))
    track = episode.trajectory
    return episode, start - speed * track[np.argmax(track[:, 1] > 4.0), 0]


@pytest.mark.parametrize("late", [-0.5, 0.0, 0.25, 0.5])
def test_min_time_passes_a_crossing_person_and_stays_in_motion(late):
    episode, _ = crossing(MinTime, late)
    assert episode.outcome is Outcome.SUCCESS
    assert episode.trajectory[3:, 4].min() > 0.2


def test_min_time_passes_before_or_behind_a_person():
    hurries, waits = crossing(MinTime, 0.75)[1], crossing(MinTime, -0.25)[1]
    assert waits < -0.3 < 0.3 < hurries


def test_without_a_tracker_a_person_walks_into_the_robot():
    assert crossing(Untracked, 0.5)[0].outcome is Outcome.COLLISION
    assert crossing(MinTime, 0.5)[0].outcome is Outcome.SUCCESS


def stand(planner, side):
    """Distances from its place, while a person comes from a side and walks through that place; whether they touch."""
    person = Mover(path=np.array([[0.0, 3.0 * side], [0.0, -5.0 * side]]), radius=0.3, speed=0.8)
    made, simulator = (
        planner(load_settings("planner/min_time"), JACKAL),
        FastSimulator(load_settings("sim/fast"), JACKAL),
    )
    seen = simulator.reset(task(World(movers=(person,)), goal=(50.0, 0.0)), np.random.default_rng(0))
    away = []
    for _ in range(60):
        at_its_place = Guidance(to_robot(np.zeros(2), simulator.state.pose))
        seen = simulator.step(made.plan(seen, at_its_place))
        away.append(math.hypot(*simulator.state.pose[:2]))
        if simulator.state.contact:
            break
    return away, simulator.state.contact


@pytest.mark.parametrize("side", [1, -1])
def test_min_time_at_rest_moves_out_of_a_persons_way_and_comes_back(side):
    away, touched = stand(MinTime, side)
    assert not touched
    assert max(away) > 0.5 > 0.1 > away[-1]
    assert stand(Untracked, side)[1]


WALL_AHEAD = np.column_stack((np.full(41, 1.0), np.linspace(-1.0, 1.0, 41)))


def before_a_wall(settling_time, v=0.5, measured=0.5):
    """The speed asked for at `v` [m/s], 0.8 m before a wall, of a robot that moves with `measured`."""
    robot = stage(settling_time=settling_time)
    seen = observation((0.95, 0.0), twist=Twist(measured, 0.0), robot=robot)
    seen = seen._replace(last_command=Twist(v, 0.0))
    return made(robot).plan(seen, Guidance(np.array([0.95, 0.0]), points=WALL_AHEAD)).v


def test_a_robot_that_settles_late_slows_down_earlier():
    speeds = [before_a_wall(time) for time in (0.0, 0.3, 0.8, 1.2)]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] > speeds[-1]


def test_a_robot_that_settles_late_drives_slower_between_walls():
    """The margin at speed grows with half the settling time, where that is more than `margin_time`."""

    def between_walls(settling_time):
        robot = stage(settling_time=settling_time)
        margins = 0.05 + 0.075  # [m] at rest, and at 0.75 m/s with 0.1 s
        half_width = robot.footprint.inscribed_radius + margins
        x = np.linspace(-1.0, 3.0, 161)
        walls = np.column_stack((np.tile(x, 2), np.repeat([half_width, -half_width], len(x))))
        seen = observation((2.9, 0.0), twist=Twist(0.45, 0.0), robot=robot)
        return made(robot).plan(seen, Guidance(np.array([2.9, 0.0]), points=walls)).v

    exact, barely, late = between_walls(0.0), between_walls(0.2), between_walls(0.4)
    assert exact == barely > late


def test_one_that_exceeds_its_command_is_taken_to_be_farther_on():
    assert before_a_wall(0.8, measured=0.9) < before_a_wall(0.8)
    assert before_a_wall(0.8, measured=0.1) == before_a_wall(0.8)  # to be slower gives no room
    assert before_a_wall(0.0, measured=0.5) == before_a_wall(0.0, measured=0.1)
