"""What every guide × planner pair that ships must do: each on one robot, under the `slow` mark on every robot."""

import functools
import itertools
import math

import numpy as np
import pytest

import lme.guides.lme.guide
import lme.planners.mppi.planner
from lme.config.composer import CUSTOM
from lme.config.presets import load_settings
from lme.guides.lme import weight_files
from lme.navigation.episode import run_episode
from lme.navigation.navigator import Navigator
from lme.simulation.fast import FastSimulator
from lme.types import Outcome, Pose, Twist
from lme.worlds.world import World
from runners.config import catalogue, systems
from tests.builders import CLUTTER, SHIPPED, observation, room, shipped, task, without_errors
from tests.networks import drl_vo_file, ipaprec_file, lics_file, network_file, onnx_file, subgoal_file
from tests.tolerances import KERNEL, MIRROR, MIRROR_ON_CELLS

CATALOGUE = catalogue.shipped()
GUIDES, PLANNERS = (
    [name for name in CATALOGUE.options(group) if name != CUSTOM] for group in ("guide", "planner")
)
LME = ("lme", "lme_printed")
LME_PLUS = ("lme_plus", "lme_plus_gazebo")
GOES_ON = (*LME, *LME_PLUS)  # after arrival
LEARNED = {
    name for name in PLANNERS if {"weights", "path"} & set(CATALOGUE.values(f"planner/{name}"))
}  # random networks here
LEARNED_GUIDES = {
    name for name in GUIDES if "weights" in CATALOGUE.values(f"guide/{name}")
}  # random ones, too
NETWORKS = {
    "dclp": network_file,
    "drl_vo": drl_vo_file,
    "lics": lics_file,
    "maer_nav": ipaprec_file,
    "drl_nsuo": functools.partial(ipaprec_file, sectors=30),
}  # by the first words of the planners' names
ONNX, RANDOM = "onnx.onnx", "random_"
TUNED_FOR = {
    "tuned": "jackal",
    "skid": "jackal",
    "gazebo": "jackal",
    "barn": "jackal",
    "global": "jackal",
    "run": "jackal",  # *_as_run
}  # by the last word


# The same planners with other values are slow tests. So are the guides that inherit another guide's values, except with
# the planners of the systems that ship with them: a planner sees the path and the subgoal, not who gave them. Planners
# of entries as they ran are driven with the guides of their systems.
OTHER_VALUES, OTHER_ENDS, ENTRIES = ("dclp_", "drl_vo_"), ("_skid", "_tuned"), "_as_run"
SYSTEMS = {(system.guide, system.planner) for system in systems.systems().values()}
HEIRS = {name for name in GUIDES if len(CATALOGUE.option(f"guide/{name}").files) > 1}


def is_usual(guide, planner):
    """Return whether a pair is driven by default."""
    if guide in HEIRS or planner.endswith(ENTRIES):
        return planner == "simple" or (guide, planner) in SYSTEMS
    return not planner.endswith(OTHER_ENDS) and not planner.startswith(OTHER_VALUES)


def cases():
    """Every robot with every guide and planner. The robots take turns."""
    for (i, guide), (j, planner) in itertools.product(enumerate(GUIDES), enumerate(PLANNERS)):
        tuned_for = TUNED_FOR.get(planner.rpartition("_")[2])
        turn = tuned_for or SHIPPED[(i + j) % len(SHIPPED)]
        for robot in (tuned_for,) if tuned_for else SHIPPED:
            slow = robot != turn or not is_usual(guide, planner)
            yield pytest.param(robot, guide, planner, marks=pytest.mark.slow if slow else ())


