"""The node drives the simulated robot through BARN worlds over real topics, and does as `lme eval` does."""

import csv
import json
import statistics
import subprocess

import pytest

from runners.cli.main import main
from runners.records.records import read_episodes
from tests.behaviour.ros.ros import end
from tests.tolerances import LIVE_TIME

SPEED = {1: 4, 2: 3}  # simulated seconds per second


def evaluated(worlds, folder):
    """The records of `lme eval`: three runs, since single ones differ."""
    words = ["runs=3", "tracking=none", "executor=serial", f"hydra.run.dir={folder}"]
    assert main(["eval", "robot=jackal", "sim=fast", worlds, *words]) == 0
    return read_episodes([folder])


@pytest.mark.parametrize("count", [3, pytest.param(10, marks=pytest.mark.slow)])
def test_worlds_over_real_topics_are_driven_as_evaluated(ros, count, tmp_path):
    worlds = f"map.worlds={list(range(0, 300, 300 // count))}".replace(" ", "")
    records = evaluated(worlds, tmp_path / "eval")
    robot = (
        "robot=jackal",
        "live.time_jump=20",
        "live.soft_stop=false",
        "live.use_sim_time=true",
        "record=mcap",
    )
    node = ros.lme(f"ros{ros.version}", *robot, name=f"node{count}")
    simulator = ros.lme(
        "simulator",
        f"--ros{ros.version}",
        "robot=jackal",
        worlds,
        f"live.speed={SPEED[ros.version]}",
        name=f"robot{count}",
    )
    assert simulator.wait(240) == 0, ros.log(f"robot{count}")
    assert end(node) == 0
    with (ros.folder / f"robot{count}" / "outcomes.csv").open() as file:
        driven = list(csv.DictReader(file))
    assert len(driven) == count
    successes = [float(row["time_s"]) for row in driven if row["outcome"] == "success"]
    assert len(successes) >= count - 1, ros.log(f"robot{count}")  # one may differ by chance
    assert (records.outcome == "success").sum() >= 3 * count - 2
    assert statistics.median(successes) == pytest.approx(records.time_s.median(), rel=LIVE_TIME)
    check_recordings(ros.folder / f"node{count}", count)
    scores = [float(row["barn_metric"]) for row in driven]
    assert statistics.mean(scores) >= records.barn_metric.mean() - 0.6 / count  # one world


def check_recordings(folder, count):
    """There is one for each goal, and lme replay makes the same decisions on it."""
    recordings = sorted(folder.glob("goal-*.mcap"))
    assert len(recordings) == count
    replayed = folder.parent / f"replayed{count}"
    assert main(["replay", str(recordings[0]), "tracking=none", f"hydra.run.dir={replayed}"]) == 0
    assert json.loads((replayed / "agreement.json").read_text())["same_command"] == 1.0


def test_the_simulated_robot_stands_without_commands(ros):
    ros.lme("simulator", f"--ros{ros.version}", "robot=turtlebot2", "map.worlds=[0]", name="base")
    command = [ros.python, "-m", "tests.behaviour.ros.joystick", str(ros.version)]
    said = json.loads(ros.start(command, "joystick", stdout=subprocess.PIPE).communicate(timeout=60)[0])
    assert said == {"fastest": pytest.approx(0.2, abs=0.01), "last": 0.0}
