"""However a node ends, the robot stands."""

import signal
from contextlib import nullcontext, suppress
from types import SimpleNamespace

import pytest

from runners.ros import run
from tests.behaviour.ros.test_safety import GOAL, _await_node, moves, stands


@pytest.fixture(scope="module")
def robot(ros):
    return ros.probe()


@pytest.mark.parametrize("ending", ["terminal", "rosnode"])
def test_the_robot_stands_when_its_node_is_ended(ros, robot, ending):
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


@pytest.mark.parametrize("came", [True, False])
def test_an_interrupt_that_pybind11_makes_another_error_of_ends_the_node_alike(monkeypatch, capsys, came):
    def drives(job, transport):
        with suppress(KeyboardInterrupt):
            if came:
                signal.raise_signal(signal.SIGINT)
        raise RuntimeError("Unable to convert call argument")

    monkeypatch.setattr(run, "drive_robot", drives)
    monkeypatch.setattr(run, "_simulates", lambda job: False)
    monkeypatch.setattr(run, "connect", lambda *given: SimpleNamespace(close=lambda: None))
    with nullcontext() if came else pytest.raises(RuntimeError):
        run.drive(SimpleNamespace(config=SimpleNamespace(ros=2)))
    assert capsys.readouterr().out == ("stopped\n" if came else "")
