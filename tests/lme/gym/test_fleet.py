"""Many robots at once: each sees and does to the last bit what it would alone."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_map_set, load_robot, load_settings
from lme.errors import InputError
from lme.geometry.frames import wrap_angle
from lme.gym import crowds
from lme.gym import fleet as fleet_module
from lme.gym.episodes import CODES, Reward
from lme.gym.fleet import Fleet
from lme.gym.kernels.poses import wrapped
from lme.gym.kernels.steps import RUNNING
from lme.navigation.episode import Progress
from lme.robots import Footprint, Response
from lme.simulation.fast import FastSimulator
from lme.simulation.skid.simulator import SkidConfig, SkidSimulator
from lme.types import Outcome, Pose, Twist
from lme.worlds.contours import outlines
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import CLUTTER
from tests.builders import task as make_task

HARD = load_map_set("barn", {"worlds": [200, 250, 299], "time_limit": 4.0})
ROOM = load_map_set("env1", {"radius": 0.3, "worlds": [0, 1, 2], "time_limit": 2.0, "clock_distance": 0.3})
NEAR = load_map_set(
    "barn", {"worlds": [0, 1], "goal": [-2.25, 4.2], "goal_tolerance": 0.4, "time_limit": 2.0}
)
TRAPS = load_map_set("traps", {"kind": "u", "radius": 0.3, "starts": 3, "time_limit": 5.0})


def any_robot(rng):
    """A Jackal of random size and limits, disc or rectangle."""
    jackal = load_robot("jackal")
    length, width = rng.uniform(0.1, 0.5, 2)
    footprint = Footprint(radius=width / 2) if rng.random() < 0.3 else Footprint(length=length, width=width)
    jackal.lidar = replace(jackal.lidar, num_beams=90, yaw=2.5, noise_std=0.02)
    v_max, alpha_v, omega_max = rng.uniform(0.3, 3.0, 3)
    return replace(jackal, footprint=footprint, v_max=v_max, alpha_v=alpha_v, omega_max=omega_max)


class Alone:
    """One robot of a fleet, driven by the simulator itself."""

    def __init__(self, map_set, robot, seed, config, reward):
        self.map_set, self.robot, self.rng = map_set, robot, np.random.default_rng(seed)
        self.config, self.reward = config, reward

    def reset(self):
        numbers = self.map_set.numbers
        self.task = self.map_set.task(numbers[self.rng.integers(len(numbers))])
        robot = self.robot(self.rng) if callable(self.robot) else self.robot
        self.box = robot.footprint.box
        is_skid = isinstance(self.config, SkidConfig)
        self.simulator = SkidSimulator(self.config, robot) if is_skid else FastSimulator(self.config, robot)
        if is_skid and robot.drivetrain.contact:
            self.box = robot.drivetrain.contact.box
        seen = self.simulator.reset(self.task, self.rng)
        self.progress, self.steps = Progress(self.task, self.simulator.state), 0
        return seen

    def step(self, command):
        before = self.simulator.state
        seen = self.simulator.step(Twist(*command))
        after, self.steps = self.simulator.state, self.steps + 1
        self.progress.moved(before, after)
        outcome = self.progress.outcome(after)
        goal = self.task.goal
        nearer = np.hypot(*(goal - before.pose[:2])) - np.hypot(*(goal - after.pose[:2]))
        ends = {None: 0.0, Outcome.SUCCESS: self.reward.success, Outcome.COLLISION: self.reward.collision}
        ends[Outcome.TIMEOUT] = self.reward.timeout
        return seen, self.reward.progress * nearer + (self.reward.step + ends[outcome]), outcome

    def result(self, outcome):
        time, length = self.progress.time(self.simulator.state), self.progress.path_length
        return (outcome, self.task.number, time, length, self.steps, self.task.optimal_time)


def assert_sees(views, i, seen, box):
    np.testing.assert_array_equal(views.ranges[i], seen.scan.ranges)
    np.testing.assert_array_equal(views.targets[i], seen.target)
    assert tuple(views.twists[i]) == seen.twist
    assert tuple(views.commands[i]) == seen.last_command
    assert tuple(views.limits[i]) == seen.limits[:4]
    assert tuple(views.boxes[i]) == box


REWARD = Reward(progress=2.0, success=10.0, collision=-10.0, timeout=-0.5, step=-0.01)


def assert_drives_as_alone(map_set, robot, config, steps=150, threads=1):
    """Drive six robots in a fleet and alone; return the kinds of ends of their episodes."""
    n = 6
    fleet = Fleet(map_set, robot, n, config, REWARD, threads=threads)
    alone = [Alone(map_set, robot, 100 + i, config, REWARD) for i in range(n)]
    views = fleet.reset(range(100, 100 + n))
    for i, single in enumerate(alone):
        assert_sees(views, i, single.reset(), single.box)
    rng, kinds = np.random.default_rng(0), set()
    for _ in range(steps):
        commands = rng.normal([0.6, 0.0], [0.5, 1.0], (n, 2))
        moved = fleet.step(commands)
        ended = moved.ended.tolist()
        for i, single in enumerate(alone):
            seen, gain, outcome = single.step(commands[i])
            assert moved.rewards[i] == gain
            assert moved.outcomes[i] == CODES[outcome]
            assert moved.terminated[i] == (outcome in (Outcome.SUCCESS, Outcome.COLLISION))
            assert moved.truncated[i] == (outcome is Outcome.TIMEOUT)
            assert (i in ended) == (outcome is not None)
            if outcome is not None:
                kinds.add(outcome)
                assert_sees(moved.last_views, ended.index(i), seen, single.box)
                assert tuple(moved.results[ended.index(i)]) == single.result(outcome)
                seen = single.reset()
            assert_sees(moved.views, i, seen, single.box)
    return kinds


@pytest.mark.parametrize(
    ("map_set", "robot", "config"),
    [
        (HARD, load_robot("jackal"), load_settings("sim/fast")),
        (HARD, any_robot, load_settings("sim/fast", max_step=0.1)),
        (ROOM, load_robot("stage"), load_settings("sim/fast")),
        (ROOM, any_robot, load_settings("sim/fast", even_ramp=True)),
        (TRAPS, replace(load_robot("jackal"), alpha_v=3.0, alpha_omega=15.0), load_settings("sim/fast")),
        (NEAR, any_robot, load_settings("sim/fast")),
    ],
)
def test_every_robot_of_a_fleet_does_what_it_would_alone(map_set, robot, config):
    kinds = assert_drives_as_alone(map_set, robot, config)
    # The comparison has seen these ends.
    assert (Outcome.SUCCESS in kinds) if map_set is NEAR else len(kinds) == 2


LOCALISED = {"goal_noise": 0.05, "goal_noise_yaw": 0.02, "goal_rate": 3.0}
WALKING = {"natural_frequency_v": 10.0, "overshoot_v": 0.7, "overshoot_omega": 0.7}
DISTURBANCES = [
    {"scan_noise": 0.02},
    {"scan_dropout": 0.1},
    {"goal_noise": 0.1, "goal_noise_yaw": 0.05},
    {"goal_rate": 0.0},
    {**LOCALISED, "odometry_error": 0.1},
    {**LOCALISED, "odometry_age": 0.25},
    {"latency": 0.25},
    {"latency": 0.1, "even_ramp": True, "max_step": 0.02},
    {"lag": 0.2},
    {"slip": 0.2},
    {"ripple_v": 0.07, "ripple_omega": 0.25},
    {"tilt": 0.04},
    WALKING,
    {**WALKING, "natural_frequency_omega": 15.0, "natural_frequency_v": 0.0, "lag": 0.1},
    {
        **WALKING,
        **LOCALISED,
        "natural_frequency_omega": 15.0,
        "ripple_v": 0.07,
        "tilt": 0.04,
        "latency": 0.17,
        "slip": 0.1,
        "odometry_error": 0.05,
        "odometry_age": 0.03,
        "scan_noise": 0.01,
        "scan_dropout": 0.05,
    },
]


def any_jackal(rng):
    """A robot as `any_robot` draws it, whose lidar's height is known, with another drivetrain."""
    robot = any_robot(rng)
    lidar, drivetrain = replace(robot.lidar, height=0.3), load_robot("jackal").drivetrain
    return replace(robot, lidar=lidar, drivetrain=replace(drivetrain, mass=rng.uniform(10.0, 30.0)))


