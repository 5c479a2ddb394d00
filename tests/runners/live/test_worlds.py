"""The node drives the simulated robot through ten BARN worlds over real topics, and does as `lme eval` does."""

import csv
import json
import statistics
import subprocess

import pytest

from runners.cli.main import main
from runners.records.records import read_episodes
from tests.runners.live.ros import end
from tests.tolerances import LIVE_TIME

WORLDS = f"map.worlds={list(range(0, 300, 30))}".replace(" ", "")
SPEED = {1: 4, 2: 3}  # simulated seconds per second


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory):
    """The records of `lme eval`: three runs, since single ones differ."""
    folder = tmp_path_factory.mktemp("eval")
    words = ["runs=3", "tracking=none", "executor=serial", f"hydra.run.dir={folder}"]
    assert main(["eval", "robot=jackal", WORLDS, *words]) == 0
    return read_episodes([folder])


def test_ten_worlds_over_real_topics_are_as_evaluated(ros, evaluated):
    robot = (
        "robot=jackal",
        "live.time_jump=20",
        "live.soft_stop=false",
        "live.use_sim_time=true",
        "record=mcap",
    )
    node = ros.lme(f"ros{ros.version}", *robot, name="node")
    simulator = ros.lme(
        "simulator",
        f"--ros{ros.version}",
        "robot=jackal",
        WORLDS,
        f"live.speed={SPEED[ros.version]}",
        name="robot",
    )
    assert simulator.wait(240) == 0, ros.log("robot")
    assert end(node) == 0
    with (ros.folder / "robot" / "outcomes.csv").open() as file:
        driven = list(csv.DictReader(file))
    assert len(driven) == 10
    successes = [float(row["time_s"]) for row in driven if row["outcome"] == "success"]
    assert len(successes) >= 9, ros.log("robot")  # one may differ by chance
    assert (evaluated.outcome == "success").sum() >= 28
    assert statistics.median(successes) == pytest.approx(evaluated.time_s.median(), rel=LIVE_TIME)
    check_recordings(ros.folder / "node")
    scores = [float(row["barn_metric"]) for row in driven]
    assert statistics.mean(scores) >= evaluated.barn_metric.mean() - 0.06  # one world of ten


def check_recordings(folder):
    """There is one for each goal, and lme replay makes the same decisions on it."""
    recordings = sorted(folder.glob("goal-*.mcap"))
    assert len(recordings) == 10
    replayed = folder.parent / "replayed"
    assert main(["replay", str(recordings[0]), "tracking=none", f"hydra.run.dir={replayed}"]) == 0
    assert json.loads((replayed / "agreement.json").read_text())["same_command"] == 1.0


def test_the_simulated_robot_stands_without_commands(ros):
    ros.lme("simulator", f"--ros{ros.version}", "robot=turtlebot2", "map.worlds=[0]", name="base")
    command = [ros.python, "-m", "tests.runners.live.joystick", str(ros.version)]
    said = json.loads(ros.start(command, "joystick", stdout=subprocess.PIPE).communicate(timeout=60)[0])
    assert said == {"fastest": pytest.approx(0.2, abs=0.01), "last": 0.0}
