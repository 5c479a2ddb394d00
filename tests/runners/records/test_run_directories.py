"""Which folders are jobs of a sweep, and whether a run may be resumed."""

import json

import pytest

from lme.errors import InputError
from runners.records.launch_record import LAUNCH, Launch, job_folders, read_launch
from runners.records.records import RecordWriter
from runners.records.run_directories import ROOT, check_same, jobs_of_sweep, locked, make_fresh, resumable


def launch(**fields):
    return Launch(
        **{
            "command": "eval",
            "fingerprint": "0",
            "multirun": False,
            "overrides": [],
            "configs": [{}],
            **fields,
        }
    )


def test_jobs_beyond_those_named_need_records(tmp_path):
    """A sweeper plugin may run more jobs than the command line names; a larger sweep may leave empty folders."""
    for number in (2, 0, 1, 3):
        place = tmp_path / f"job{number}"
        place.mkdir()
        launch(job=number).write(place)
    (tmp_path / "job2" / "episodes.parquet").touch()
    assert [place.name for place in jobs_of_sweep(tmp_path, 1)] == ["job0", "job2"]


def test_jobs_may_lie_deeper_but_not_in_other_jobs(tmp_path):
    for name in ("a=1/b=2", "a=1/b=3", "a=1/b=3/held_out"):
        (tmp_path / name).mkdir(parents=True)
        launch(job=0).write(tmp_path / name)
    assert sorted(job_folders(tmp_path)) == [tmp_path / "a=1/b=2", tmp_path / "a=1/b=3"]


def test_the_newest_of_many_runs_of_one_second_is_resumed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("01", "02", "02-2", "02-10"):
        second, _, number = name.partition("-")
        place = ROOT / "eval" / f"2026-01-01_00-00-{second}-01234567{number and '-'}{number}"
        place.mkdir(parents=True)
        launch(fingerprint="0123456789").write(place)
    assert resumable(launch(fingerprint="0123456789")).name == "2026-01-01_00-00-02-01234567-10"


@pytest.mark.parametrize(
    "now",
    [
        {"overrides": ["seed=2"]},
        {"overrides": ["seed=x", "hydra.mode=RUN"]},
        {"overrides": ["seed=x"], "config_dir": "own"},
        {"overrides": ["seed=x"], "multirun": True},
    ],
    ids=str,
)
def test_a_run_directory_of_another_config_is_refused_with_advice(tmp_path, now, says):
    launch(overrides=["seed=x"], configs=[{"seed": 1}]).write(tmp_path)
    with says.raises(InputError):
        check_same(launch(fingerprint="1", configs=[{"seed": 2}], **now), tmp_path)


def test_a_sweep_that_has_other_jobs_now_is_resumed_job_by_job(tmp_path, says):
    launch(overrides=["seed=x"], configs=[{"seed": 1}, {"seed": 2}], multirun=True).write(tmp_path)
    now = launch(fingerprint="1", overrides=["seed=x"], configs=[{"seed": 1}], multirun=True)
    with says.raises(InputError):
        check_same(now, tmp_path)


@pytest.mark.parametrize(
    "damage",
    [
        {"command": 1},
        {"multirun": "no"},
        {"overrides": [1]},
        {"overrides": {}},
        {"configs": []},
        {"configs": [[]]},
        {"choices": [{"sim": 1}]},
        {"changes": 5},
        {"changes": [{}, {}]},
        {"config_dir": 3.5},
        {"job": "0"},
    ],
)
def test_a_launch_with_a_value_of_another_kind_is_damaged(tmp_path, damage, says):
    launch().write(tmp_path)
    assert read_launch(tmp_path) == launch()
    values = json.loads((tmp_path / LAUNCH).read_text())
    (tmp_path / LAUNCH).write_text(json.dumps(values | damage))
    with says.raises(InputError):
        read_launch(tmp_path)


def test_a_launch_that_is_nested_too_deep_is_damaged(tmp_path, says):
    launch().write(tmp_path)
    text = (tmp_path / LAUNCH).read_text()
    deep = "[" * 99 + "]" * 99
    (tmp_path / LAUNCH).write_text(
        text.replace('"overrides": [', f'"changes": [{{"a": {deep}}}], "overrides": [', 1)
    )
    with says.raises(InputError):
        read_launch(tmp_path)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b'{"a":' * 100_000])
def test_a_launch_that_is_no_record_is_damaged(tmp_path, content, says):
    assert read_launch(tmp_path) is None
    assert read_launch(tmp_path / "no\0name") is None
    (tmp_path / LAUNCH).write_bytes(content)
    with says.raises(InputError):
        read_launch(tmp_path)
    with says.raises(InputError):
        make_fresh(launch(), tmp_path)


def test_a_launch_that_is_a_folder_cannot_be_read(tmp_path):
    (tmp_path / LAUNCH).mkdir()
    with pytest.raises(InputError, match=r"launch\.json: is a directory"):
        read_launch(tmp_path)


@pytest.mark.parametrize("hold", [RecordWriter, locked])
def test_a_directory_at_work_without_results_yet_is_left_alone(tmp_path, hold, says):
    make_fresh(launch(), tmp_path)
    with hold(tmp_path), says.raises(InputError):
        make_fresh(launch(fingerprint="1"), tmp_path)
    assert read_launch(tmp_path) == launch()
    make_fresh(launch(fingerprint="1"), tmp_path)
    assert read_launch(tmp_path).fingerprint == "1"