@pytest.mark.parametrize("disturbances", DISTURBANCES, ids=lambda keys: ",".join(keys))
def test_disturbances_are_those_of_a_robot_that_drives_alone(disturbances):
    config = load_settings("sim/fast", **disturbances)
    kinds = assert_drives_as_alone(HARD, any_jackal, config, 90)
    assert Outcome.TIMEOUT in kinds or Outcome.COLLISION in kinds
    assert Outcome.SUCCESS in assert_drives_as_alone(NEAR, any_jackal, config, 60)


@pytest.mark.parametrize("sim", ["skid", "gazebo"])
@pytest.mark.parametrize(
    "disturbances",
    [
        {},
        {"scan_rate": None, "yaw_noise": 0.0, "goal_rate": None, "friction": "body"},
        {"latency": 0.17, "friction": "wheel", "slip": 0.1, "lag": 0.1, "goal_rate": 2.0, "goal_noise": 0.1},
        {
            **WALKING,
            "natural_frequency_omega": 15.0,
            "tilt": 0.04,
            "scan_noise": 0.01,
            "odometry_error": 0.05,
        },
    ],
    ids=lambda keys: ",".join(keys),
)
def test_wheels_slide_as_those_of_a_robot_that_drives_alone(sim, disturbances):
    config = load_settings(f"sim/{sim}", **disturbances)
    kinds = assert_drives_as_alone(HARD, any_jackal, config, 90)
    kinds |= assert_drives_as_alone(NEAR, any_jackal, config, 60)
    assert Outcome.SUCCESS in kinds
    assert len(kinds) > 1


