"""Pedestrians and doors: where they are when, and what they heed."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.config.presets import load_settings
from lme.errors import InputError
from lme.simulation.crowd import Crowd
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.types import Pose, Twist
from lme.worlds.movers import REPEATS, Mover
from lme.worlds.world import World
from tests.builders import stage, task
from tests.tolerances import KERNEL

FAR = Pose(1e3, 0.0, 0.0)
LEAF = np.array([[0.0, 0.0], [0.9, 0.0], [0.9, 0.05], [0.0, 0.05]])
BOTH = pytest.mark.parametrize(
    "simulator_of",
    [
        lambda r: FastSimulator(load_settings("sim/fast"), r),
        lambda r: PhysicsSimulator(load_settings("sim/physics"), r),
    ],
)


def walker(path=((0.0, 0.0), (2.0, 0.0)), **changes):
    return Mover(path=np.array(path), **{"radius": 0.3, "speed": 0.5, **changes})


def after(mover, seconds, robot=FAR, dt=0.1):
    """Pose of the mover once this time has passed."""
    crowd = Crowd([mover])
    for _ in range(round(seconds / dt)):
        crowd.advance(robot, dt)
    return crowd.poses[0]


# --- on its way ---------------------------------------------------------------------------------------


def test_a_mover_walks_at_its_speed_and_stops_at_the_end():
    assert after(walker(), 1.0) == pytest.approx([0.5, 0.0, 0.0], abs=KERNEL)
    assert after(walker(), 9.0) == pytest.approx([2.0, 0.0, 0.0], abs=KERNEL)


def test_a_door_turns_about_its_hinge_at_its_rate():
    door = Mover(np.array([[1.0, 2.0, 0.0], [1.0, 2.0, 3.0]]), outline=LEAF, turn_rate=0.5)
    crowd = Crowd([door])
    for _ in range(10):
        crowd.advance(FAR, 0.1 * math.pi)
    assert crowd.poses[0] == pytest.approx([1.0, 2.0, math.pi / 2], abs=KERNEL)
    turned = np.array([[1.0, 2.0], [1.0, 2.9], [0.95, 2.9], [0.95, 2.0]])
    np.testing.assert_allclose(crowd.edges, np.hstack([turned, np.roll(turned, -1, axis=0)]), atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.sampled_from(REPEATS), st.floats(0.0, 30.0))
def test_a_crowd_is_where_the_slow_twin_says(seed, repeat, seconds):
    rng = np.random.default_rng(seed)
    path = rng.uniform(-3, 3, (rng.integers(1, 6), 3))
    mover = walker(path, speed=rng.uniform(0.2, 2), turn_rate=rng.uniform(0.2, 2), repeat=repeat)
    crowd = Crowd([mover])
    for part in rng.dirichlet(np.ones(7)):
        crowd.advance(FAR, part * seconds)
    assert crowd.poses[0] == pytest.approx(slow_pose(mover, seconds), abs=1e-7)


def slow_pose(mover, seconds):
    """Leg by leg, as one would walk it."""
    forth = list(mover.path)
    rounds = {"once": forth, "cycle": [*forth, forth[0]], "back_and_forth": forth + forth[-2::-1]}[
        mover.repeat
    ]
    legs = list(itertools.pairwise(rounds))
    here = forth[0]
    while len(forth) > 1:
        for start, end in legs:
            time = max(math.dist(start[:2], end[:2]) / mover.speed, abs(end[2] - start[2]) / mover.turn_rate)
            if seconds < time:
                return start + (end - start) * seconds / time
            seconds -= time
            here = end
        if mover.repeat == "once":
            break
    return here


# --- when it goes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("dt", [0.1, 0.07, 1.0])
def test_a_mover_starts_after_its_time_whatever_the_step(dt):
    late = walker(start_after=0.35)
    crowd, time = Crowd([late]), 0.0
    while time < 2.0:
        crowd.advance(FAR, dt)
        time += dt
    assert crowd.poses[0, 0] == pytest.approx(0.5 * (time - 0.35), abs=KERNEL)


def test_a_mover_starts_once_the_robot_is_near_and_continues_when_it_leaves():
    crowd = Crowd([walker(starts_within=1.0)])
    for robot, x in ((1.01, 0.0), (0.99, 0.1), (50.0, 0.2)):
        crowd.advance(Pose(0.0, robot, 0.0), 0.2)
        assert crowd.poses[0, 0] == pytest.approx(x, abs=KERNEL)


def test_the_place_that_a_mover_waits_for_may_be_elsewhere():
    crowd = Crowd([walker(starts_within=1.0, trigger=(5.0, 5.0))])
    crowd.advance(Pose(0.0, 0.0, 0.0), 1.0)
    assert crowd.poses[0, 0] == 0.0
    crowd.advance(Pose(5.0, 4.5, 0.0), 1.0)
    assert crowd.poses[0, 0] == pytest.approx(0.5, abs=KERNEL)


def test_a_mover_waits_for_a_robot_ahead_and_not_for_one_behind():
    cautious = walker(waits_within=1.0)
    assert after(cautious, 1.0, Pose(0.9, 0.0, 0.0))[0] == 0.0
    assert after(cautious, 1.0, Pose(-0.9, 0.0, 0.0))[0] == pytest.approx(0.5, abs=KERNEL)
    assert after(cautious, 0.4, Pose(1.5, 0.0, 0.0))[0] == pytest.approx(0.2, abs=KERNEL)
    # Up to 1 m before it, and on once it is gone.
    crowd = Crowd([cautious])
    for _ in range(300):
        crowd.advance(Pose(1.5, 0.0, 0.0), 0.01)
    assert crowd.poses[0, 0] == pytest.approx(0.5, abs=0.0051)
    crowd.advance(FAR, 1.0)
    assert crowd.poses[0, 0] == pytest.approx(1.0, abs=0.0051)


def test_a_mover_on_its_way_back_waits_for_a_robot_on_the_other_side():
    crowd = Crowd([walker(repeat="back_and_forth", waits_within=1.0)])
    for _ in range(50):
        crowd.advance(FAR, 0.1)
    crowd.advance(Pose(2.0, 0.0, 0.0), 0.1)
    assert crowd.poses[0, 0] == pytest.approx(1.45, abs=KERNEL)
    crowd.advance(Pose(1.0, 0.0, 0.0), 0.1)
    assert crowd.poses[0, 0] == pytest.approx(1.45, abs=KERNEL)


@pytest.mark.parametrize(
    "changes",
    [
        {"radius": None},
        pytest.param({"outline": LEAF}, id="radius and outline"),
        {"radius": 0.0},
        {"speed": -1.0},
        {"turn_rate": math.inf},
        {"start_after": -0.1},
        {"repeat": "twice"},
        {"trigger": (1.0, 2.0)},
        {"trigger": (1.0, math.nan), "starts_within": 1.0},
        {"path": [[0.0, math.nan]]},
        {"path": [[0.0]]},
        pytest.param({"radius": None, "outline": LEAF[:2]}, id="outline of two corners"),
    ],
    ids=str,
)
def test_invalid_mover_configs_are_refused(changes, says):
    with says.raises(InputError):
        walker(**changes)


# --- in a simulator -----------------------------------------------------------------------------------


@BOTH
def test_a_pedestrian_is_seen_where_it_is(simulator_of):
    robot = stage(fov=1.0, num_beams=3)
    simulator = simulator_of(robot)
    seen = simulator.reset(task(World(movers=(walker(((3.0, 0.0), (9.0, 0.0))),))), np.random.default_rng(0))
    assert seen.scan.ranges[1] == pytest.approx(2.7, abs=1e-6)
    for _ in range(5):
        seen = simulator.step(Twist(0.0, 0.0))
    assert seen.scan.ranges[1] == pytest.approx(3.2, abs=1e-6)


@BOTH
def test_a_pedestrian_that_walks_into_a_standing_robot_is_a_contact_at_that_moment(simulator_of):
    # Discs of 0.2 and 0.3 m, 2 m apart: they meet after 1.5 m at 0.5 m/s, in the midst of a period of 0.2 s.
    simulator = simulator_of(stage())
    simulator.reset(task(World(movers=(walker(((2.05, 0.0), (-2.0, 0.0))),))), np.random.default_rng(0))
    for _ in range(40):
        if simulator.state.contact:
            break
        simulator.step(Twist(0.0, 0.0))
    assert simulator.state.contact
    assert simulator.state.clearance == 0.0
    assert simulator.state.time == pytest.approx(3.1, abs=0.051)


@BOTH
@pytest.mark.parametrize(("clear", "contact"), [(0.02, False), (-0.02, True)])
def test_a_door_that_swings_past_hits_only_what_it_reaches(simulator_of, clear, contact):
    # The leaf's outer corner is 0.9 m (and 0.05 m thick) from the hinge; a robot of 0.2 m stands beyond.
    reach = math.hypot(0.9, 0.05)
    hinge = (reach + 0.2 + clear, 0.0)
    path = np.array([[*hinge, math.pi / 2], [*hinge, 3 * math.pi / 2]])
    simulator = simulator_of(stage())
    world = World(movers=(Mover(path, outline=LEAF, turn_rate=1.0),))
    simulator.reset(task(world), np.random.default_rng(0))
    least = math.inf
    for _ in range(20):
        simulator.step(Twist(0.0, 0.0))
        least = min(least, simulator.state.clearance)
        if simulator.state.contact:
            break
    assert simulator.state.contact == contact
    assert least == pytest.approx(max(clear, 0.0), abs=5e-4)


@BOTH
def test_reset_brings_everyone_back(simulator_of):
    simulator = simulator_of(stage())
    job = task(World(movers=(walker(((3.0, 0.0), (9.0, 0.0))),)))
    first = simulator.reset(job, np.random.default_rng(0)).scan.ranges
    assert (simulator.step(Twist(0.1, 0.0)).scan.ranges != first).any()
    np.testing.assert_array_equal(simulator.reset(job, np.random.default_rng(0)).scan.ranges, first)


def test_the_reactive_pedestrian_steps_in_as_the_robot_arrives_in_both():
    step_in = walker(((2.0, 1.5), (2.0, 0.0)), starts_within=1.0, trigger=(2.0, 0.0), speed=1.0)
    ends = []
    for simulator in (
        FastSimulator(load_settings("sim/fast"), stage()),
        PhysicsSimulator(load_settings("sim/physics"), stage()),
    ):
        simulator.reset(task(World(movers=(step_in,))), np.random.default_rng(0))
        while not (simulator.state.contact or simulator.state.arrived):
            simulator.step(Twist(0.5, 0.0))
        assert simulator.state.contact
        ends.append((*simulator.state.pose, simulator.state.time))
    assert ends[0] == pytest.approx(ends[1], abs=0.02)
