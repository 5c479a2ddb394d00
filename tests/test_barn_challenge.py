"""The files that bring LME into the BARN Challenge fit each other and `lme live`."""

import os
import shlex
from pathlib import Path

import pytest
from defusedxml import ElementTree

from runners.cli.main import main
from tests.composing import jobs_of

FOLDER = Path(__file__).parents[1] / "integrations" / "barn_challenge"


def started():
    """The words with which the node script starts lme."""
    (line,) = (line for line in (FOLDER / "lme_node").read_text().splitlines() if line.startswith("exec "))
    return shlex.split(line)[1:]


def test_the_launch_file_starts_the_node_under_the_name_of_the_action():
    (node,) = ElementTree.parse(FOLDER / "lme.launch").getroot().iter("node")
    assert node.get("name") == "move_base"
    assert node.get("pkg") == "jackal_helper"
    assert os.access(FOLDER / node.get("type"), os.X_OK)


def test_the_node_reads_the_challenges_topics_and_clock():
    lme, live, ros, *words, rest = started()
    assert (lme, live, ros, rest) == ("lme", "live", "ros1", "$@")
    with jobs_of("live") as job:
        config = job("live=ros1", "ros=1", *words).config
    assert config.robot.name == "jackal"
    assert (config.topics["scan"], config.topics["pose"]) == ("front/scan", "odometry/filtered")
    assert config.topics["command"] == "cmd_vel"
    assert config.live["use_sim_time"]


def test_arguments_of_roslaunch_are_not_arguments_of_lme(capsys):
    _, _, *words, _ = started()
    assert main(["live", *words, "__name:=move_base", "__log:=/tmp/node.log", "--cfg", "job"]) == 0
    assert "front/scan" in capsys.readouterr().out


@pytest.mark.parametrize("script", ["lme_node", "install.sh"])
def test_the_scripts_are_programs(script):
    assert os.access(FOLDER / script, os.X_OK)
    assert (FOLDER / script).read_text().startswith("#!/bin/bash\n")
