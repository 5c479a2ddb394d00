"""`pip install ./lme` and `pip install './lme[live]'`, for a robot: what they install, and that it drives."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest

from tests.lme.test_requirements import EXPERIMENTS
from tests.places import ROOT

pytestmark = pytest.mark.slow
CLEAN = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
DRIVE = """
from pathlib import Path

import lme
from lme.live.step import LiveState, LiveStep
from runners.config import build
from runners.ros.mcap_drives import LiveRecorder
from tests.composing import jobs_of
from tests.live_loop import drive_live

with jobs_of("live", "live=ros2", "ros=2", "robot=jackal", "record=mcap") as job_of:
    config = job_of().config
recorders = []

def listen(driver, step):
    recorders.append(recorders[0] if recorders else LiveRecorder(Path(), config, driver))
    recorders[0].take(step)

task = lme.Barn(lme.load_settings("map/barn", worlds=[210])).task(210)
simulator = lme.FastSimulator(lme.load_settings("sim/fast"), config.robot)
driver, steps, outcome, _ = drive_live(
    task, lambda robot: build.navigator(config, robot), config.robot, simulator, listen=listen
)
recorders[0].take(LiveStep(steps[-1].stamp + 10**8, LiveState.ARRIVED, "arrived", goal=1, motion=steps[-1].motion))
print(outcome, lme.__file__)
"""


class Installed:
    """A fresh environment with one installation of this checkout."""

    def __init__(self, folder, what):
        subprocess.run([sys.executable, "-m", "venv", folder / "env"], check=True, timeout=300)
        self.folder, self.bin = folder, folder / "env" / "bin"
        self.install(what)

    def install(self, *words):
        """pip in the checkout."""
        command = [self.bin / "pip", "install", "--quiet", *words]
        subprocess.run(command, check=True, cwd=ROOT, env=CLEAN, timeout=1200)

    def __call__(self, program, *words):
        """A program of the environment, called in a folder outside the checkout."""
        command = [self.bin / program, *words]
        return subprocess.run(
            command, cwd=self.folder, env=CLEAN, capture_output=True, text=True, timeout=600
        )

    def packages(self):
        listed = self("pip", "list", "--format", "json")
        return {each["name"].lower() for each in json.loads(listed.stdout)}

    def place(self):
        """Where `import lme` finds it."""
        return self("python", "-c", "import lme; print(lme.__file__)").stdout


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return Installed(tmp_path_factory.mktemp("library"), "./lme")


@pytest.fixture(scope="module")
def live(tmp_path_factory):
    return Installed(tmp_path_factory.mktemp("live"), "./lme[live,replay]")


def test_the_library_alone_has_nothing_that_only_experiments_need(library):
    assert not EXPERIMENTS & library.packages()
    assert library("pip", "check").returncode == 0


def test_the_library_alone_makes_a_decision(library):
    page = (ROOT / "docs" / "reference" / "python.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n([^`]*escaper\.decide[^`]*)^```$", page, re.M)
    done = library("python", "-c", code)
    assert (done.returncode, done.stderr) == (0, "")
    assert "first subgoal" in done.stdout


@pytest.mark.parametrize("example", ["own_planner", "escaper_on_a_scan"])
def test_the_library_alone_drives(library, example):
    done = library("python", ROOT / "examples" / f"{example}.py")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.match("success after|subgoal:", done.stdout)


@pytest.mark.parametrize("command", ["eval", "train", "live"])
def test_the_library_alone_says_in_one_line_what_a_command_needs(library, command):
    done = library("lme", command, *(["ros2"] if command == "live" else []))
    assert (done.returncode, done.stdout) == (1, "")
    assert re.fullmatch(rf"lme {command}: needs hydra-core, .*\n", done.stderr)


def test_lme_live_adds_hydra_alone(live):
    assert EXPERIMENTS & live.packages() == {"hydra-core", "packaging"}
    done = live("lme", "live", "ros2", "robot=turtlebot2", "record=mcap")
    assert re.fullmatch(r"lme live: ROS 2 is not installed: .*\n", done.stderr)
    assert "topics=" in live("lme", "live", "--help").stdout
    assert "No problems." in live("lme", "doctor").stdout


def test_a_live_drive_is_recorded_without_pandas(live):
    for name in ("__init__", "composing", "live_loop", "made_bags"):
        (live.folder / "tests").mkdir(exist_ok=True)
        shutil.copy(ROOT / "tests" / f"{name}.py", live.folder / "tests")
    done = live("python", "-c", DRIVE)
    assert (done.returncode, done.stderr) == (0, "")
    outcome, place = done.stdout.split()
    assert outcome == "success"
    assert place.startswith(str(live.folder))
    assert (live.folder / "goal-1.mcap").stat().st_size > 10_000


def test_pip_replaces_one_installation_by_the_other(live):
    """Both have one name, so neither is ever installed over the other's files."""
    live.install("--no-deps", "--editable", ".")
    assert live.place() == f"{ROOT}/lme/__init__.py\n"
    live.install("--no-deps", "./lme")
    assert live.place().startswith(str(live.folder))
    assert live("pip", "uninstall", "--yes", "lme-nav").returncode == 0
    assert live.place() == ""
