"""The BARN Challenge's recipe for ROS 2, over real topics: the simulator plays Gazebo under the challenge's names."""

import csv
import json
import subprocess

import pytest
import yaml

from tests.behaviour.ros.ros import Ros, end, missing, python_of
from tests.places import ROOT

RECIPE = ROOT / "integrations" / "barn_challenge" / "ros2"
INTERFACE = yaml.safe_load((RECIPE / "interface.yaml").read_text())
JACKAL = (  # the challenge's robot.yaml: a lidar at the front, as clearpath_sensors_description has it
    "robot=jackal",
    "robot.control_rate=20",
    "robot.lidar.x=0.12",
    "robot.lidar.num_beams=1080",
    "robot.lidar.range_min=0.06",
    "live.scan_rate=40",
    "live.step=0.0125",
)
NAMES = (
    "topics=jackal_ros2",
    "topics.scan=front/scan",
    f"live.scan_frame={INTERFACE['frames']['laser']['name']}",
    "live.goal=action",
)


@pytest.fixture(scope="module")
def ros(tmp_path_factory):
    python = python_of(2)
    if python is None:
        pytest.skip(missing(2))
    if subprocess.run([python, "-c", "import nav2_msgs, tf2_msgs"], capture_output=True).returncode:
        pytest.skip("nav2_msgs and tf2_msgs are not installed (tests/behaviour/ros/interfaces/build.sh)")
    with Ros(2, python, tmp_path_factory.mktemp("barn")) as running:
        yield running


@pytest.fixture
def node(ros):
    """The recipe's own script, with a prefix whose lme is the checkout's and whose kernels are compiled already."""
    prefix = ros.folder / "prefix"
    for folder in ("bin", "numba"):
        (prefix / folder).mkdir(parents=True, exist_ok=True)
    program = prefix / "bin" / "lme"
    program.write_text(f'#!/bin/bash\nunset NUMBA_CACHE_DIR\nexec {ros.python} -m runners.cli.main "$@"\n')
    program.chmod(0o755)
    words = ["env", f"LME_PREFIX={prefix}", str(RECIPE / "lme_node"), "system=lme_plus", "people=none"]
    return ros.start(words, "node")


def test_the_node_has_the_challenges_topics_types_and_action(ros, node):
    look = ros.start(
        [ros.python, "-m", "tests.behaviour.ros.graph", "lme"], "graph", stdout=subprocess.PIPE, text=True
    )
    found = json.loads(look.communicate(timeout=90)[0])
    for topic in INTERFACE["topics"]:
        assert found[topic["lme"]][topic["name"]] == [topic["type"]]
    assert found["action"] == {INTERFACE["action"]["name"]: [INTERFACE["action"]["type"]]}
    assert end(node) == 0, ros.log("node")


@pytest.mark.parametrize("count", [1, pytest.param(10, marks=pytest.mark.slow)])
def test_worlds_are_driven_to_goals_of_the_action(ros, node, count):
    worlds = f"map.worlds={list(range(0, 300, 300 // count))}".replace(" ", "")
    name = f"robot{count}"
    simulator = ros.lme("simulator", "--ros2", *JACKAL, *NAMES, worlds, name=name)
    assert simulator.wait(60 + 60 * count) == 0, ros.log(name)
    assert end(node) == 0, ros.log("node")
    with (ros.folder / name / "outcomes.csv").open() as file:
        driven = list(csv.DictReader(file))
    assert len(driven) == count
    failures = [row for row in driven if row["outcome"] != "success"]
    assert len(failures) <= count // 10, ros.log(name)
