"""A run's directory is complete: what it has read of the user's own files is beside its records."""

import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from lme.errors import InputError
from runners.records import input_search, inputs, trust
from runners.records.launch_record import launch_of, read_launch
from runners.records.run_directories import check_same, make_fresh
from tests.composing import jobs_of

PLANNER = """
from dataclasses import dataclass
import own_helper
from own_package import speeds

@dataclass
class Settings:
    network: str | None = None

class Planner:
    Config = Settings
"""
SHAPES = "bounds: [0, 0, 10, 8]\nboxes: []\n"
MODULES = ("own_planner", "own_helper", "own_package", "own_package.speeds")


@pytest.fixture(scope="module")
def composed(tmp_path_factory):
    with jobs_of("eval") as job:
        return job()


@pytest.fixture
def job(composed, tmp_path, monkeypatch):
    """A function that gives the job with some keys of its groups replaced, in a folder with own files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "own_planner.py").write_text(PLANNER)
    (tmp_path / "own_helper.py").write_text("import numpy\n")
    (tmp_path / "own_package").mkdir()
    (tmp_path / "own_package" / "__init__.py").touch()
    (tmp_path / "own_package" / "speeds.py").touch()
    (tmp_path / "unused.py").touch()

    def made(**groups):
        config = replace(
            composed.config,
            **{name: {**getattr(composed.config, name), **own} for name, own in groups.items()},
        )
        return replace(composed, config=config)

    yield made
    for name in MODULES:
        sys.modules.pop(name, None)


def kept(job):
    return {name: file for each in input_search.gather([job]) for name, file in each.files.items()}


def test_a_config_of_shipped_parts_has_no_inputs(job):
    assert input_search.gather([job()]) == []


@pytest.mark.parametrize(
    ("image", "copied"),
    [("hall.pgm", "hall.pgm"), ("../hall.pgm", "hall.pgm"), ("/HERE/hall.pgm", "hall.pgm")],
)
def test_a_ros_map_is_kept_with_its_picture(job, tmp_path, image, copied):
    (tmp_path / "maps").mkdir()
    picture = tmp_path / "maps" / image.replace("/HERE", str(tmp_path))
    picture.resolve().write_bytes(b"P5 1 1 255 \0")
    (tmp_path / "maps" / "hall.yaml").write_text(
        yaml.safe_dump({"image": image.replace("/HERE", str(tmp_path))})
    )
    (own,) = input_search.gather([job(map={"path": "maps/hall.yaml"})])
    inputs.keep([own], tmp_path / "run")
    folder = tmp_path / "run" / "inputs" / own.digest
    assert sorted(path.name for path in folder.iterdir()) == ["hall.pgm", "hall.yaml"]
    assert yaml.safe_load((folder / "hall.yaml").read_text())["image"] == copied


@pytest.mark.parametrize(
    ("group", "key", "name"),
    [
        ("map", "path", "tracks.txt"),
        ("planner", "path", "policy.onnx"),
        ("planner", "weights", "net.onnx"),
        ("guide", "weights", "net.onnx"),
        ("planner", "table_of_mine", "table.csv"),
    ],
)
def test_files_that_a_config_names_are_kept(job, tmp_path, group, key, name):
    (tmp_path / name).write_bytes(b"content")
    assert set(kept(job(**{group: {key: name}}))) == {name}


def test_a_text_that_happens_to_name_a_folder_is_no_input(job, tmp_path):
    (tmp_path / "hall").mkdir()
    (tmp_path / "hall" / "private.txt").touch()
    assert not kept(job(map={"name": "hall"}))


def test_of_a_folder_of_maps_the_maps_are_kept(job, tmp_path):
    for name in ("a.yaml", "b.yaml", "letter.txt"):
        (tmp_path / "maps").mkdir(exist_ok=True)
        (tmp_path / "maps" / name).write_text(SHAPES)
    assert set(kept(job(map={"paths": ["maps"]}))) == {"a.yaml", "b.yaml"}


def test_own_code_is_kept_with_what_it_imports_of_ones_own(job):
    found = kept(job(planner={"_target_": "own_planner.Planner"}))
    assert set(found) == {
        "own_planner.py",
        "own_helper.py",
        "own_package/__init__.py",
        "own_package/speeds.py",
    }
    assert set(kept(job(guide={"criteria": {"c_own": "own_helper.f"}}))) == {"own_helper.py"}


def test_a_large_file_is_kept_by_its_checksum(job, tmp_path, monkeypatch, says):
    monkeypatch.setattr(input_search, "LARGEST", 3)
    (tmp_path / "tracks.txt").write_text("0 1 2 3\n")
    found = input_search.gather([job(map={"path": "tracks.txt"})])
    says(inputs.sentence(found))
    inputs.keep(found, tmp_path / "run")
    assert (
        inputs.located({"map": {"path": "tracks.txt"}}, found, tmp_path / "run")["map"]["path"]
        == "tracks.txt"
    )
    (tmp_path / "tracks.txt").write_text("0 1 2 4\n")
    with pytest.raises(InputError, match=r"only a checksum"):
        inputs.located({"map": {"path": "tracks.txt"}}, found, tmp_path / "run")


@pytest.fixture
def run_dir(job, tmp_path):
    """A run with a shape file, which it has kept."""
    (tmp_path / "hall.yaml").write_text(SHAPES)
    return make_fresh(launch_of("play", [job(map={"path": "hall.yaml"})], [], False, None), tmp_path / "run")


def test_a_run_says_what_it_keeps(run_dir, says):
    says(inputs.sentence(read_launch(run_dir).inputs))


def test_the_copy_is_used_where_the_file_has_changed_or_is_gone(run_dir, tmp_path, says):
    path = tmp_path / "hall.yaml"
    for content in (SHAPES + "# changed\n", None):
        path.write_text(content) if content else path.unlink()
        if content:
            with says.warns():
                found = read_launch(run_dir).worlds_config.map["path"]
        else:
            found = read_launch(run_dir).worlds_config.map["path"]
        assert str(run_dir) in found
        assert Path(found).read_text() == SHAPES


def test_a_run_that_was_moved_is_complete(run_dir, tmp_path, tmp_path_factory, monkeypatch):
    there = tmp_path_factory.mktemp("elsewhere") / "sweep"
    shutil.move(run_dir, there)
    (there / "0").mkdir()
    shutil.copy(there / "launch.json", there / "0")  # a job finds the copies of its sweep
    shutil.rmtree(tmp_path)
    monkeypatch.chdir(there)
    for place in (there, there / "0"):
        assert str(there) in read_launch(place).worlds_config.map["path"]


def test_a_copy_that_is_no_longer_the_runs_is_refused(run_dir, tmp_path, says):
    (copy,) = run_dir.glob("inputs/*/hall.yaml")
    copy.write_text("changed")
    with says.raises(InputError):
        _ = read_launch(run_dir).worlds_config
    copy.unlink()
    copy.symlink_to(tmp_path / "hall.yaml")
    with says.raises(InputError):
        _ = read_launch(run_dir).worlds_config


@pytest.mark.parametrize("name", ["../../hall.yaml", "/etc/passwd"])
def test_a_list_of_inputs_that_leads_out_of_the_run_is_damaged(run_dir, name):
    record = (run_dir / "launch.json").read_text()
    (run_dir / "launch.json").write_text(record.replace('"name": "hall.yaml"', f'"name": "{name}"'))
    with pytest.raises(InputError, match="is damaged"):
        read_launch(run_dir)


def test_a_run_is_resumed_only_with_the_same_files(job, run_dir, tmp_path, says):
    def now():
        return launch_of("play", [job(map={"path": "hall.yaml"})], [], False, None)

    check_same(now(), run_dir)
    (tmp_path / "hall.yaml").write_text(SHAPES + "# changed\n")
    with says.raises(InputError):
        check_same(now(), run_dir)


def test_a_job_reads_what_was_there_at_launch(job, run_dir, tmp_path):
    config, launch = job(map={"path": "hall.yaml"}).config, read_launch(run_dir)
    with trust.trusting(run_dir):
        assert inputs.as_at_launch(config, launch.inputs, run_dir) is config
        (tmp_path / "hall.yaml").write_text("bounds: [0, 0, 1, 1]\n")
        with pytest.warns(UserWarning, match="its copy"):
            assert str(run_dir) in inputs.as_at_launch(config, launch.inputs, run_dir).map["path"]


def test_own_code_comes_from_its_copy_where_todays_differs(job, tmp_path, monkeypatch, says):
    own = job(planner={"_target_": "own_planner.Planner"})
    found = input_search.gather([own])
    inputs.keep(found, tmp_path / "run")
    monkeypatch.setattr(sys, "path", list(sys.path))
    inputs.provide_code(found, tmp_path / "run")
    assert str(tmp_path / "run" / "inputs" / found[0].digest) not in sys.path
    (tmp_path / "own_helper.py").write_text("LATER = 1\n")
    with says.warns():
        inputs.provide_code(found, tmp_path / "run")
    import own_helper

    assert not hasattr(own_helper, "LATER")
    assert "inputs" in own_helper.__file__
