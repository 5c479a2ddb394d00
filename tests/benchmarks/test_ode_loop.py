"""A robot that the Open Dynamics Engine moves in sim=gazebo."""

import math
import subprocess
from pathlib import Path
from shutil import which

import numpy as np
import pytest

from benchmarks.ode_loop import OdeSimulator
from lme.config.presets import load_settings
from lme.errors import InputError
from lme.simulation.skid import GazeboSimulator
from lme.types import Twist
from tests.builders import shipped, task

SOURCE = Path(__file__).parents[2] / "benchmarks" / "ode_jackal.cpp"


@pytest.fixture(scope="module")
def engine(tmp_path_factory):
    """The compiled program."""
    program = tmp_path_factory.mktemp("ode") / "ode_jackal"
    if which("g++") is None:
        pytest.skip("needs g++")
    if subprocess.run(["g++", "-O2", SOURCE, "-lode", "-o", program], capture_output=True).returncode != 0:
        pytest.skip("needs Debian's libode-dev")
    return program


def driven(kind, commands):
    """Final pose and odometry after these commands, from a start that is turned."""
    simulator = kind(load_settings("sim/gazebo", yaw_noise=0.0), shipped("jackal"))
    simulator.reset(task(start=(1.0, 2.0, 1.5), goal=(50.0, 0.0)), np.random.default_rng(0))
    for command in commands:
        observation = simulator.step(Twist(*command))
    return simulator.state.pose, observation.odometry


def test_it_drives_as_the_kernel_of_sim_gazebo(engine, monkeypatch):
    monkeypatch.setenv("ODE_JACKAL", str(engine))
    commands = [(1.0, 0.0)] * 5 + [(1.0, 1.0)] * 5
    (pose, odometry), (expected, expected_odometry) = (
        driven(kind, commands) for kind in (OdeSimulator, GazeboSimulator)
    )
    assert math.dist(pose[:2], expected[:2]) < 0.03
    assert pose.yaw == pytest.approx(expected.yaw, abs=0.05)
    assert odometry == pytest.approx(expected_odometry, abs=0.05)


def test_friction_that_is_fixed_to_the_world_is_refused():
    simulator = OdeSimulator(load_settings("sim/gazebo", friction="world"), shipped("jackal"))
    with pytest.raises(InputError, match=r"sim\.friction is 'world': must be wheel or body"):
        simulator.reset(task(goal=(50.0, 0.0)), np.random.default_rng(0))
