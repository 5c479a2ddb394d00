"""A robot and a map are what their values are, whatever their files are called."""

import warnings
from pathlib import Path

import pytest

from lme.config.composer import SHIPPED
from runners.config.catalogue import Catalogue
from runners.config.changes import map_like, robot_difference, robots_like
from runners.config.command_line import compose
from runners.records.launch_record import identity

SHIPPED_ROBOTS = Catalogue(SHIPPED).options("robot")


def robot(option="stage", **changed):
    return {**Catalogue(SHIPPED).values(f"robot/{option}"), **changed}


@pytest.mark.parametrize("option", SHIPPED_ROBOTS)
def test_a_shipped_robot_is_itself(option):
    (job,) = compose("eval", [f"robot={option}"])
    for values in (robot(option), identity(job.config)["robot"]):
        assert option in robots_like(values, SHIPPED)
        assert robot_difference(values) == ""


@pytest.mark.parametrize(
    ("changed", "alike"),
    [
        ({"name": "mine"}, True),
        ({"v_max": 0.4}, True),
        ({"v_max": 0.5000001}, False),
        ({"omega_max": 3.0}, False),
        ({"alpha_v": 1.0, "alpha_omega": 1.0}, True),
        ({"v_min": -0.1}, True),
        ({"control_rate": 4.0}, False),
        ({"footprint": {"radius": 0.19, "length": None, "width": None}}, False),
        ({"contact": {"radius": 0.2, "length": None, "width": None}}, False),
        ({"lidar": {**robot()["lidar"], "num_beams": 811}}, False),
        ({"v_max": "${oc.env:HOME}"}, False),
        ({"v_max": None}, False),
    ],
)
def test_a_robot_is_the_papers_by_its_values_with_limits_no_higher(changed, alike):
    assert ("stage" in robots_like(robot(**changed), SHIPPED)) == alike


def test_the_first_value_that_differs_is_named(says):
    says(robot_difference(robot(v_max=1.0)))
    assert robot_difference(robot(v_max=1.0, name="mine")) == ""
    for damaged in ({}, {"name": "stage"}, {"name": ["stage"]}):
        assert (robots_like(damaged, SHIPPED), robot_difference(damaged)) == ([], "")


def test_a_map_is_what_it_is_by_its_values():
    env1 = Catalogue(SHIPPED).values("map/env1")
    assert map_like({**env1, "time_limit": 1.0}, "env1", "env1") == "env1"  # a changed key is known elsewhere
    assert map_like({**env1, "worlds": [1]}, "mine", "env1") == "env1"
    for changed in ({"time_limit": 60.0}, {"path": "mine.yaml"}, {"_target_": "my.Map"}, {"more": 1}):
        assert map_like({**env1, **changed}, "mine", "env1") == ""
    assert map_like(env1, "mine", "nowhere") == ""


def said(monkeypatch, folder, text, *words):
    monkeypatch.chdir(folder)
    Path("own/robot").mkdir(parents=True)
    name = words[0].partition("=")[2]
    Path(f"own/robot/{name}.yaml").write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        compose("eval", [*words, "--config-dir", "own"])
    return [str(each.message) for each in caught]


STAGE = (SHIPPED[0] / "robot" / "stage.yaml").read_text()
FASTER = STAGE.replace("v_max: 0.5", "v_max: 1.0")


def test_a_robot_with_a_shipped_name_and_other_values_gets_a_warning(monkeypatch, tmp_path, says):
    (line,) = said(monkeypatch, tmp_path, FASTER, "robot=mine")
    says(line)


@pytest.mark.parametrize("text", [STAGE, FASTER.replace("name: stage", "name: mine")])
def test_the_same_values_or_another_name_get_none(monkeypatch, tmp_path, text):
    assert said(monkeypatch, tmp_path, text, "robot=mine", "robot.v_max=0.7") == []


def test_a_file_that_a_shipped_one_hides_gets_a_warning(monkeypatch, tmp_path, says):
    (line,) = said(monkeypatch, tmp_path, FASTER, "robot=stage")
    says(line)
