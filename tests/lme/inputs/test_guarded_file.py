"""What every reader of the user's files refuses at once, whatever it reads."""

import json
import os
from pathlib import Path

import pytest
import yaml

from benchmarks.gazebo_logs import read_log
from lme.errors import InputError
from lme.inputs.guarded_file import (
    SafeLoader,
    check_structure,
    decode_json,
    expanded,
    open_bytes,
    read_bytes,
    read_json,
    read_text,
    read_yaml,
)
from lme.inputs.onnx_file import OnnxNetwork
from lme.inputs.onnx_graph import read_weights
from lme.planners.drl_vo.importing import import_archive
from lme.planners.lics import import_state
from lme.worlds.barn.files import read_world
from lme.worlds.bitmap import brightness, is_picture
from lme.worlds.room import read_floor_plan
from runners.recordings.bags import Bag
from runners.recordings.carmen import CarmenLog
from runners.records.launch_record import LAUNCH, read_launch
from tests.places import ROOT

READERS = {  # of a whole file, by a name that it takes
    "a.yaml": (read_yaml, read_floor_plan),
    "a.png": (brightness, is_picture, read_floor_plan),
    "a.onnx": (OnnxNetwork, lambda path: read_weights(path, "a network")),
    "a.pth": (import_state, import_archive),
    "a.world": (read_world,),
    "a.bag": (Bag,),
    "a.db3": (Bag,),
    "a.mcap": (Bag,),
    "a.log": (CarmenLog,),
    "a.log.gz": (CarmenLog,),
    "a.txt": (read_log,),
    LAUNCH: (lambda path: read_launch(path.parent),),
}
EVERY = [(name, read) for name, reads in READERS.items() for read in reads]


def refused(read, path):
    with pytest.raises(InputError) as error:
        read(path)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(("name", "read"), EVERY)
def test_a_pipe_and_a_device_are_not_waited_for(tmp_path, name, read):
    path = tmp_path / name
    os.mkfifo(path)
    assert "pipe" in refused(read, path)
    path.unlink()
    path.symlink_to("/dev/zero")
    assert "device" in refused(read, path)


@pytest.mark.parametrize(("name", "read"), [(name, read) for name, read in EVERY if read != is_picture])
def test_a_terabyte_of_nothing_is_refused_without_being_read(tmp_path, name, read):
    path = tmp_path / name
    path.touch()
    os.truncate(path, 2**40)
    assert str(path.parent) in refused(read, path)


def test_links_to_regular_files_are_followed(tmp_path):
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfone\r\ntwo\r")
    (tmp_path / "b").symlink_to("a")
    assert read_text(tmp_path / "b") == "one\ntwo\n"
    with open_bytes(tmp_path / "b") as file:
        assert len(file.read()) == 12


def test_a_home_folder_that_is_not_known_is_one_line(monkeypatch, tmp_path, says):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert expanded("~/a/b") == tmp_path / "a" / "b"
    assert expanded("a/~b") == Path("a/~b")
    says(refused(expanded, "~no-such-user/maps/a.yaml"))


def test_no_other_module_looks_for_home_folders():
    modules = [path for package in ("lme", "runners") for path in (ROOT / package).rglob("*.py")]
    assert [path.name for path in modules if "expanduser" in path.read_text("utf-8")] == ["guarded_file.py"]


def test_the_limit_is_the_last_size_that_is_read(tmp_path, says):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    says(refused(lambda file: read_bytes(file, 4), path))


@pytest.mark.parametrize("number", ["010", "-010", "12:30", "1:2.5"])
def test_a_number_that_is_not_decimal_is_refused(tmp_path, number, says):
    path = tmp_path / "a.yaml"
    path.write_text(f"walls:\n- [0.5, {number}]\n")
    says(refused(read_yaml, path))


def test_decimal_numbers_and_quoted_text_are_read(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("[0, -0.5, 00.5, 0.010, 10, 1e3, 1.0e+3, 0x10, '010', '12:30', 0]")
    assert read_yaml(path) == [0, -0.5, 0.5, 0.01, 10, "1e3", 1000.0, 16, "010", "12:30", 0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: &x [1, *x]", r"alias \*x contains itself"),
        ("a: &x {b: {c: *x}}", r"alias \*x contains itself"),
        ("a: " + "[" * 101 + "]" * 101, "more than 100 nested values"),
        ("a: " + "[" * 1_000_000, "more than 100 nested values"),
        ("- " * 1_000_000, "more than 100 nested values"),
        (
            "a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
            + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 9)),
            "aliases repeat more than 100000 values",
        ),
        (
            "a0: &a0 {x: 1}\n"
            + "".join(f"a{i}: &a{i} {{<<: [{', '.join([f'*a{i - 1}'] * 9)}]}}\n" for i in range(1, 9)),
            "aliases repeat more than 100000 values",
        ),
    ],
)
def test_yaml_that_would_unfold_without_end_is_refused(text, words, tmp_path):
    with pytest.raises(yaml.YAMLError, match=words):
        check_structure(text)
    (tmp_path / "a.yaml").write_text(text)
    assert f"{tmp_path / 'a.yaml'}, line " in refused(read_yaml, tmp_path / "a.yaml")


@pytest.mark.parametrize("around", ["[", '{"a":[0,', '[{"a":'])
@pytest.mark.parametrize("times", [101, 400, 200_000])
def test_json_that_is_nested_too_deep_is_refused(around, times):
    closed = "".join({"[": "]", "{": "}"}.get(letter, "") for letter in reversed(around))
    for text in (around * times + "0" + closed * times, around * times):
        with pytest.raises(ValueError, match=r"more than 100 nested values|Expecting value"):
            decode_json(text)


def test_json_of_a_hundred_nested_values_is_read(tmp_path):
    value = 5
    for _ in range(50):
        value = {"a": [value, "text"], "b": None}
    (tmp_path / "a.json").write_text("\ufeff" + json.dumps(value), encoding="utf-8")
    assert read_json(tmp_path / "a.json") == value
    with pytest.raises(ValueError, match="more than 100 nested values"):
        decode_json(json.dumps([value]))


def test_a_reader_may_change_what_it_was_given(tmp_path):
    """Content is kept, because the files of `conf/` are read again and again."""
    path = tmp_path / "a.yaml"
    path.write_text("a: {b: [1]}")
    read_yaml(path)["a"]["b"].append(2)
    assert read_yaml(path) == {"a": {"b": [1]}}


def test_ordinary_anchors_and_merges_are_read():
    text = "base: &b {x: 1, y: [2]}\none: *b\ntwo: {<<: *b, x: 3}\nlast: *b\n"
    check_structure(text)
    assert yaml.load(text, SafeLoader) == {
        "base": {"x": 1, "y": [2]},
        "one": {"x": 1, "y": [2]},
        "two": {"x": 3, "y": [2]},
        "last": {"x": 1, "y": [2]},
    }
