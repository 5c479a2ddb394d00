"""The script that makes the runs of a paper again."""

import dataclasses
import shlex

import pytest

from runners.records.launch_record import launch_of, read_launch
from runners.reports.paper.write import script
from tests.composing import jobs_of
from tests.made_runs import write_run


@pytest.fixture
def job():
    with jobs_of("eval", "map=barn") as job:
        yield job


def commands_of(text):
    return [shlex.split(line) for line in text.splitlines() if line.startswith("lme ")]


def test_a_sweep_is_one_command_and_a_run_another(tmp_path, job):
    launch = launch_of("eval", [job(), job("seed=1")], ["seed=0,1", "map.worlds=[1,2]"], True, None)
    for number in (0, 1):
        write_run(tmp_path / "sweep" / str(number), job=job(f"seed={number}"))
    launch.write(tmp_path / "sweep")
    launch_of("eval", [job()], ["map=barn"], False, None).write(tmp_path)
    text = script(
        [tmp_path / "sweep", tmp_path], [tmp_path / "sweep" / "0", tmp_path / "sweep" / "1", tmp_path]
    )
    assert commands_of(text) == [
        ["lme", "eval", "-m", "seed=0,1", "map.worlds=[1,2]", "hydra.sweep.dir=outputs/reproduced/1"],
        ["lme", "eval", "map=barn", "hydra.run.dir=outputs/reproduced/2"],
        ["lme", "paper", "outputs/reproduced/1", "outputs/reproduced/2", "--into", "paper_again"],
    ]


def test_runs_that_lie_in_one_folder_have_a_command_each(tmp_path, job):
    runs = [tmp_path / "0", tmp_path / "1"]
    for run in runs:
        write_run(run, job=job())
    assert len(commands_of(script([tmp_path], runs))) == 3


def test_a_run_without_a_record_is_said_to_have_none(tmp_path):
    write_run(tmp_path)
    text = script([tmp_path], [tmp_path])
    assert f"# {tmp_path}: how it was started is not recorded" in text
    assert commands_of(text) == []


def test_a_record_of_someone_else_cannot_add_a_command(tmp_path, job):
    """Neither by a line break in a comment, nor by a name that is no command, nor by an argument."""
    write_run(tmp_path, job=job())
    launch = read_launch(tmp_path)
    bad = dataclasses.replace(launch, code="1\nrm -r x", overrides=["a=$(rm -r x)", "b\nrm -r x"])
    bad.write(tmp_path, anew=True)
    text = script([tmp_path], [tmp_path])
    assert not [line for line in text.splitlines() if line.startswith("rm ")]
    assert commands_of(text)[0][2] == "a=$(rm -r x)"
    dataclasses.replace(launch, command="eval; rm -r x").write(tmp_path, anew=True)
    assert "rm -r x" not in script([tmp_path], [tmp_path])
