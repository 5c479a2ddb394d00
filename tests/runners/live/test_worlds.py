"""The node drives the simulated robot through ten BARN worlds over real topics, and does as `lme eval` does."""

import csv
import statistics

import pytest

from runners.cli.main import main
from runners.records.records import read_episodes
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
    robot = ("robot=jackal", "live.time_jump=20", "live.soft_stop=false", "live.use_sim_time=true")
    ros.lme(f"ros{ros.version}", *robot, name="node")
    simulator = ros.lme(
        "simulator",
        f"--ros{ros.version}",
        "robot=jackal",
        WORLDS,
        f"live.speed={SPEED[ros.version]}",
        name="robot",
    )
    assert simulator.wait(240) == 0, ros.log("robot")
    with (ros.folder / "robot" / "outcomes.csv").open() as file:
        driven = list(csv.DictReader(file))
    assert len(driven) == 10
    successes = [float(row["time_s"]) for row in driven if row["outcome"] == "success"]
    assert len(successes) >= 9, ros.log("robot")  # one may differ by chance
    assert (evaluated.outcome == "success").sum() >= 28
    assert statistics.median(successes) == pytest.approx(evaluated.time_s.median(), rel=LIVE_TIME)
    scores = [float(row["barn_metric"]) for row in driven]
    assert statistics.mean(scores) >= evaluated.barn_metric.mean() - 0.06  # one world of ten
