import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import lme.guides.global_path.guide as module
import lme.mapping.costmap as costmap_module
from lme.config.presets import load_settings
from lme.errors import InputError
from lme.geometry.frames import to_robot, to_world
from lme.guides.global_path.guide import GlobalPath
from lme.mapping.costmap import Costmap
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.planners.simple import Simple
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Pose
from lme.worlds.barn.map_set import Barn
from lme.worlds.world import World
from tests.builders import SHIPPED, observation, room, shipped, stage, task
from tests.tolerances import KERNEL

HERE = Pose(0.0, 0.0, 0.0)
POSES = st.builds(Pose, *[st.floats(-3, 3)] * 3)


def global_path(robot=None, **settings):
    guide = GlobalPath(load_settings("guide/global_path", **settings), robot or stage())
    guide.reset(np.random.default_rng(0))
    return guide


def first_view(world, robot=None, start=HERE, goal=(4.0, 0.0)):
    """What the robot sees before it moves."""
    simulator = FastSimulator(load_settings("sim/fast"), robot or stage())
    return simulator.reset(task(world, start, goal), np.random.default_rng(0))


def drive(world, goal, robot=None, start=HERE, time_limit=60.0, **settings):
    return run(task(world, start, goal, time_limit=time_limit), robot or stage(), **settings)


def run(episode, robot, **settings):
    navigator = Navigator(
        GlobalPath(load_settings("guide/global_path", **settings), robot),
        Simple(load_settings("planner/simple"), robot),
    )
    return run_episode(
        episode, navigator, FastSimulator(load_settings("sim/fast"), robot), np.random.default_rng(0)
    )


def boxes(*walls):
    return World(segments=np.array(walls, dtype=float))


def clearance(path, points):
    """Least distance [m] from any point of the path to any of the points."""
    return np.linalg.norm(path[:, None] - np.asarray(points)[None], axis=2).min()


U_TRAP = boxes((2, -1, 2, 1), (0.5, 1, 2, 1), (0.5, -1, 2, -1))
SEALED = room(2.0)

# The path


@given(POSES, st.floats(0.5, 8), st.floats(-3, 3))
def test_without_obstacles_the_path_is_the_straight_line(pose, away, bearing):
    target = np.array([away * math.cos(bearing), away * math.sin(bearing)])
    guidance = global_path().guide(observation(target, odometry=pose))
    path = guidance.path
    assert path[0] == pytest.approx([0, 0], abs=KERNEL)
    assert path[-1] == pytest.approx(target, abs=KERNEL)
    spacing = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert spacing == pytest.approx(spacing[0], abs=1e-6)
    assert spacing.max() <= 0.05 + KERNEL
    assert np.abs(path @ [-target[1], target[0]]).max() / away < KERNEL
    assert guidance.subgoal == pytest.approx(target * min(1.0, 2.0 / away), abs=0.05)
    assert (guidance.switched, guidance.blocked) == (False, False)


def test_the_path_keeps_the_padded_radius_from_what_it_sees():
    post = World(circles=np.array([[2.0, 0.05, 0.1]]))
    path = global_path().guide(first_view(post)).path
    assert clearance(path, [(2.0, 0.05)]) >= 0.1 + 0.3 - 0.05
    assert np.abs(path[:, 1]).max() < 0.6


def test_the_path_starts_where_the_robot_has_got_to():
    guide = global_path(replan_rate=0.01)
    guide.guide(observation((4.0, 0.0)))
    for x in (0.3, 0.9, 1.5):
        pose = Pose(x, 0.1, 0.5)
        target = to_robot(np.array([4.0, 0.0]), pose)
        path = guide.guide(observation(target, odometry=pose)).path
        assert path[0].tolist() == [0.0, 0.0]
        assert path[-1] == pytest.approx(target)
        assert len(path) == pytest.approx((4.0 - x) / 0.05 + 1, abs=2)


