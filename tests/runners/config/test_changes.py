"""Keys that differ from the files of the chosen options, and what tables make of them."""

import re
from pathlib import Path

import pytest

from lme.errors import InputError
from runners.cli.main import main
from runners.config.build import map_set
from runners.config.changes import describe_changes
from runners.evaluate.evaluate import run_labels
from runners.records.launch_record import read_launch
from runners.records.records import read_episodes
from runners.reports.analysis.tables import title
from runners.training.families import families
from runners.training.held_out import _evaluation, held_out_places
from tests.composing import jobs_of

QUICK = ["map.worlds=[0]", "map.time_limit=0.3", "runs=1", "executor=serial", "tracking=none"]
OWN_SYSTEM = """\
# @package _global_
# A custom pair
defaults:
  - override /guide: target
  - override /planner: simple
planner:
  kp: 5.0
system:
  label: Mine
"""

OWN_ROBOT = """\
name: own
footprint: {radius: 0.2}
v_max: 1e0
omega_max: 1
alpha_v: 2
alpha_omega: 2
control_rate: 5
lidar: {num_beams: 90, fov: 6, range_min: 0.1, range_max: 5}
"""


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        ([], {}),
        (["robot=go2", "map=env1", "planner=dwa_tuned", "sim=physics"], {}),  # options, unchanged
        (["map.worlds=[0]", "map.subset=all", "runs=7", "seed=3"], {}),  # all have columns of their own
        (["robot.v_max=2"], {}),  # its own value
        (["robot.v_max=1", "robot.lidar.num_beams=90"], {"robot.v_max": 1.0, "robot.lidar.num_beams": 90}),
        (["planner=dwa", "planner.v_samples=5"], {"planner.v_samples": 5}),
        (["ablation=no_c_o", "weights=published", "scale={a_dev:2}"], {}),  # parameters have columns
        (["ablation.c_t=0.5"], {"ablation.c_t": 0.5}),
        (["system=lme_plus", "ablation=no_memory"], {}),  # what an ablation sets
        (
            ["system=lme_plus", "ablation=[no_memory,no_back]", "planner.max_lateral_accel=2"],
            {"planner.max_lateral_accel": 2.0},
        ),
        (
            ["system=lme_plus", "ablation=no_back", "planner.parts.backing_up=1"],
            {"planner.parts.backing_up": True},
        ),  # it is last
        (["ablation=[no_c_t,no_c_h]"], {}),
        (["ablation=[no_c_t,no_c_h]", "ablation.d1=3"], {"ablation.d1": 3.0}),
        (
            ["guide.parameters={a_close: 1}"],
            {"guide.parameters.a_close": 1},
        ),  # instead of those of the weights
        (["sim.latency=0.1", "map.start=[0,0,0]"], {"map.start": [0.0, 0.0, 0.0], "sim.latency": 0.1}),
    ],
)
def test_changes_are_what_the_files_say_otherwise(words, changes):
    with jobs_of() as job:
        assert job(*words).changes == changes


def test_a_robot_of_ones_own_is_as_its_file_and_the_defaults_say(tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "own.yaml").write_text(OWN_ROBOT)
    with jobs_of(config_dir=tmp_path) as job:
        assert job("robot=own").changes == {}
        assert job("robot=own", "robot.lidar.x=0.1").changes == {"robot.lidar.x": 0.1}


def test_changed_keys_of_a_held_out_map_are_those_of_its_evaluation_alone():
    with jobs_of("train") as job:
        training = job("experiment=table1", "held_out.env2.goal_tolerance=3", "map.time_limit=5")
    limits = {
        f"held_out.{name}_{limit}s.time_limit": limit for name in ("env1", "env2") for limit in (60, 100)
    }
    assert training.changes == {"map.time_limit": 5.0, "held_out.env2.goal_tolerance": 3, **limits}
    first, second = (
        _evaluation(training, held_out_places(training)[place], {}, place, "mine", "")
        for place in ("env1", "env2")
    )
    assert (first.changes, first.choices["map"]) == ({}, "env1")
    assert (second.changes, second.choices["map"]) == ({"map.goal_tolerance": 3}, "env2")


def test_changed_keys_of_a_family_are_those_of_its_evaluation_alone():
    with jobs_of("train") as job:
        training = job("training.fresh.time_limit=50", "training_robots.fresh.v_max=1", "robot.v_max=0.4")
    trained = families(training.config, training.choices)
    found = {
        name: _evaluation(training, family, {}, name, "mine", "start") for name, family in trained.items()
    }
    assert found["fresh"].changes == {"map.time_limit": 50, "robot.v_max": 1.0}
    assert found["env1"].changes == {"robot.v_max": 0.4}
    assert (found["fresh"].choices["map"], found["fresh"].choices["robot"]) == ("barn", "jackal")
    assert (found["env1"].choices["map"], found["env1"].choices["robot"]) == ("env1", "stage")
    assert found["fresh"].run_dir.parts[-2:] == ("start", "fresh")