BLIND = ("target", "simple")  # sees no obstacle: Algorithm 3 leaves them to the guide
# LME+ gives a subgoal even where there is no way, and the simple planner drives to it.
HEEDLESS = {(robot, "lme_plus", "simple") for robot in ("jackal", "jackal_real")}
# The map of ten seconds ago is open in the lidar's blind arc, where the simple planner turns.
HEEDLESS |= {(robot, "dclp_as_run", "simple") for robot in ("jackal", "jackal_real")}
OFF_LINE_M = dict.fromkeys(
    LME, 1.0
)  # its subgoals are random, and the best of them lies that far off the line
OFF_LINE_OTHERS_M = 0.5
ARRIVED_M = dict.fromkeys(LME, 0.51)  # its d1: nearer than this it takes the goal for reached and continues
AT_GOAL_M, AT_REST_M_S = 0.2, 0.05
SLOW_M_S = {
    "ros_dwa": 0.5,
    "ros_eband": 0.7,
    "mppi": 0.4,
    "teb": 0.7,
}  # their own limit, which noise about it does not quite reach
UNCHECKED = {
    "ros_eband": "a plan through a wall makes it forget the wall, and it checks no footprint",
    "tube_vote": "it backs up without looking, as the entry did",
}
SOFT = {("go2", "lme", "teb")}  # hits the wall of a box
ON_CELLS = ("move_base", "nav2", "global_planner")
FREE_PERIODS = 30  # of MPPI before it is near obstacles, where a line of cells is another one backwards
HANDED = {
    **dict.fromkeys(
        ("navfn", "navfn_kul_fm"), "its path runs along corners of cells, half a cell to one side, as in ROS"
    ),
    "ros_dwa": "as in ROS, the first of equal scores wins, and turns to the right come first",
    "ros_eband": "the poses of its plan are turned to one side, and they pull",
    "mppi_tuned": "a line of cells is another one backwards, so near obstacles other samples touch one",
    **dict.fromkeys(
        ("teb", "teb_tuned"),
        "whether a sample goes or an obstacle counts may hang on the last bit of a number",
    ),
}
MARGIN_M = 0.05  # the paper's planner drives within 9° of its subgoal: with r alone it may graze a wall
NEAR = World(circles=np.array([[0.9, 0.25, 0.2], [0.7, -0.9, 0.2], [-0.2, 1.0, 0.2]]))


def pytest_generate_tests(metafunc):
    """The thousands of slow cases are not even collected by a run that leaves them out."""
    leaves_out = "not slow" in metafunc.config.option.markexpr
    chosen = [case for case in cases() if not (leaves_out and case.marks)]
    metafunc.parametrize(("robot", "guide", "planner"), chosen, scope="module")


