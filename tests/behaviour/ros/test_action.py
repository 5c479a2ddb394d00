"""The navigation action, with a real client."""

import json
import subprocess
import time

import pytest

from tests.behaviour.ros.test_safety import assert_stands, moves

PACKAGES = {1: "move_base_msgs", 2: "nav2_msgs"}
CANCELLED = {1: "preempted", 2: "canceled"}
DISPLACED = {1: "preempted", 2: "aborted"}


@pytest.fixture(scope="module")
def robot(ros):
    package = PACKAGES[ros.version]
    look = f"import runners.ros.ros{ros.version} as r; r.check_installed(); import {package}"
    if ros.start([ros.python, "-c", look], "look").wait(60):
        pytest.skip(f"the package {package} is not installed")
    ros.lme(f"ros{ros.version}", "robot=turtlebot2")
    probe = ros.probe()
    time.sleep(1.0)
    return probe


@pytest.fixture
def client(ros):
    def start(*words):
        command = [ros.python, "-m", "tests.behaviour.ros.client", str(ros.version), *map(str, words)]
        return ros.start(command, "client", stdout=subprocess.PIPE, text=True)

    return start


def end_of(client):
    """The final state that a client saw, and how many feedbacks."""
    said = json.loads(client.communicate(timeout=60)[0])
    return said["state"], said["feedbacks"]


def test_a_goal_that_is_reached_succeeds(robot, client):
    assert end_of(client(0.1, 0.0))[0] == "succeeded"


def test_cancel_stops_the_robot(ros, robot, client):
    driving = client(50.0, 0.0, 3.0)
    robot.until(moves, timeout=60.0)
    state, feedbacks = end_of(driving)
    assert state == CANCELLED[ros.version]
    assert feedbacks >= 5
    assert_stands(robot, 0.5)


def test_a_goal_of_another_client_replaces_the_current_one(ros, robot, client):
    driving = client(50.0, 0.0)
    robot.until(moves, timeout=60.0)
    robot.set(goal=[0.0, 50.0])
    assert end_of(driving)[0] == DISPLACED[ros.version]
    robot.until(lambda said: said.get("omega", 0.0) > 0.1)


def test_a_goal_that_is_not_finite_is_aborted(robot, client):
    assert end_of(client("nan", 0.0))[0] == "aborted"
