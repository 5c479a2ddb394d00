"""TangentBug: where it sends the robot, what it remembers, and that it arrives."""

import math

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.geometry.frames import to_world
from lme.guides.tangent_bug.guide import Mode, TangentBug
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Pose
from lme.worlds.world import World
from tests.builders import SHIPPED, room, shipped, stage, task

FAR = stage().lidar.range_max
U = [[1.0, -1.0, 3.0, -1.0], [3.0, -1.0, 3.0, 1.0], [3.0, 1.0, 1.0, 1.0]]  # 2 × 2 m, open towards −x


def walls(*segments):
    return World(segments=np.array(segments, dtype=float))


def look(world, start=Pose(0.0, 0.0, 0.0), goal=(6.0, 0.0), robot=None):  # noqa: B008
    """What a robot at the start sees, and a guide that has not seen anything yet."""
    robot = robot or stage()
    seen = FastSimulator(load_settings("sim/fast"), robot).reset(
        task(world, start, goal), np.random.default_rng(0)
    )
    return TangentBug(load_settings("guide/tangent_bug"), robot), seen


def drive(world, start=Pose(0.0, 0.0, 0.0), goal=(6.0, 0.0), seconds=120.0, robot=None, **config):  # noqa: B008
    robot = robot or stage()
    guide = TangentBug(load_settings("guide/tangent_bug", **config), robot)
    modes = []
    act = guide.guide

    def noted(seen):
        guidance = act(seen)
        modes.append(guide._mode)
        return guidance

    guide.guide = noted
    navigator = Navigator(guide, Simple(load_settings("planner/simple"), robot))
    job = task(world, start, goal, time_limit=seconds)
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    return run_episode(job, navigator, simulator, np.random.default_rng(0)), modes


def test_the_target_where_nothing_is_in_the_way():
    guide, seen = look(walls([3.0, 0.5, 3.0, 4.0]))
    guidance = guide.guide(seen)
    assert guidance.subgoal.tolist() == seen.target.tolist()
    assert not guidance.blocked


def test_the_nearer_end_of_a_wall_with_room_for_the_robot():
    # The end (3, 1) is passed at r + margin = 0.3 m, and the place lies 0.3 m beyond it.
    guide, seen = look(walls([3.0, -4.0, 3.0, 1.0]))
    place = guide.guide(seen).subgoal
    tangent = math.sqrt(10.0 - 0.09)
    assert math.hypot(*place) == pytest.approx(tangent + 0.3, abs=0.05)
    assert math.atan2(place[1], place[0]) == pytest.approx(
        math.atan2(1, 3) + math.asin(0.3 / math.sqrt(10)), abs=0.03
    )


def test_a_gap_too_narrow_for_the_robot_is_none():
    guide, seen = look(walls([3.0, -4.0, 3.0, -0.25], [3.0, 0.25, 3.0, 2.0]))
    assert guide.guide(seen).subgoal[1] > 2.0


def test_an_end_taken_is_kept_unless_the_other_is_clearly_shorter():
    guide, seen = look(walls([3.0, -1.1, 3.0, 1.0]))
    assert guide.guide(seen).subgoal[1] > 0.0
    other = look(walls([3.0, -1.0, 3.0, 1.1]))[1]
    assert guide.guide(other).subgoal[1] > 0.0
    much = look(walls([3.0, -0.5, 3.0, 2.0]))[1]
    assert guide.guide(much).subgoal[1] < 0.0


def test_in_a_u_both_ends_lead_away_so_it_follows_and_remembers_how_near_the_wall_is():
    guide, seen = look(walls(*U), start=Pose(2.0, 0.3, 0.0))
    guidance = guide.guide(seen)
    assert guidance.switched
    assert guide._mode is Mode.FOLLOW
    assert guide._side == 1
    assert guidance.subgoal[0] < 0.0
    assert guide._nearest == pytest.approx(6.0 - 2.7, abs=0.05)


def test_a_boundary_is_left_only_for_a_place_nearer_to_the_target():
    _, modes = drive(walls(*U), start=Pose(2.0, 0.3, 0.0))
    first_leave = modes.index(Mode.LEAVE)
    assert modes[0] is Mode.FOLLOW
    assert set(modes[:first_leave]) == {Mode.FOLLOW}
    assert modes[-1] is Mode.TOWARD


def test_the_target_in_a_pocket_is_entered_at_its_mouth():
    episode, _ = drive(walls(*U), start=Pose(2.0, 3.0, -1.5), goal=(2.0, 0.0), seconds=60.0)
    assert episode.outcome is Outcome.SUCCESS


