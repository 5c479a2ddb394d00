"""A simulator that goes on in another world: what stays, what changes, in every simulator."""

from dataclasses import replace

import numpy as np
import pytest

from lme.config.presets import load_settings
from lme.simulation.fast import FastSimulator
from lme.simulation.physics import PhysicsSimulator
from lme.simulation.skid.simulator import SkidSimulator
from lme.types import Twist
from lme.worlds.movers import Mover
from lme.worlds.world import World
from tests.builders import CAP, room, shipped, task

FORWARD = Twist(0.5, 0.1)
WALL = World(segments=np.vstack([room().segments, [[2.0, -5.0, 2.0, 5.0]]]))


def simulators():
    """Each simulator, without and with substeps."""
    yield "fast", FastSimulator(load_settings("sim/fast"), shipped("turtlebot2"))
    yield "delayed", FastSimulator(load_settings("sim/fast", latency=0.2), shipped("turtlebot2"))
    yield "physics", PhysicsSimulator(load_settings("sim/physics"), shipped("turtlebot2"))
    yield "skid", SkidSimulator(load_settings("sim/skid"), shipped("jackal").capped(CAP))


CASES = [pytest.param(simulator, id=name) for name, simulator in simulators()]


def under_way(simulator, world=None, steps=8):
    """A simulator whose robot moves."""
    start = task(world or room())
    simulator.reset(start, np.random.default_rng(0))
    for _ in range(steps):
        simulator.step(FORWARD)
    return start


def person(x, y):
    return Mover(path=np.array([[x, y], [x, y + 3.0]]), radius=0.25, repeat="back_and_forth")


@pytest.mark.parametrize("simulator", CASES)
def test_the_robot_goes_on_as_it_was(simulator):
    before = under_way(simulator)
    state = simulator.state
    seen = simulator.change(replace(before, world=WALL))
    now = simulator.state
    assert (now.pose, now.time) == (state.pose, state.time)
    assert now.twist == pytest.approx(state.twist, abs=1e-9)
    assert (now.contact, now.arrived) == (False, False)
    assert now.clearance < state.clearance
    assert seen.twist.v == pytest.approx(state.twist.v, abs=0.05)
    ahead = seen.scan.ranges[
        np.argmin(np.abs(seen.scan.angle_min + np.arange(len(seen.scan.ranges)) * seen.scan.angle_increment))
    ]
    assert ahead == pytest.approx(2.0 - state.pose.x, abs=0.15)
    simulator.step(FORWARD)
    assert simulator.state.pose.x > state.pose.x


@pytest.mark.parametrize("simulator", CASES)
def test_it_runs_into_a_wall_that_was_not_there_before(simulator):
    before = under_way(simulator)
    simulator.change(replace(before, world=WALL))
    for _ in range(200):
        if simulator.state.contact:
            break
        simulator.step(FORWARD)
    assert simulator.state.contact
    assert simulator.state.pose.x < 2.0
    simulator.change(before)  # and out again
    assert not simulator.state.contact


@pytest.mark.parametrize("simulator", CASES)
def test_a_wall_upon_the_robot_is_a_contact_at_once(simulator):
    before = under_way(simulator)
    x = simulator.state.pose.x
    simulator.change(replace(before, world=World(segments=np.array([[x, -1.0, x, 1.0]]))))
    assert simulator.state.contact
    assert simulator.state.clearance == 0.0


@pytest.mark.parametrize("simulator", CASES)
def test_the_goal_moves(simulator):
    before = under_way(simulator)
    pose = simulator.state.pose
    seen = simulator.change(replace(before, goal=np.array([pose.x + 1.0, pose.y])))
    assert np.hypot(*seen.target) == pytest.approx(1.0, abs=0.1)
    simulator.change(replace(before, goal=np.array(pose[:2])))
    assert simulator.state.arrived


@pytest.mark.parametrize("simulator", CASES)
def test_who_walks_goes_on_and_who_comes_begins(simulator):
    first, second = person(3.0, -3.0), person(-2.0, 1.0)
    world = replace(room(), movers=(first,))
    before = under_way(simulator, world)
    (walked,) = simulator.people[0]
    simulator.change(replace(before, world=replace(world, movers=(second, first))))
    circles = simulator.people[0].copy()
    assert circles[1] == pytest.approx(walked)
    assert circles[0] == pytest.approx([-2.0, 1.0, 0.25])
    simulator.step(FORWARD)
    assert (simulator.people[0][:, 1] > circles[:, 1]).all()
    simulator.change(replace(before, world=room()))
    assert len(simulator.people[0]) == 0
    simulator.step(FORWARD)


@pytest.mark.parametrize("simulator", CASES)
def test_a_person_comes_into_a_world_without_any(simulator):
    before = under_way(simulator)
    time = simulator.state.time
    simulator.change(replace(before, world=replace(room(), movers=(person(3.0, -3.0),))))
    circles, edges = simulator.obstacles
    assert circles[-1] == pytest.approx([3.0, -3.0, 0.25])
    assert len(edges) == 4
    for _ in range(5):
        simulator.step(FORWARD)
    assert simulator.people[0][0, 1] == pytest.approx(-3.0 + (simulator.state.time - time), abs=0.15)


@pytest.mark.parametrize("simulator", CASES)
def test_a_change_to_the_same_world_leads_to_the_same_place(simulator):
    before = under_way(simulator)
    for _ in range(6):
        simulator.step(FORWARD)
    straight = simulator.state.pose
    under_way(simulator)
    simulator.change(before)
    for _ in range(6):
        simulator.step(FORWARD)
    assert simulator.state.pose == pytest.approx(straight, abs=1e-6)


def test_people_who_react_keep_their_plans():
    walkers = tuple(replace(person(x, -3.0), motion="orca") for x in (-2.0, 2.0, 3.0))
    simulator = FastSimulator(load_settings("sim/fast"), shipped("turtlebot2"))
    world = replace(room(), movers=walkers)
    before = under_way(simulator, world, steps=12)
    changed = replace(before, world=replace(world, movers=walkers[1:]))
    circles, velocities = (part.copy() for part in simulator.people)
    simulator.change(changed)
    assert simulator.people[0] == pytest.approx(circles[1:])
    assert simulator.people[1] == pytest.approx(velocities[1:])
    simulator.step(FORWARD)
    assert (simulator.people[0][:, 1] > circles[1:, 1]).all()
