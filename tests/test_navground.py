"""LME as a behaviour of a navground agent."""

import math

import numpy as np
import pytest
import yaml

import lme
from tests.integration_scripts import load

sim = pytest.importorskip("navground.sim")
behavior, table = load("lme_navground"), load("navground_table")


def world_of(*agents, obstacles=()):
    """A world with agents and discs (x, y, radius)."""
    discs = [{"position": [x, y], "radius": radius} for x, y, radius in obstacles]
    return sim.World.load(yaml.safe_dump({"agents": list(agents), "obstacles": discs}))


def agent(position=(0.0, 0.0), orientation=0.0, goal=(6.0, 0.0), system="lme_plus", **changes):
    """An agent of LME with a Lidar and a sensor of its neighbours."""
    return {
        "type": "agent",
        "position": list(position),
        "orientation": orientation,
        "radius": 0.25,
        "control_period": table.DT,
        "kinematics": {"type": "2WDiff", "wheel_axis": 0.5, "max_speed": 1.0},
        "behavior": {"type": "LME", "system": system, "optimal_speed": 0.8},
        "task": {"type": "Waypoints", "waypoints": [list(goal)], "loop": False, "tolerance": 0.2},
        "state_estimations": [table.LIDAR, table.NEIGHBOURS],
        **changes,
    }


def neighbour(position, velocity):
    """An agent that drives straight, whatever is in its way."""
    dummy = {"type": "Dummy", "optimal_speed": float(np.hypot(*velocity))}
    task = {"type": "Direction", "direction": list(velocity)}
    return {
        "type": "other",
        "position": list(position),
        "radius": 0.3,
        "control_period": table.DT,
        "kinematics": {"type": "Omni", "max_speed": 2.0},
        "behavior": dummy,
        "task": task,
    }


def test_an_agent_drives_round_a_disc_to_its_waypoint():
    world = world_of(agent(), obstacles=[(3.0, 0.0, 0.6)])
    collided = set()
    for _ in range(200):
        world.update(table.DT)
        collided |= set(world.collisions)
        if world.agents_are_idle():
            break
    assert math.dist(world.agents[0].position, (6.0, 0.0)) < 0.3
    assert not collided


def test_robot_and_scan_are_those_of_the_agent():
    world = world_of(agent(orientation=math.pi / 2), obstacles=[(2.0, 0.0, 0.5)])
    world.update(table.DT)
    made = world.agents[0].behavior
    robot = made._robot
    assert robot.footprint == lme.Footprint(radius=0.25)
    assert (robot.v_max, robot.omega_max, robot.limits.v_min) == pytest.approx((0.8, 4.0, 0.0))
    scan = behavior.LidarStateEstimation.read_scan_with_name(made._state, "")
    seen = behavior.scan_of(scan, robot.lidar)
    expected = lme.cast(robot.lidar, lme.Pose(0.0, 0.0, math.pi / 2), [[2.0, 0.0, 0.5]])
    assert len(seen.ranges) == 180
    hit = np.isfinite(seen.ranges)
    assert hit.sum() > 10
    assert seen.ranges[hit] == pytest.approx(expected.ranges[hit], abs=1e-3)


def test_neighbours_are_in_the_agents_frame_and_their_velocity_is_over_ground():
    world = world_of(agent(orientation=math.pi / 2, goal=(0.0, 6.0)), neighbour((2.0, 1.0), (0.0, -0.5)))
    for _ in range(3):
        world.update(table.DT)
    robot, other = world.agents
    x, y, yaw = *robot.position, robot.orientation
    known = behavior.neighbours(robot.behavior._state)
    assert known.shape == (1, 4)
    where = behavior.rotated(np.asarray(other.position) - (x, y), -yaw)
    assert known[0, :2] == pytest.approx(where, abs=0.2)  # it was seen before the last step
    assert known[0, 2:] == pytest.approx(behavior.rotated(np.array([0.0, -0.5]), -yaw), abs=0.2)
    assert known[0, 2] < -0.3  # the neighbour drives towards −y, and the agent looks along y


def test_without_that_sensor_nobody_is_known_to_move():
    world = world_of(agent(state_estimations=[table.LIDAR]), neighbour((3.0, 1.0), (0.0, -0.5)))
    world.update(table.DT)
    assert behavior.neighbours(world.agents[0].behavior._state).shape == (0, 4)


def test_an_agent_without_a_task_stands():
    given = agent()
    del given["task"]
    world = world_of(given)
    for _ in range(5):
        world.update(table.DT)
    assert np.asarray(world.agents[0].position) == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("scenario", table.SCENARIOS)
def test_a_run_of_the_table_gives_shares(scenario, monkeypatch):
    monkeypatch.setattr(table, "DURATION", 1.0)
    run = table.drive(scenario, "LME+, scan alone", 0)
    assert -1.0 <= run.efficacy <= 1.0
    assert (0.0 <= run.collided <= 1.0, 0.0 <= run.stuck <= 1.0) == (True, True)
