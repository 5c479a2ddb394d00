"""What goes wrong on a real robot, over real topics: it must stand in time, and continue when all is well again."""

import signal
import time

import pytest

STALE = 0.5  # [s] live.stale
LATE = 0.5  # [s] more that a busy machine may take
GOAL = [50.0, 0.0]  # far ahead


@pytest.fixture(scope="module")
def node(ros):
    return ros.lme(f"ros{ros.version}", "robot=turtlebot2", "live.clock=received", name="node")


@pytest.fixture(scope="module")
def robot(ros, node):
    probe = ros.probe()
    _await_node(probe)
    return probe


@pytest.fixture
def driving(robot):
    """The robot, driving to a goal ahead."""
    robot.set(scan="good", odometry="good", clock="real")
    robot.set(goal=GOAL)
    robot.until(moves)
    return robot


def moves(said):
    return abs(said.get("v", 0.0)) + abs(said.get("omega", 0.0)) > 0.0


def stands(said):
    return "v" in said and not moves(said)


def assert_stands(robot, within=STALE + LATE):
    """It is stopped within this time, and stays stopped."""
    time.sleep(within)
    assert not any(abs(v) + abs(omega) for _, v, omega in robot.commands(0.5))


def _await_node(robot):
    """Send goals until the node answers, which may still load compiled code."""
    deadline = time.monotonic() + 90.0
    while time.monotonic() < deadline:
        robot.set(goal=GOAL)
        try:
            return robot.until(moves, timeout=2.0)
        except AssertionError:
            continue
    raise AssertionError("the node sends no commands")


@pytest.mark.parametrize("sensor", ["scan", "odometry"])
def test_the_robot_stands_while_a_publisher_is_gone_and_then_drives_again(driving, sensor):
    driving.set(**{sensor: None})
    gone = time.monotonic()
    assert driving.until(stands)["time"] - gone < STALE + LATE
    assert_stands(driving, 0.0)
    driving.set(**{sensor: "good"})
    driving.until(moves)


@pytest.mark.parametrize(
    "garbage",
    [{"scan": "empty"}, {"scan": "nan"}, {"odometry": "nan"}],
    ids=lambda one: "-".join(*one.items()),
)
def test_the_robot_stands_on_garbage_messages(driving, garbage):
    driving.set(**garbage)
    assert_stands(driving)
    driving.set(scan="good", odometry="good")
    driving.until(moves)


def test_the_node_says_why_the_robot_stands(driving):
    driving.set(scan=None)
    assert "scan" in driving.until(lambda said: "stopped" in said.get("reason", ""))["reason"]


def test_rviz_and_diagnostics_get_messages(driving):
    driving.set(watch=True)
    seen = driving.until(lambda said: "groups" in said)
    assert {"candidates", "sectors", "subgoal", "target"} <= set(seen["groups"])
    assert seen["frame"] == "base_link"
    told = driving.until(lambda said: said.get("status") == "driving")
    assert float(told["values"]["median decision [ms]"]) > 0.0


def test_a_second_goal_takes_the_place_of_the_first(driving):
    driving.set(goal=[0.0, 50.0])
    assert driving.until(lambda said: said.get("omega", 0.0) > 0.1)
    driving.set(goal=[0.0, -50.0])
    assert driving.until(lambda said: said.get("omega", 0.0) < -0.1)


def test_a_goal_that_is_not_finite_changes_nothing(driving):
    driving.set(goal=[float("nan"), 0.0])
    time.sleep(0.5)
    driving.until(moves)


def test_the_robot_stands_after_cancel_until_the_next_goal(driving):
    driving.set(cancel=True)
    assert_stands(driving, LATE)
    driving.set(goal=GOAL)
    driving.until(moves)


def test_a_goal_in_a_frame_that_nobody_knows_is_not_driven_to(driving):
    driving.set(goal=GOAL, frame="moon")
    assert_stands(driving)


def test_the_robot_stands_when_the_node_ends_and_while_the_clock_is_frozen(ros, node, driving):
    node.send_signal(signal.SIGTERM)
    asked = time.monotonic()
    assert driving.until(stands)["time"] - asked < LATE
    assert node.wait(20) == 0
    assert not driving.commands(0.5)
    driving.set(clock="running")
    ros.lme(f"ros{ros.version}", "robot=turtlebot2", "live.use_sim_time=true", name="again")
    _await_node(driving)
    driving.set(clock="frozen")
    assert_stands(driving)
    driving.set(clock="running")
    driving.until(moves)
