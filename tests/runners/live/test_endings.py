"""However a node ends, the robot stands."""

import signal

import pytest

from tests.runners.live.test_safety import GOAL, _await_node, moves, stands


@pytest.fixture(scope="module")
def robot(ros):
    return ros.probe()


@pytest.mark.parametrize("ending", ["terminal", "rosnode"])
def test_it_stands_when(ros, robot, ending):
    if ending == "rosnode" and ros.version == 2:
        pytest.skip("rosnode belongs to ROS 1")
    node = ros.lme(f"ros{ros.version}", "robot=turtlebot2", "live.clock=received", name=ending)
    _await_node(robot)
    robot.set(goal=GOAL)
    robot.until(moves)
    if ending == "rosnode":
        ros.start(["rosnode", "kill", "/lme"], "kill")
    else:
        node.send_signal(signal.SIGHUP)
    robot.until(stands, timeout=30.0)
    assert node.wait(20) == 0
    assert not robot.commands(0.5)