def spiral():
    """The only way out of the room is a corridor that first leads away from the target."""
    return walls(
        [1.0, 1.5, 1.0, -1.5], [1.0, -1.5, -2.0, -1.5], [-2.0, -1.5, -2.0, 3.0], [-2.0, 3.0, 2.5, 3.0],
        [2.5, 3.0, 2.5, -3.0], [1.0, 1.5, -1.0, 1.5],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("world", "start"),
    [
        (walls(*U), Pose(-1.0, 0.0, 0.0)),
        (walls(*U), Pose(2.0, 0.0, 0.0)),
        (walls([3.0, -2.0, 3.0, 2.0]), Pose(0.0, 0.0, 0.3)),
        (spiral(), Pose(0.0, 0.0, 0.0)),
        (World(circles=np.array([[3.0, 0.0, 1.5]])), Pose(0.0, 0.0, 0.0)),
        (walls([-2.0, 3.0, 8.0, 3.0], *U), Pose(2.5, 0.0, 3.0)),
    ],
)
@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_tangent_bug_leaves_traps(world, start, turned):
    mirror = np.array([1.0, turned, 1.0, turned])
    world = World(world.circles * [1.0, turned, 1.0], world.segments * mirror)
    start = Pose(start.x, turned * start.y, turned * start.yaw)
    episode, _ = drive(world, start)
    assert episode.outcome is Outcome.SUCCESS
    assert episode.min_clearance > 0.02


def test_a_door_that_is_nowhere_in_sight_is_found_along_the_wall():
    """Seen from the start its jambs overlap, so the room looks closed all round."""
    # Door 0.7 m wide, in the wall between robot and target, 3.5 m aside.
    hall = walls([-2, -5, -2, 5], [-2, 5, 2, 5], [-2, -5, 2, -5], [2, -5, 2, 3.5], [2, 4.2, 2, 5])
    guide, seen = look(hall)
    assert guide.guide(seen).subgoal == pytest.approx([1.7, 0.0], abs=0.02)  # up to the wall first
    assert guide._mode is Mode.FOLLOW
    assert drive(hall)[0].outcome is Outcome.SUCCESS


def test_a_target_that_cannot_be_reached_is_circled_without_contact():
    angles = np.linspace(0.0, math.tau, 13)
    corners = np.column_stack((3.0 + np.cos(angles), np.sin(angles)))
    episode, modes = drive(World(segments=np.hstack((corners[:-1], corners[1:]))), goal=(3.0, 0.0))
    assert episode.outcome is Outcome.TIMEOUT
    assert modes[-1] is Mode.FOLLOW
    assert episode.path_length > math.tau * 1.3
    assert episode.min_clearance > 0.05


@pytest.mark.parametrize("name", SHIPPED)
def test_every_robot_gets_round_a_wall_and_out_of_a_u(name):
    robot = shipped(name)
    for world, start in ((walls([3, -2, 3, 2]), Pose(0.0, 0.2, 0.2)), (walls(*U), Pose(-1.0, 0.2, 0.0))):
        assert drive(world, start, robot=robot)[0].outcome is Outcome.SUCCESS


def test_a_robot_that_is_closed_in_says_so_and_stands():
    guide, seen = look(room(0.9))
    guidance = guide.guide(seen)
    assert guidance.blocked
    assert guidance.subgoal.tolist() == [0.0, 0.0]


def test_a_wall_in_the_blind_arc_is_remembered():
    """Turned away from the wall, a robot that sees 270° still knows that the target behind it is hidden."""
    robot = shipped("jackal")
    world, goal = walls([2.0, -2.0, 2.0, 2.0]), (4.0, 0.0)
    guide, ahead = look(world, goal=goal, robot=robot)
    _, back = look(world, start=Pose(0.0, 0.0, math.pi), goal=goal, robot=robot)
    turned = back._replace(odometry=Pose(0.0, 0.0, math.pi))
    first = guide.guide(ahead).subgoal
    then = to_world(guide.guide(turned).subgoal, turned.odometry)
    assert then == pytest.approx(first, abs=0.1)
    guide.reset(np.random.default_rng(0))
    assert guide.guide(turned).subgoal == pytest.approx(turned.target)


def test_a_reset_guide_starts_from_scratch():
    guide, seen = look(walls(*U), start=Pose(2.0, 0.3, 0.0))
    first = guide.guide(seen).subgoal
    guide.guide(seen._replace(target=np.array([0.1, 0.0])))
    guide.reset(np.random.default_rng(1))
    assert guide.guide(seen).subgoal.tolist() == first.tolist()
