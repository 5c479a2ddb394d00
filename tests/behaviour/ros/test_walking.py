"""A Go2 that walks in MuJoCo is driven over real topics by what FAST-LIO and its lidar publish."""

import csv

import pytest

from tests.behaviour.ros.ros import end

TOPICS = ("robot=go2", "topics=go2", "topics.scan=livox/lidar")
FAST_LIO = ("sim.twist=zero", "sim.registered=false", "live.scan_rate=10", "live.odometry_rate=10")


def test_lme_plus_drives_a_walking_go2_to_its_goal_by_the_raw_cloud(ros):
    pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
    pytest.importorskip("onnxruntime", reason="the policy of sim=mujoco needs onnxruntime")
    version = f"ros{ros.version}"
    node = ros.lme(version, *TOPICS, "system=lme_plus", "live.use_sim_time=true")
    world = ("map=go2_a", "map.worlds=[0]", "runs=1")
    robot = ros.lme("simulator", f"--{version}", *TOPICS, "sim=mujoco", *FAST_LIO, *world, name="robot")
    assert robot.wait(240) == 0, ros.log("robot")
    assert end(node) == 0
    with (ros.folder / "robot" / "outcomes.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert row["outcome"] == "success", ros.log("robot") + ros.log("node")