def test_values_that_a_file_inherits_are_its_own():
    with jobs_of() as job:
        assert job("robot=go2", "map=real3").changes == {}
        assert job("map=real3", "map.starts=3").changes == {"map.starts": 3}


def test_a_run_and_its_table_name_what_was_changed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["guide=target", "planner=dwa", "planner.v_samples=5", "hydra.run.dir=out"]
    assert main(["eval", *QUICK, *words]) == 0
    frame = read_episodes(["out"])
    assert frame["system"].unique().tolist() == ["DWA (changed)"]
    assert read_launch(tmp_path / "out").changes == [{"map.time_limit": 0.3, "planner.v_samples": 5}]
    assert "map.time_limit=0.3 · planner.v_samples=5" in title(frame)
    changes = r"\item Changed: map.time\_limit=0.3, planner.v\_samples=5."
    assert changes in (tmp_path / "out" / "table.tex").read_text(encoding="utf-8").splitlines()


def test_a_system_of_ones_own_has_its_label_and_a_place_in_the_table(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine" / "system").mkdir(parents=True)
    (tmp_path / "mine" / "system" / "ours.yaml").write_text(OWN_SYSTEM)
    words = ["--config-dir", "mine", "system=ours,simple", "table=[simple,ours]", "hydra.sweep.dir=out"]
    assert main(["eval", "-m", *QUICK, *words]) == 0
    capsys.readouterr()
    assert main(["table", "out", "--format", "csv"]) == 0  # finds the folder again
    labels = [line.split(",")[0] for line in capsys.readouterr().out.splitlines()]
    assert labels == ["label", "Simple", "Mine"]


@pytest.mark.parametrize(
    ("words", "label"),
    [
        (["system.label='My policy'"], "My policy"),
        (["system.label=2"], "2"),
        (["system=dwa", "planner.v_samples=5", "system.label=Mine"], "Mine"),
        (["system=dwa", "planner.v_samples=5"], "DWA (changed)"),
        (["system=lme", "guide=lme_plus"], "LME+-Simple"),
    ],
)
def test_a_label_on_the_command_line_names_the_system(words, label):
    with jobs_of() as job_of:
        job = job_of(*words)
    assert run_labels(job, map_set(job.config)).system == label


def test_every_file_of_a_run_shows_its_label(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["eval", *QUICK, "system.label=Mine", "hydra.run.dir=out"]) == 0
    assert re.search(r"^Mine\s", capsys.readouterr().out, re.MULTILINE)
    assert read_episodes(["out"])["system"].unique().tolist() == ["Mine"]
    assert "| Mine |" in Path("out/table.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("label", ["'LME (published)'", "' '", "'a\nb'", "[a]"])
def test_a_label_that_no_table_can_show(label, capsys, says):
    assert main(["eval", *QUICK, f"system.label={label}"]) == 2
    says(capsys.readouterr().err)


def test_a_broken_system_of_ones_own_is_named(tmp_path, monkeypatch, capsys, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine" / "system").mkdir(parents=True)
    file = tmp_path / "mine" / "system" / "ours.yaml"
    file.write_text(OWN_SYSTEM.replace("label", "labl"))
    assert main(["eval", "--config-dir", "mine", "system=ours", *QUICK]) == 2
    error = capsys.readouterr().err
    says(error)
    assert str(file) in error


def test_a_family_of_worlds_that_is_no_mapping_is_an_error():
    mistake = r"^training\.fresh is True: must be a mapping"
    with jobs_of("learn") as job_of, pytest.raises(InputError, match=mistake):
        job_of("training={fresh: true}")


@pytest.mark.parametrize(
    ("command", "word"),
    [
        ("learn", "guides={lme: {share: 1}}"),
        ("train", "training_radius.fresh=[2]"),
        ("train", "training_robots.fresh.lidar.tilt.v=1"),
        ("train", "training_robots.new.v_max=1"),
    ],
)
def test_what_is_in_an_open_mapping_has_the_right_type(command, word, says):
    with jobs_of(command) as job_of, says.raises(InputError):
        job_of(word)


def test_changes_are_written_as_one_types_them():
    changes = {"robot.lidar.cloud": None, "guide.flag": True, "map.start": [1, 2], "planner.note": "none"}
    text = "robot.lidar.cloud=null, guide.flag=true, map.start=[1,2], planner.note=none"
    assert describe_changes(changes) == text