def test_the_subgoal_is_the_farthest_point_of_the_path_in_sight():
    wall = boxes((1.0, -3.0, 1.0, 0.8))
    guidance = global_path().guide(first_view(wall, goal=(3.0, 0.0)))
    index = np.flatnonzero((guidance.path == guidance.subgoal).all(axis=1))
    assert len(index) == 1
    assert guidance.subgoal[1] > 0.8  # not past the end of the wall, which hides the rest
    assert np.hypot(*guidance.subgoal) < np.hypot(*guidance.path[index[0] + 5])


def test_a_target_inside_an_obstacle_is_neared():
    block = World(polygons=(np.array([[2.5, -0.5], [3.5, -0.5], [3.5, 0.5], [2.5, 0.5]]),))
    guide = global_path(global_map="known")
    guide.read_map(block, HERE)
    guidance = guide.guide(first_view(block, goal=(3.0, 0.1)))
    assert not guidance.blocked
    assert np.hypot(*(guidance.path[-1] - [3.0, 0.1])) == pytest.approx(0.4 + 0.3, abs=0.1)


def test_a_target_in_the_padding_only_is_reached():
    wall = boxes((3.0, -2.0, 3.0, 2.0))
    guidance = global_path().guide(first_view(wall, goal=(2.73, 0.0)))
    assert guidance.path[-1] == pytest.approx([2.73, 0.0])
    assert not guidance.blocked


def test_a_robot_that_stands_in_the_padding_gets_out():
    wall = boxes((0.23, -2.0, 0.23, 0.5))
    guidance = global_path().guide(first_view(wall))
    assert not guidance.blocked
    assert clearance(guidance.path[20:], [(0.23, y) for y in np.linspace(-2, 0.5, 100)]) > 0.25


def test_without_a_way_the_path_is_the_straight_line_and_the_robot_waits():
    guidance = global_path(costmap={"obstacle_range": 10.0}).guide(first_view(SEALED))
    assert guidance.blocked
    assert guidance.path[-1] == pytest.approx([4.0, 0.0])
    assert np.abs(guidance.path[:, 1]).max() < KERNEL
    assert guidance.subgoal == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("half", [30.0, 100.0, 123.4])
def test_a_map_of_too_many_cells_names_the_size_that_fits(monkeypatch, half, says):
    monkeypatch.setattr(costmap_module, "_MOST_CELLS", 40_000)
    world = boxes((2.0, -half, 2.0, half), (-half, half, half / 2, half))

    def guide(cell_size):
        path = global_path(
            global_map="known", costmap={"cell_size": cell_size, "inflation_radius": cell_size}
        )
        path.read_map(world, HERE)
        path.guide(first_view(world))

    with pytest.raises(InputError) as error:
        guide(0.05)
    least = re.search(r"must have at most 40,000, so cells of at least (\S+) m", str(error.value))[1]
    guide(float(least))
    with says.raises(InputError):
        guide(0.95 * float(least))


@pytest.mark.parametrize(("global_map", "half"), [("observed", 9.0), ("known", 9.0), ("known", 60.0)])
def test_a_path_may_lead_far_around(global_map, half):
    """Round the far end of a wall across the way; a true map is on the grid as a whole, however long the wall."""
    wall = World(segments=np.array([[2.0, -half, 2.0, half - 1.0]]))
    guide = global_path(global_map=global_map, costmap={"obstacle_range": 25.0})
    robot = stage()
    robot.lidar.range_max = 30.0
    guide.read_map(wall, HERE)
    guidance = guide.guide(first_view(wall, robot))
    assert not guidance.blocked
    assert half - 1.2 < guidance.path[:, 1].max() < half


@given(st.integers(0, 2**32 - 1))
def test_what_is_left_out_of_the_search_changes_no_path(seed):
    """The search sees only the part of the map around obstacles and ends: see `Costmap.window`."""
    rng = np.random.default_rng(seed)
    walls = rng.uniform(-1.0, 5.0, (rng.integers(1, 6), 4))
    world = World(segments=walls + np.where(walls[:, :1] > 4.0, rng.uniform(-3.0, 3.0), 0.0))
    goal, paths = rng.uniform(-4.0, 4.0, 2), []
    for everything in (False, True):
        guide = global_path(global_map="known")
        guide.read_map(world, HERE)
        with pytest.MonkeyPatch.context() as patch:
            if everything:
                patch.setattr(Costmap, "window", lambda self, cells: (slice(0, None), slice(0, None)))
            paths.append(guide.guide(first_view(World(), goal=goal)).path)
    np.testing.assert_array_equal(*paths)