@pytest.fixture(scope="module", autouse=True)
def network(tmp_path_factory):
    """Where learned planners look for weights there is a random network; none ship."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("weights")
        patch.setattr(weight_files, "REGISTERED", folder)
        for name, write in NETWORKS.items():
            write(folder / f"{name}.onnx")
        for name in LEARNED_GUIDES:
            subgoal_file(folder / f"{RANDOM}{name}.onnx")
        onnx_file(folder / ONNX)
        yield


@pytest.fixture
def drives(guide, planner):
    """For tests of good driving, which a random network knows nothing of."""
    if planner in LEARNED or guide in LEARNED_GUIDES:
        pytest.skip("its network is random")


def navigator_of(robot, guide, planner):
    learned = {}
    for name in NETWORKS:
        if planner.startswith(name):
            learned["planner.weights"] = name
    if planner == "onnx":
        learned["planner.path"] = str(weight_files.REGISTERED / ONNX)
    if guide in LEARNED_GUIDES:
        learned["guide.weights"] = f"{RANDOM}{guide}"
    return lme.load_system("simple", robot, guide=guide, planner=planner, **learned)


def made(robot, guide, planner, margin=0.0):
    """The robot, with a lidar that does not err and its footprint as its hull, and its navigator."""
    machine = without_errors(shipped(robot))
    if margin:
        machine.collision_radius = machine.footprint.circumscribed_radius + margin
    return machine, navigator_of(machine, guide, planner)


def drive(machine, navigator: Navigator, world, goal, seconds, seed=0):
    """Commands (T, 2), twists (T, 2) before them and poses (T + 1, 3), without an end at the goal."""
    simulator = FastSimulator(load_settings("sim/fast"), machine)
    job = task(world, goal=goal, goal_tolerance=0.0, time_limit=seconds)
    navigator.reset(np.random.default_rng(seed))
    navigator.read_map(job.world, job.start)
    seen = simulator.reset(job, np.random.default_rng(seed))
    commands, twists, poses = [], [], [simulator.state.pose]
    while simulator.state.time < seconds and not simulator.state.contact:
        twists.append(seen.twist)
        commands.append(navigator.act(seen))
        seen = simulator.step(commands[-1])
        poses.append(simulator.state.pose)
    return np.array(commands), np.array(twists), np.array(poses)


@pytest.mark.usefixtures("drives")
def test_an_empty_world_is_crossed_straight(robot, guide, planner):
    machine, navigator = made(robot, guide, planner)
    job = task(
        World(),
        goal=(6.0, 0.0),
        goal_tolerance=ARRIVED_M.get(guide, AT_GOAL_M),
        time_limit=5.0 + 15.0 / min(machine.v_max, SLOW_M_S.get(planner, math.inf)),
    )
    episode = run_episode(
        job, navigator, FastSimulator(load_settings("sim/fast"), machine), np.random.default_rng(0)
    )
    assert episode.outcome is Outcome.SUCCESS
    assert np.abs(episode.trajectory[:, 2]).max() <= OFF_LINE_M.get(guide, OFF_LINE_OTHERS_M)


@pytest.mark.usefixtures("drives")
def test_a_pair_comes_to_rest_at_the_goal(robot, guide, planner):
    if guide in GOES_ON:
        pytest.skip("LME knows no arrival: who runs it ends the episode at the goal (paper §III.A)")
    machine, navigator = made(robot, guide, planner)
    _, twists, poses = drive(machine, navigator, World(), (3.0, 0.0), 8.0 + 6.0 / machine.v_max)
    last = round(2.0 * machine.control_rate)
    assert np.hypot(poses[-last:, 0] - 3.0, poses[-last:, 1]).max() <= AT_GOAL_M
    assert np.abs(twists[-last:, 0]).max() <= AT_REST_M_S


CROSSED, MIRRORED = (
    World(circles=CLUTTER.circles * [1, side, 1], segments=CLUTTER.segments * [1, side, 1, side])
    for side in (1, -1)
)


@pytest.fixture(scope="module")
def crossing(robot, guide, planner):
    """A robot, its navigator, and their drive through obstacles: commands, twists and poses."""
    machine, navigator = made(robot, guide, planner)
    return machine, navigator, *drive(machine, navigator, CROSSED, (5.0, 0.8), max(3.0, 4.0 / machine.v_max))


def test_commands_keep_the_limits(crossing):
    machine, _, commands, twists, _ = crossing
    assert np.abs(commands[:, 0]).max() <= machine.v_max + KERNEL
    assert np.abs(commands[:, 1]).max() <= machine.omega_max + KERNEL
    change = np.abs(commands - twists).max(axis=0)
    assert change[0] <= machine.alpha_v * machine.dt + KERNEL
    assert change[1] <= machine.alpha_omega * machine.dt + KERNEL


@pytest.mark.usefixtures("drives")
def test_a_mirrored_world_is_driven_through_mirrored(guide, planner, crossing, monkeypatch):
    for part in (guide, planner):
        if part in HANDED:
            pytest.skip(HANDED[part])
    if guide in LME_PLUS:
        pytest.skip(
            "cells do not mirror: tests/lme/guides/lme_plus/test_guide_lme_plus.py mirrors its criteria"
        )
    machine, navigator, *_, poses = crossing
    draw = lme.guides.lme.guide.sample
    monkeypatch.setattr(lme.guides.lme.guide, "sample", lambda *given: draw(*given) * [1.0, -1.0])
    noise = lme.planners.mppi.planner.draw
    turned = np.array([1.0, -1.0], dtype=np.float32)
    monkeypatch.setattr(lme.planners.mppi.planner, "draw", lambda *given: noise(*given) * turned)
    *_, other = drive(machine, navigator, MIRRORED, (5.0, -0.8), 4.0 / machine.v_max)
    tolerance = MIRROR_ON_CELLS if guide in ON_CELLS else MIRROR
    compared = round(4.0 / machine.v_max / machine.dt)
    if planner.startswith("mppi"):
        compared = min(compared, FREE_PERIODS)
    assert other[:compared] * [1, -1, -1] == pytest.approx(poses[:compared], abs=tolerance)


def test_a_seed_decides_everything(crossing):
    machine, navigator, *_, poses = crossing
    *_, again = drive(machine, navigator, CROSSED, (5.0, 0.8), 2.0)
    np.testing.assert_array_equal(again, poses[: len(again)])


def test_every_pair_survives_strange_scans(robot, guide, planner):
    machine, checked = made(robot, guide, planner)
    navigator = Navigator(checked.guide, checked.planner, dt=machine.dt)  # which refuses no scan
    beams = machine.lidar.num_beams
    mixed = np.resize(np.array([0.0, np.nan, 1.0, np.inf, -1.0, 0.3], dtype=np.float32), beams)
    scans = [
        np.full(beams, value, np.float32) for value in (machine.lidar.range_max, 0.0, np.nan, np.inf, 0.3)
    ]
    for ranges in (np.empty(0, np.float32), mixed, *scans):
        navigator.reset(np.random.default_rng(0))
        navigator.read_map(World(), Pose(0.0, 0.0, 0.0))
        twist = Twist(0.0, 0.0)
        for target in ((4.0, 1.0), (4.0, 1.0), (-3.0, 0.0), (0.0, 0.0)):
            command = navigator.act(observation(target, ranges, twist, machine))
            assert math.isfinite(command.v)
            assert math.isfinite(command.omega)
            twist = command


def test_a_clockwise_scan_says_the_same(robot, guide, planner):
    if guide in LME:
        pytest.skip("LME draws its candidates from the first beam on")
    machine, navigator = made(robot, guide, planner)
    seen = FastSimulator(load_settings("sim/fast"), machine).reset(task(NEAR), np.random.default_rng(0))
    scan = seen.scan
    last = scan.angle_min + (len(scan.ranges) - 1) * scan.angle_increment
    turned = scan._replace(
        ranges=scan.ranges[::-1].copy(), angle_min=last, angle_increment=-scan.angle_increment
    )
    commands = []
    for each in (scan, turned):
        navigator.reset(np.random.default_rng(0))
        navigator.read_map(NEAR, Pose(0.0, 0.0, 0.0))
        commands.append(
            [
                navigator.act(seen._replace(scan=each, target=np.array(target)))
                for target in ((4.0, 1.0), (3.0, -2.0), (-1.0, 2.0))
            ]
        )
    assert np.array(commands[1]) == pytest.approx(np.array(commands[0]), abs=MIRROR)


@pytest.mark.usefixtures("drives")
def test_a_sealed_box_ends_in_time_out(robot, guide, planner):
    if planner in UNCHECKED:
        pytest.skip(UNCHECKED[planner])
    if (robot, guide, planner) in SOFT:
        pytest.skip(
            "a distance is a cost among others in TEB, and the subgoals of LME jump from wall to wall"
        )
    machine, navigator = made(robot, guide, planner, MARGIN_M)
    job = task(room(8.0 * machine.footprint.circumscribed_radius), goal=(6.0, 0.3), time_limit=12.0)
    episode = run_episode(
        job, navigator, FastSimulator(load_settings("sim/fast"), machine), np.random.default_rng(0)
    )
    touches = (guide, planner) == BLIND or (robot, guide, planner) in HEEDLESS
    assert episode.outcome is (Outcome.COLLISION if touches else Outcome.TIMEOUT)