DYNABARN = load_map_set("dynabarn", {"time_limit": 6.0})
SOCIAL = [
    load_map_set("social", {"radius": 0.3, "count": 2, "time_limit": 6.0, **keys})
    for keys in ({"kind": "doorway"}, {"kind": "group", "motion": "social_force", "sees_robot": 0.5})
]


def _doors_and_tracks(number):
    """A room with a door that opens, a person who walks and a recorded one who comes and goes, or with nothing."""
    path = np.array([[1.5, -2.0], [1.5, 2.0], [0.5, 0.0]])
    door = Mover(
        path=np.array([[2.0, 1.0, 0.0], [2.0, 1.0, 1.5]]),
        outline=np.array([[0.0, -0.05], [1.2, -0.05], [1.2, 0.05], [0.0, 0.05]]),
        starts_within=2.0,
        repeat="back_and_forth",
    )
    recorded = Mover(path=path, radius=0.3, times=np.array([0.3, 2.0, 4.0]))
    walker = Mover(path=path[::-1], radius=0.25, motion="orca", repeat="cycle")
    waiting = Mover(path=path + 0.5, radius=0.2, waits_within=1.0, repeat="cycle")
    movers = [(door, recorded, walker, waiting), (door, waiting), (recorded,), ()][number]
    world = World(circles=CLUTTER.circles, movers=movers)
    return make_task(world, start=Pose(0.0, 0.0, 0.3), goal=np.array([2.5, 0.5]), time_limit=4.0)


class _Doors:
    """Four worlds, in three of which something moves."""

    numbers = (0, 1, 2, 3)

    def __init__(self):
        self._tasks = [_doors_and_tracks(number) for number in self.numbers]

    def task(self, number):
        return self._tasks[number]


@pytest.mark.parametrize(
    "config",
    [
        load_settings("sim/fast"),
        load_settings("sim/fast", **DISTURBANCES[-1]),
        load_settings("sim/skid"),
        load_settings("sim/gazebo", latency=0.05),
    ],
    ids=["fast", "disturbed", "skid", "gazebo"],
)
@pytest.mark.parametrize("maps", [DYNABARN, *SOCIAL, _Doors()], ids=["dynabarn", "orca", "force", "doors"])
def test_what_moves_moves_as_around_a_robot_that_drives_alone(maps, config):
    kinds = assert_drives_as_alone(maps, any_jackal, config, 120, threads=2)
    assert kinds  # some episodes have ended and begun anew


def test_worlds_that_no_robot_is_in_are_forgotten(monkeypatch):
    monkeypatch.setattr(crowds, "MOST_WORLDS", 0)
    assert_drives_as_alone(_Doors(), any_jackal, load_settings("sim/fast"), 100)


class _Large:
    """Two worlds: two thousand discs, and rough walls on a lattice; with several goals in each."""

    numbers = (0, 1, 2, 3)

    def __init__(self):
        rng = np.random.default_rng(0)
        circles = np.column_stack([rng.uniform(-20, 20, (2000, 2)), rng.uniform(0.02, 0.2, 2000)])
        circles = circles[np.hypot(circles[:, 0], circles[:, 1]) - circles[:, 2] > 0.6]
        solid = rng.random((120, 160)) < 0.1
        solid[45:75, 65:95] = False
        polygons = tuple((outline - [80, 60]) * 0.05 for outline in outlines(solid))
        self.worlds = [
            World(circles=circles),
            World(circles=np.add(circles[:5], (9.0, 9.0, 0.0)), polygons=polygons),
        ]
        assert len(self.worlds[1].lattice.edges) > 512

    def task(self, number):
        goal = np.array([30.0, number])
        return make_task(self.worlds[number % 2], start=Pose(0.0, 0.0, 0.3), goal=goal, time_limit=3.0)