# Maps


def test_obstacles_that_no_scan_has_shown_are_on_the_true_map_only():
    hidden = boxes((1.5, -0.5, 1.5, 0.5), (3.0, -0.5, 3.0, 3.0))
    deepest = {}
    for global_map in ("observed", "known"):
        guide = global_path(global_map=global_map)
        guide.read_map(hidden, HERE)
        path = guide.guide(first_view(hidden)).path
        deepest[global_map] = clearance(path, [(3.0, y) for y in np.linspace(-0.5, 3.0, 200)])
    assert deepest["observed"] < 0.05
    assert deepest["known"] > 0.25


def test_the_true_map_is_given_in_the_world_and_used_in_the_odometry_frame():
    start = Pose(3.0, -2.0, 2.0)
    wall = boxes((1.5, -0.5, 1.5, 1.5))
    world = World(segments=to_world(wall.segments.reshape(-1, 2), start).reshape(-1, 4))
    paths = []
    for given_world, origin in ((wall, HERE), (world, start)):
        guide = global_path(global_map="known")
        guide.read_map(given_world, origin)
        paths.append(guide.guide(observation((4.0, 0.0))).path)
    np.testing.assert_allclose(*paths, atol=1e-6)


def test_the_true_map_must_be_given():
    guide = global_path(global_map="known")
    with pytest.raises(InputError, match=r"global_map is 'known'"):
        guide.guide(observation())
    guide.read_map(World(), HERE)
    guide.reset(np.random.default_rng(0))
    with pytest.raises(InputError, match="read_map after reset"):
        guide.guide(observation())


def test_a_map_with_a_rate_is_rebuilt_in_its_own_time():
    """At 2 Hz, seen at 10 Hz, a wall that appears after the first look is on the map from the fifth look on at most."""
    robot = stage()
    robot.control_rate = 10.0
    wall = World(segments=np.array([[1.0, -0.5, 1.0, 0.5]]))
    simulator = FastSimulator(load_settings("sim/fast"), robot)
    empty, walled = (
        simulator.reset(task(world, goal=(4.0, 0.0)), np.random.default_rng(0)) for world in (World(), wall)
    )
    seen_at = set()
    for seed in range(12):
        guide = GlobalPath(load_settings("guide/global_path", costmap={"update_rate": 2.0}), robot)
        guide.reset(np.random.default_rng(seed))
        guide.guide(empty)
        looks = 0
        while not guide.costmap.costs.any():
            guide.guide(walled)
            looks += 1
        seen_at.add(looks)
    assert seen_at <= {2, 3, 4, 5, 6}  # a map takes the scan of the look before
    assert len(seen_at) > 2


# Replanning


def planned(monkeypatch):
    """Counts the plans."""
    calls = []
    plan = GlobalPath._plan
    monkeypatch.setattr(GlobalPath, "_plan", lambda *args: calls.append(1) or plan(*args))
    return calls


def test_an_unchanged_map_is_searched_once(monkeypatch):
    calls = []
    search = module.search
    monkeypatch.setattr(module, "search", lambda *args: calls.append(1) or search(*args))
    guide = global_path(replan_rate=10.0)
    paths = [guide.guide(first_view(U_TRAP)).path for _ in range(5)]
    assert len(calls) == 1
    for path in paths[1:]:
        np.testing.assert_array_equal(path, paths[0])


@pytest.mark.parametrize(("rate", "plans"), [(10.0, 20), (5.0, 20), (1.0, 4), (0.5, 2)])
def test_plans_at_the_set_rate_but_no_more_than_once_a_step(monkeypatch, rate, plans):
    calls = planned(monkeypatch)
    guide = global_path(replan_rate=rate)  # at 5 Hz
    for _ in range(20):
        guide.guide(observation())
    assert len(calls) == plans


