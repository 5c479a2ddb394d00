"""When a multi-point turn begins, how its strokes are driven, and where it ends."""

import math

import numpy as np
import pytest

from lme.geometry.collision import sweep
from lme.geometry.frames import to_robot
from lme.geometry.motion import drive
from lme.planners.min_time.multi_point_turn import MultiPointTurn
from lme.robots import reachable
from lme.types import Limits, Pose, Twist
from tests.lme.planners.min_time.test_multi_point_turn_search import LONG, dead_end, pocket

LIMITS = Limits(v_max=0.66, omega_max=1.0, alpha_v=1.0, alpha_omega=2.0)
DT, MARGIN = 0.125, 0.05
ROOM = LONG.circumscribed_radius + 2.0 * MARGIN
BACK = np.column_stack((-0.45 * np.arange(1, 12), np.zeros(11)))  # a way back along −x
DOWN = np.ascontiguousarray(BACK[:, ::-1])  # along −y
STILL, NO_WAY = Twist(0.0, 0.0), np.empty((0, 2))


def turn():
    return MultiPointTurn(LONG, DT, MARGIN)


def follow(points, way, steps=400, limits=LIMITS, appears=None, lag=0.0, noise=0.0):
    """Commands from being stuck until no turn is under way, and all poses.

    appears: points from step 40 on. lag: unknown time constant of the drive [s]; noise: of the odometry [m/s, rad/s].
    """
    rng, share = np.random.default_rng(0), 1.0 - math.exp(-DT / lag) if lag else 1.0
    made, pose, twist = turn(), Pose(0.0, 0.0, 0.0), STILL
    commands, poses = [], []
    for k in range(steps):
        points = np.concatenate((points, appears)) if k == 40 and appears is not None else points
        on = way[np.hypot(*(way - pose[:2]).T).argmin() :]  # a guide's way begins at the robot
        odometry = Twist(*rng.normal(twist, noise))
        command = made.command(True, to_robot(points, pose), to_robot(on, pose), odometry, limits)
        if command is None and commands:
            break
        if command is not None:
            commands.append(reachable(*command, twist, limits, DT))
            reached = np.add(twist, share * np.subtract(commands[-1], twist))
            driven, twist = drive(
                pose, twist, (*reached,), limits.bounds, DT, 0.01, LONG.circumscribed_radius
            )
            poses.extend(driven)
            pose, twist = Pose(*driven[-1].tolist()), Twist(*twist)
    return commands, np.array(poses)


def touches(poses, points):
    return sweep(poses, LONG.box, np.column_stack((points, np.zeros(len(points)))), np.empty((0, 4)))[1] >= 0


@pytest.mark.parametrize(("half", "depth"), [(0.43, 0.35), (0.46, 0.3)])
def test_strokes_lead_out_of_a_pocket_and_the_robot_turns_to_the_way(half, depth):
    points = np.add(pocket(half, depth), [0.02, 0.0])
    commands, poses = follow(points, DOWN)
    assert not touches(poses, points)
    assert all(command.v == 0.0 or command.omega == 0.0 for command in commands)
    assert np.hypot(*(points - poses[-1, :2]).T).min() >= ROOM - 0.02
    assert math.remainder(poses[-1, 2] + math.pi / 2, 2.0 * math.pi) == pytest.approx(0.0, abs=0.15)


def test_where_no_room_is_near_the_robot_goes_back_along_the_way_until_there_is():
    points = dead_end(4.0)
    _, poses = follow(points, BACK)
    assert not touches(poses, points)
    assert poses[-1, 0] < -4.0
    assert abs(math.remainder(poses[-1, 2] - math.pi, 2.0 * math.pi)) < 0.1


@pytest.mark.parametrize(("lag", "noise"), [(0.2, 0.0), (0.5, 0.0), (0.0, 0.005), (0.2, 0.005)])
def test_strokes_end_though_the_drive_lags_behind_and_its_odometry_is_noisy(lag, noise):
    exact, _ = follow(dead_end(0.6), BACK)
    commands, poses = follow(dead_end(0.6), BACK, lag=lag, noise=noise)
    assert len(commands) < 2 * len(exact)
    assert not touches(poses, dead_end(0.6))
    assert abs(math.remainder(poses[-1, 2] - math.pi, 2.0 * math.pi)) < 0.3