@pytest.mark.parametrize(
    "config",
    [load_settings("sim/fast"), load_settings("sim/fast", **DISTURBANCES[-1]), load_settings("sim/gazebo")],
    ids=["fast", "disturbed", "gazebo"],
)
def test_many_obstacles_and_many_threads_change_nothing(config):
    """Sixty robots among discs and on a lattice: one thread, three threads, and six of them alone."""
    robot, n = load_robot("jackal"), 60
    robot.lidar.height = 0.3
    maps, reward = _Large(), Reward()
    one, three = (Fleet(maps, robot, n, config, reward, threads=threads) for threads in (1, 3))
    alone = [Alone(maps, robot, i, config, reward) for i in range(6)]
    first, other = one.reset(range(n)), three.reset(range(n))
    for mine, its in zip(first, other, strict=True):
        np.testing.assert_array_equal(mine, its)
    for i, single in enumerate(alone):
        assert_sees(first, i, single.reset(), single.box)
    rng, num_ended = np.random.default_rng(0), 0
    for _ in range(40):
        commands = rng.normal([0.6, 0.0], [0.5, 1.0], (n, 2))
        moved, same = one.step(commands), three.step(commands)
        for mine, its in zip((*moved.views, *moved[1:6]), (*same.views, *same[1:6]), strict=True):
            np.testing.assert_array_equal(mine, its)
        assert list(moved.results) == list(same.results)
        num_ended += len(moved.ended)
        for i, single in enumerate(alone):
            seen, _, outcome = single.step(commands[i])
            assert moved.outcomes[i] == CODES[outcome]
            assert_sees(moved.views, i, single.reset() if outcome else seen, single.box)
    assert num_ended > 20


def test_robots_share_the_obstacles_of_a_world():
    maps = _Large()
    fleet = Fleet(maps, load_robot("jackal"), 40)
    fleet.reset(range(40))
    stored = fleet._store.obstacles
    assert len(fleet._store.tasks) == 4
    assert len(fleet._store.worlds) == 2
    assert len(stored.discs) < 2 * sum(len(world.discs.shapes) for world in maps.worlds)


def test_a_store_that_is_full_starts_anew(monkeypatch):
    monkeypatch.setattr(fleet_module, "MOST_TASKS", 2)
    fleet, plain = (Fleet(load_map_set("barn", {"subset": "all"}), load_robot("stage"), 2) for _ in range(2))
    monkeypatch.undo()
    for seed in range(8):
        monkeypatch.setattr(fleet_module, "MOST_TASKS", 2)
        mine = fleet.reset([seed, seed + 50])
        monkeypatch.undo()
        np.testing.assert_array_equal(mine.ranges, plain.reset([seed, seed + 50]).ranges)
        assert len(fleet._store.tasks) <= 6


def test_results_as_arrays_are_those_of_each_episode():
    fleet = Fleet(HARD, load_robot("jackal"), 20)
    fleet.reset(range(20))
    for _ in range(45):
        moved = fleet.step(np.full((20, 2), [0.8, 0.0]))
        columns = moved.results.infos()
        for k, result in enumerate(moved.results):
            assert {name: column[k] for name, column in columns.items()} == result.info()
    assert len(NEAR.numbers) == 2


@pytest.mark.parametrize("threads", [0, -1])
def test_a_number_of_threads_is_positive(threads, says):
    with says.raises(InputError):
        Fleet(ROOM, load_robot("stage"), 2, threads=threads)


def test_without_autoreset_an_ended_episode_waits_for_its_reset(says):
    fleet = Fleet(_Reached(), load_robot("stage"), 2, autoreset="Disabled")
    fleet.reset([0, 1])
    assert fleet.step(np.zeros((2, 2))).terminated.all()
    with says.raises(InputError):
        fleet.step(np.zeros((2, 2)))
    before = fleet.reset(mask=np.array([True, False]))
    with says.raises(InputError):
        fleet.step(np.zeros((2, 2)))
    assert before.ranges.shape == (2, fleet.robot.lidar.num_beams)


class _Reached:
    """Two rooms whose goals are reached wherever the robot is."""

    rooms = load_map_set("env1", {"radius": 0.3})
    numbers = rooms.numbers

    def task(self, number):
        return replace(self.rooms.task(number), goal_tolerance=20.0)


