"""`lme paper` says where the folder is and what is in it, and names what it cannot read."""

import pytest

from lme.errors import InputError
from runners.cli.commands import paper
from tests.composing import jobs_of
from tests.made_runs import write_run


@pytest.fixture
def run(tmp_path):
    with jobs_of("eval", "map=barn", "sim=fast") as job:
        write_run(tmp_path / "run", job=job())
    return tmp_path / "run"


def test_the_parts_are_listed(run, tmp_path, capsys, undrawn, says):
    assert paper.main([str(run), "--into", str(tmp_path / "paper")]) == 0
    says(capsys.readouterr().out)


def test_without_a_folder_it_is_among_the_outputs(run, tmp_path, capsys, undrawn, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert paper.main([str(run)]) == 0
    (folder,) = (tmp_path / "outputs" / "paper").iterdir()
    assert f"Paper: outputs/paper/{folder.name}" in capsys.readouterr().out
    assert (folder / "main.tex").exists()


def test_a_run_without_its_steps_has_no_paths(run, tmp_path, undrawn, says):
    (run / "trajectories.parquet").unlink()
    with says.warns():
        paper.main([str(run), "--into", str(tmp_path / "paper")])
    assert not list((tmp_path / "paper" / "figures").iterdir())


def test_a_run_without_a_launch_record_says_less(run, tmp_path, undrawn):
    (run / "launch.json").unlink()
    paper.main([str(run), "--into", str(tmp_path / "paper")])
    assert "seed 0; version not recorded" in (tmp_path / "paper" / "tables" / "results.tex").read_text(
        "utf-8"
    )


@pytest.mark.parametrize("damage", ["folder", "parquet", "launch", "target"])
def test_what_cannot_be_read_or_written_is_named_and_nothing_is_written(run, tmp_path, says, damage):
    into = tmp_path / "paper"
    if damage == "folder":
        run = tmp_path
        (tmp_path / "run").rename(tmp_path.parent / f"{tmp_path.name}-gone")
        (tmp_path / "notes.txt").touch()
    elif damage == "parquet":
        (run / "episodes.parquet").write_bytes(b"PAR1")
    elif damage == "launch":
        (run / "launch.json").write_text("{")
    else:
        (tmp_path / "file").touch()
        into = tmp_path / "file" / "paper"
    before = sorted(tmp_path.rglob("*"))
    with says.raises(InputError):
        paper.main([str(run), "--into", str(into)])
    assert sorted(tmp_path.rglob("*")) == before