def test_a_point_that_turns_up_on_a_stroke_changes_the_way():
    blind = dead_end(0.6)
    post = np.array([[-1.35, 0.0]])
    _, poses = follow(blind, BACK, appears=post)
    assert not touches(poses, np.concatenate((blind, post)))
    straight = all(abs(y) < 0.01 for y in poses[:, 1])
    assert not straight
    assert poses[-1, 0] < -1.0


def test_a_robot_that_cannot_back_up_is_asked_for_nothing_in_a_dead_end():
    commands, _ = follow(dead_end(0.5), BACK, limits=LIMITS._replace(v_min=0.0))
    assert commands == []


def test_a_turn_begins_after_the_time_without_a_free_way():
    made = turn()
    asked = [made.command(True, dead_end(0.5), BACK, STILL, LIMITS) for _ in range(20)]
    assert [command is None for command in asked] == [True] * 16 + [False] * 4
    made.reset()
    assert made.command(True, dead_end(0.5), BACK, STILL, LIMITS) is None


def test_time_with_a_free_way_counts_against_it():
    made = turn()
    free_half_of_it = [made.command(k % 2 == 0, dead_end(0.5), BACK, STILL, LIMITS) for k in range(200)]
    assert free_half_of_it == [None] * 200
    for _ in range(12):
        for blocked in (True, True, False):
            command = made.command(blocked, dead_end(0.5), BACK, STILL, LIMITS)
    assert command is None
    for _ in range(4):
        for blocked in (True, True, False):
            command = command or made.command(blocked, dead_end(0.5), BACK, STILL, LIMITS)
    assert command is not None


def test_a_moving_robot_first_comes_to_rest():
    made = turn()
    asked = [made.command(True, dead_end(0.5), BACK, Twist(0.2, 0.0), LIMITS) for _ in range(18)]
    assert asked[-1] == STILL
    assert made.command(True, dead_end(0.5), BACK, STILL, LIMITS).v < 0.0


def test_without_a_way_there_is_no_last_turn():
    found = []
    for way in (NO_WAY, DOWN):
        made = turn()
        for _ in range(20):
            made.command(True, pocket(0.46, 0.45), way, STILL, LIMITS)
        found.append(list(made._strokes))
    assert found[0]
    assert found[1][:-1] == found[0]


def commands_of(blocked, twist, seconds=60.0):
    """Commands to a robot in a dead end that is not blocked any more after 3 s, as its odometry tells `twist`."""
    made = turn()
    return [
        made.command(blocked or k * DT < 3.0, dead_end(0.5), BACK, twist, LIMITS)
        for k in range(round(seconds / DT))
    ]


def test_a_robot_that_does_not_move_is_asked_for_something_else_in_the_end():
    commands = commands_of(False, STILL)
    assert commands[20].v < 0.0
    assert commands[-1] is None


def test_a_robot_whose_odometry_never_tells_that_it_stands_turns_all_the_same():
    commands = commands_of(True, Twist(0.0, 0.06))
    assert sum(command is not None and command.v < 0.0 for command in commands) > 40


def test_a_robot_that_may_not_back_up_any_more_gives_up():
    made, limits = turn(), LIMITS
    for k in range(400):
        command = made.command(True, dead_end(0.5), BACK, STILL, limits)
        limits = LIMITS._replace(v_min=0.0) if k > 20 else LIMITS
    assert command is None


def test_a_robot_that_may_not_move_is_asked_for_nothing_and_gives_up():
    made, halted = turn(), LIMITS._replace(v_max=0.0, omega_max=0.0)
    commands = [made.command(k * DT < 3.0, pocket(0.46, 0.45), DOWN, STILL, halted) for k in range(2000)]
    assert {command for command in commands if command is not None} == {STILL}
    assert commands[-1] is None


def test_reset_ends_a_turn():
    made = turn()
    for _ in range(20):
        made.command(True, dead_end(0.5), BACK, STILL, LIMITS)
    made.reset()
    assert made.command(True, dead_end(0.5), BACK, STILL, LIMITS) is None