def test_plans_at_once_when_something_stands_on_the_path(monkeypatch):
    calls = planned(monkeypatch)
    guide = global_path(replan_rate=0.1)
    door = [(2.0, 0.5, 2.0, 4.0), (2.0, -4.0, 2.0, -0.5)]
    open_door, shut = boxes(*door), boxes(*door, (2.0, -0.5, 2.0, 0.5))
    before = [guide.guide(first_view(open_door)) for _ in range(5)]
    assert len(calls) == 1
    assert not any(guidance.switched for guidance in before)
    after = [guide.guide(first_view(shut)) for _ in range(5)]
    assert len(calls) == 2
    assert [guidance.switched for guidance in after] == [True, False, False, False, False]
    assert np.abs(after[0].path[:, 1]).max() > 1.5


def test_without_a_way_the_guide_plans_no_more_often(monkeypatch):
    calls = planned(monkeypatch)
    guide = global_path(replan_rate=1.0, costmap={"obstacle_range": 10.0})
    for _ in range(20):
        assert guide.guide(first_view(SEALED)).blocked
    assert len(calls) == 4


def test_reset_forgets_map_and_path():
    guide = global_path()
    guide.guide(first_view(U_TRAP))
    guide.reset(np.random.default_rng(1))
    np.testing.assert_array_equal(guide.guide(observation()).path, global_path().guide(observation()).path)


# In closed loop


@pytest.mark.parametrize("global_map", ["observed", "known"])
@pytest.mark.parametrize("name", SHIPPED)
def test_every_robot_gets_out_of_a_u(name, global_map):
    assert drive(U_TRAP, (4.0, 0.0), shipped(name), global_map=global_map).outcome is Outcome.SUCCESS


def test_a_path_leads_through_barn_worlds():
    barn = Barn(load_settings("map/barn", subset="fresh", count=2))
    for number in barn.numbers:
        assert run(barn.task(number), shipped("jackal")).outcome is Outcome.SUCCESS


@pytest.mark.parametrize("global_map", ["observed", "known"])
def test_a_mirrored_scene_is_guided_as_its_mirror_image(global_map):
    robot = shipped("jackal")
    robot.lidar.noise_std = 0.0
    rng = np.random.default_rng(3)
    circles = np.column_stack(
        [rng.uniform(0.8, 5.0, 14), rng.uniform(-2.5, 2.5, 14), rng.uniform(0.05, 0.3, 14)]
    )
    sides = []
    for side in (1, -1):
        world = World(circles=circles * [1, side, 1])
        guide = global_path(robot, global_map=global_map)
        guide.read_map(world, HERE)
        pilot = Simple(load_settings("planner/simple"), robot)
        simulator = FastSimulator(load_settings("sim/fast"), robot)
        seen = simulator.reset(task(world, goal=(6.0, side * 0.7)), np.random.default_rng(0))
        guided = []
        while not simulator.state.arrived and len(guided) < 150:
            guided.append(guide.guide(seen))
            seen = simulator.step(pilot.plan(seen, guided[-1]))
        sides.append(guided)
        assert simulator.state.arrived
    assert len(sides[0]) == len(sides[1])
    for one, other in zip(*sides, strict=True):
        np.testing.assert_allclose(one.path, other.path * [1, -1], atol=1e-6)
        np.testing.assert_allclose(one.subgoal, other.subgoal * [1, -1], atol=1e-6)
        assert (one.switched, one.blocked) == (other.switched, other.blocked)


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"global_map": "true"}, "guide.global_map is 'true': must be one of observed, known"),
        ({"heuristic_weight": 1.1}, "guide.heuristic_weight"),
        ({"replan_rate": 0.0}, "guide.replan_rate"),
        ({"lookahead": -1.0}, "guide.lookahead"),
    ],
)
def test_mistakes_name_their_key(settings, key):
    with pytest.raises(InputError, match=key):
        global_path(**settings)
