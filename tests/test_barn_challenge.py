"""The files that bring LME into the BARN Challenge fit each other and `lme live`."""

import os
import runpy
import shlex
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml
from defusedxml import ElementTree

from runners.cli.main import main
from runners.config.instantiate import fill_dataclass
from runners.ros.topics import TF_MESSAGE, LiveTopicsConfig
from tests.composing import jobs_of

FOLDER = Path(__file__).parents[1] / "integrations" / "barn_challenge"
INTERFACE = yaml.safe_load((FOLDER / "ros2" / "interface.yaml").read_text())
SOURCED = [*INTERFACE["topics"], INTERFACE["action"], *INTERFACE["frames"].values()]


def started(script="lme_node"):
    """The words with which the node script starts lme."""
    text = (FOLDER / script).read_text().replace("\\\n", " ")
    (line,) = (line for line in text.splitlines() if line.startswith("exec "))
    return shlex.split(line)[1:]


@pytest.fixture
def launched(monkeypatch):
    """Runs lme.launch.py of ROS 2 with stand-ins for the package launch; returns the process's command and options."""
    arguments, processes = {}, []
    stand_ins = {
        "launch": {"LaunchContext": dict, "LaunchDescription": list},
        "launch.actions": {
            "DeclareLaunchArgument": lambda name, default_value, **_: arguments.update({name: default_value}),
            "ExecuteProcess": lambda cmd, **options: processes.append((cmd, options)),
            "OpaqueFunction": lambda function: function,
            "Shutdown": lambda **_: "shutdown",
        },
        "launch.substitutions": {
            "LaunchConfiguration": lambda name: SimpleNamespace(perform=lambda context: context[name])
        },
    }
    for name, members in stand_ins.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**members))

    def launch(**given):
        *_, start = runpy.run_path(str(FOLDER / "ros2" / "lme.launch.py"))["generate_launch_description"]()
        start(arguments | given)
        return processes.pop()

    return launch


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


def test_ros2_has_the_names_and_types_of_the_challenges_launch_files(launched):
    lme, live, ros, *words, rest = started("ros2/lme_node")
    assert (lme, live, ros, rest) == ("$prefix/bin/lme", "live", "ros2", "$@")
    (_, *args), _ = launched()
    with jobs_of("live") as job:
        config = job("live=ros2", "ros=2", *words, *args).config
    assert (config.system.label, config.people) == ("LME+", "none")
    assert config.live["use_sim_time"]
    topics = fill_dataclass(LiveTopicsConfig, config.topics, "topics")
    kinds = {
        "scan": topics.scan_kind,
        "pose": topics.pose_kind,
        "command": topics.command_kind,
        "clock": "rosgraph_msgs/Clock",
        "tf": TF_MESSAGE,
        "tf_static": TF_MESSAGE,
    }
    for topic in INTERFACE["topics"]:
        key = topic["key"]
        assert "/" + getattr(topics, key).lstrip("/") == topic["name"]
        assert kinds.pop(key) == topic["type"].replace("/msg/", "/")
    assert not kinds
    assert "/" + topics.action_in(2) == INTERFACE["action"]["name"]


def test_the_launch_file_of_ros2_starts_the_node_and_ends_with_it(launched):
    (node, *words), options = launched(args="system=lme robot.v_max=1")
    assert (node, words) == ("/lme/bin/lme_node", ["system=lme", "robot.v_max=1"])
    assert options["on_exit"] == "shutdown"


@pytest.mark.parametrize("row", SOURCED, ids=lambda row: row["name"])
def test_the_challenges_files_say_so(row):
    checkout = os.environ.get("BARN_CHALLENGE_ROS2")
    if checkout is None:
        pytest.skip("BARN_CHALLENGE_ROS2 may name a checkout of the challenge's ROS 2 repository")
    for file, text in row["says"].items():
        assert text in (Path(checkout) / file).read_text()


@pytest.mark.parametrize("script", ["lme_node", "install.sh", "ros2/lme_node", "ros2/install.sh"])
def test_the_scripts_are_programs(script):
    assert os.access(FOLDER / script, os.X_OK)
    assert (FOLDER / script).read_text().startswith("#!/bin/bash\n")
