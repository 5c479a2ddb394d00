"""Which folders count as runs, and what becomes of those that cannot be read."""

import json

import pytest

from lme.errors import InputError
from runners.records.launch_record import read_launch
from runners.records.run_directories import collect
from tests.composing import jobs_of
from tests.made_runs import write_run


@pytest.fixture
def outputs(tmp_path):
    with jobs_of() as job:
        for place in ("eval/one", "eval/sweep/0", "train/two/held_out"):
            write_run(tmp_path / place, job=job())
    write_run(tmp_path / "mlartifacts" / "copy")  # as MLflow keeps it
    return tmp_path


def test_runs_are_found_however_deep_and_copies_are_not(outputs):
    frames, problems = collect([outputs])
    assert [str(run.relative_to(outputs)) for run in frames] == [
        "eval/one",
        "eval/sweep/0",
        "train/two/held_out",
    ]
    assert problems == []


def test_a_run_counts_once_and_without_a_launch_record_where_it_is_named(outputs):
    copy = outputs / "mlartifacts" / "copy"
    frames, _ = collect([outputs / "eval" / "one", outputs / "eval", copy])
    assert [run.name for run in frames] == ["one", "0", "copy"]


@pytest.mark.parametrize(
    ("path", "content"),
    [
        ("episodes.parquet", b"junk"),
        ("parts/episodes.jsonl", b"[]\n"),
        ("parts/episodes.jsonl", b""),
    ],
)
def test_a_run_that_cannot_be_read_is_left_out_with_a_reason(outputs, path, content, says):
    run = outputs / "eval" / "one"
    (run / "episodes.parquet").unlink()
    (run / path).parent.mkdir(exist_ok=True)
    (run / path).write_bytes(content)
    frames, (problem,) = collect([outputs])
    assert len(frames) == 2
    says(problem)
    assert str(run) in problem


@pytest.mark.parametrize("content", ["{", "[]", '{"configs": [], "command": "eval"}'])
def test_a_damaged_launch_record_takes_no_other_run_away(outputs, content, says):
    (outputs / "eval" / "one" / "launch.json").write_text(content)
    frames, problems = collect([outputs])
    assert len(frames) == 2
    says("\n".join(problems))


@pytest.mark.parametrize("scale", ["x", {"a_close": {}}, [1.0]])
def test_a_launch_record_with_a_damaged_scale_is_damaged(outputs, scale, says):
    path = outputs / "eval" / "one" / "launch.json"
    launch = json.loads(path.read_text())
    launch["configs"][0]["scale"] = scale
    path.write_text(json.dumps(launch))
    with says.raises(InputError):
        read_launch(path.parent)


def test_a_folder_without_runs_is_named(tmp_path, says):
    with says.raises(InputError):
        collect([tmp_path])
    with says.raises(InputError):
        collect([tmp_path / "gone"])
