"""A user's own map set with a bad goal, as `lme eval` meets it: one line that names the map, the world and the file."""

import re
import sys

import pytest

from runners.cli.main import main

MODULE = """\
from dataclasses import dataclass, field

import numpy as np

from lme.types import Pose
from lme.worlds.world import Task, World

BOX = np.array([[3.5, -0.5], [4.5, -0.5], [4.5, 0.5], [3.5, 0.5]])


@dataclass(slots=True)
class Config:
    goal: list[float] = field(default_factory=lambda: [6.0, 0.0])


class Hall:
    Config = Config
    numbers = (0, 1)

    def __init__(self, config):
        self.goal = np.array(config.goal)

    def task(self, number):
        return Task("hall", number, World(polygons=(BOX,)), Pose(0.0, 0.0, 0.0), self.goal, 0.3, 60.0, 0.1, 6.0, 12.0)
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The class and its option `map=hall`."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "my_hall.py").write_text(MODULE)
    (tmp_path / "own" / "map").mkdir(parents=True)
    (tmp_path / "own" / "map" / "hall.yaml").write_text(
        "# A hall\n_target_: my_hall.Hall\ngoal: [6.0, 0.0]\n"
    )
    yield tmp_path
    sys.modules.pop("my_hall", None)


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        ("[4,0]", r"the goal \(4, 0\) lies inside an obstacle: must be free"),
        ("[3.4,0]", r"the goal \(3\.4, 0\) is 0\.1 m from an obstacle: must be at least 0\.2 m"),
        ("[nan,0]", r"has a goal of which 1 of 2 numbers are not finite: must be \(x \[m\], y \[m\]\)"),
        ("[6]", r"has a goal of shape \(1,\): must be \(x \[m\], y \[m\]\), of shape \(2,\)"),
    ],
)
def test_a_bad_goal_is_one_line(folder, capsys, goal, said):
    words = ["map=hall", f"map.goal={goal}", "robot=stage", "runs=1", "executor=serial", "tracking=none"]
    assert main(["eval", "--config-dir=own", *words]) == 2
    (line,) = [
        line for line in capsys.readouterr().err.splitlines() if not line.startswith("lme eval: kept with")
    ]
    assert re.fullmatch(rf"lme eval: map hall, world 0: {said}.* \(in {folder}/own/map/hall\.yaml\)", line)
    assert not list(folder.glob("outputs/eval/*/episodes.parquet"))