def test_a_goal_is_reached_and_measured():
    fleet = Fleet(_Reached(), load_robot("stage"), 2)
    fleet.reset([0, 1])
    moved = fleet.step(np.zeros((2, 2)))
    assert moved.terminated.all()
    assert not moved.truncated.any()
    assert moved.rewards.tolist() == [20.0, 20.0]
    for result in moved.results:
        info = result.info()
        assert info["outcome"] == "success"
        assert info["is_success"] is True
        assert info["barn_metric"] == 0.5
        assert info["time"] == 0.2  # a control period
        assert info["optimal_time"] > 1.0


def test_the_same_seeds_give_the_same_episodes_and_no_array_is_shared():
    fleet, other = (Fleet(HARD, load_robot("jackal"), 3) for _ in range(2))
    kept = [fleet.reset([4, 5, 6])]
    copies = [tuple(part.copy() for part in kept[0])]
    other.reset([4, 5, 6])
    for k in range(60):
        commands = np.full((3, 2), [1.0, 0.1 * k])
        kept.append(fleet.step(commands).views)
        copies.append(tuple(part.copy() for part in kept[-1]))
        for mine, its in zip(kept[-1], other.step(commands).views, strict=True):
            np.testing.assert_array_equal(mine, its)
    for views, copy in zip(kept, copies, strict=True):
        for part, old in zip(views, copy, strict=True):
            np.testing.assert_array_equal(part, old)


def test_without_seeds_the_random_streams_continue_and_a_world_can_be_chosen(says):
    fleet = Fleet(HARD, load_robot("jackal"), 2)
    first = fleet.reset([1, 2])
    assert (first.ranges != fleet.reset().ranges).any()
    np.testing.assert_array_equal(fleet.reset([1, 2]).ranges, first.ranges)
    fleet.reset(world=250)
    assert [task.number for task in fleet.tasks] == [250, 250]
    with says.raises(InputError, match="world.*7"):
        fleet.reset(world=7)


def test_worlds_of_any_size_share_the_arrays():
    fleet = Fleet(load_map_set("barn", {"subset": "all"}), load_robot("stage"), 1)
    for world in (0, 299, 5):
        (alone,) = (load_map_set("barn", {"worlds": [world]}),)
        expected = FastSimulator(load_settings("sim/fast"), load_robot("stage")).reset(
            alone.task(world), np.random.default_rng(0)
        )
        np.testing.assert_array_equal(fleet.reset(world=world).ranges[0], expected.scan.ranges)


@given(st.floats(-1e6, 1e6) | st.sampled_from([k * math.pi / 2 for k in range(-9, 10)]))
def test_angles_are_wrapped_as_in_python(angle):
    for near in (angle, math.nextafter(angle, math.inf), math.nextafter(angle, -math.inf)):
        assert wrapped(near) == wrap_angle(near)


def test_what_the_compiled_step_does_not_cover_is_refused(says):
    stage, jackal = load_robot("stage"), load_robot("jackal")
    measured = replace(jackal, drivetrain=None, response=Response(1.0, 1.0, 0.1, 0.1, 2.0, 2.0))
    with says.raises(InputError):
        Fleet(HARD, measured, 2, load_settings("sim/skid"))
    with pytest.raises(InputError, match=r"robot\.lidar\.native_beams is 540"):
        Fleet(ROOM, load_robot("turtlebot2"), 2)
    with pytest.raises(InputError, match=r"robot\.lidar\.shadow_angle is 0\.17"):
        Fleet(ROOM, replace(stage, lidar=replace(stage.lidar, shadow_angle=0.17)), 2)
    with says.raises(InputError, match="num_envs.*0"):
        Fleet(ROOM, stage, 0)


def test_wrong_commands_and_seeds_are_refused(says):
    fleet = Fleet(ROOM, load_robot("stage"), 2)
    with says.raises(InputError):
        fleet.step(np.zeros((2, 2)))
    with says.raises(InputError):
        fleet.reset([1, 2, 3])
    fleet.reset()
    with says.raises(InputError):
        fleet.step(np.array([[0.0, 0.0], [0.0, np.nan]]))
    with says.raises(InputError):
        fleet.step(np.zeros((2, 3)))
    assert (fleet.step(np.zeros((2, 2))).outcomes == RUNNING).all()


def test_robots_that_are_drawn_have_the_same_lidar(says):
    def draw(rng):
        robot = load_robot("stage")
        robot.lidar.num_beams = 540 if rng.random() < 0.5 else 360
        return robot

    with says.raises(InputError):
        Fleet(ROOM, draw, 30).reset(range(30))


def test_a_robot_that_cannot_start_is_refused(says):
    with says.raises(InputError):
        Fleet(HARD, replace(load_robot("jackal"), footprint=Footprint(radius=3.0)), 1).reset(world=200)
