"""Where packages are missing that only experiments need, a command says so in one line."""

import os
import subprocess
import sys

import pytest

from runners.cli.guards import PACKAGES, explain_missing
from tests.lme.test_requirements import EXPERIMENTS
from tests.places import ROOT

MAIN = """
import sys
sys.modules.update(dict.fromkeys({left_out!r}))
from runners.cli.main import main
sys.exit(main())
"""
ONLY_LIVE = [
    *PACKAGES.keys() - {"hydra", "omegaconf", "packaging"},
    "rclpy",
]  # there are no others, nor ROS 2


def lme(*words, without):
    return subprocess.run(
        [sys.executable, "-c", MAIN.format(left_out=without), *words],
        capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, timeout=120,
    )  # fmt: skip


def test_the_named_packages_are_those_that_the_robot_installation_omits():
    assert set(PACKAGES.values()) == EXPERIMENTS


@pytest.mark.parametrize("command", ["doctor", "eval", "explain", "figure", "learn", "table", "train"])
def test_in_the_library_alone_a_command_says_what_it_needs(command, says):
    done = lme(command, "maps", without=[*PACKAGES])
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert done.stderr.startswith(f"lme {command}: needs ")
    says(done.stderr)


def test_lme_live_names_its_own_extra():
    done = lme("live", "ros2", without=[*PACKAGES])
    assert (done.returncode, done.stderr) == (
        1,
        "lme live: needs hydra-core, which is not installed; pip install './lme[live]' in a checkout of lme "
        "installs what lme live needs\n",
    )


def test_lme_live_needs_hydra_alone(says):
    """It composes the config, checks it and builds the navigator before it looks for ROS."""
    done = lme("live", "ros2", "robot=turtlebot2", without=ONLY_LIVE)
    assert done.returncode == 2
    says(done.stderr)


def test_a_missing_module_that_is_not_a_requirement_keeps_its_traceback():
    assert explain_missing(ModuleNotFoundError("No module named 'nope'", name="nope"), "eval") == ""
    assert explain_missing(ModuleNotFoundError("no name"), "eval") == ""
