"""`lme figure`: the word for the kind, what may stand beside run=, and episodes where none are given."""

from pathlib import Path

import pytest

from lme.errors import InputError
from runners import cli
from runners.pictures.jobs import chosen_world, read_jobs

WORDS = ["runs=1", "executor=serial", "map.time_limit=1", "formats=[png]"]


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figure")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = ["trajectories", "-m", "system=simple,lme", "map.world=206", "hydra.sweep.dir=out"]
        assert cli.main(["figure", *words, *WORDS]) == 0
    return folder / "out"


def test_the_systems_of_a_sweep_are_driven_in_the_world_asked_for(sweep):
    jobs = read_jobs([sweep])
    assert [job.label for job in jobs] == ["Simple", "LME"]
    assert [chosen_world(job, [206]) for job in jobs] == [(206, 0)] * 2
    assert all(job.frame["world"].tolist() == [206] for job in jobs)


def test_one_figure_of_all_of_them(sweep):
    assert (sweep / "trajectories.png").read_bytes().startswith(b"\x89PNG")
    assert not list(sweep.glob("?/*.png"))


def test_records_are_drawn_without_driving(sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["trajectories", f"run={sweep}", "formats=[svg]", "hydra.run.dir=again"]
    assert cli.main(["figure", *words]) == 0
    assert Path("again/trajectories.svg").read_text().startswith("<?xml")
    assert not list(Path("again").glob("*.parquet"))
    assert capsys.readouterr().out.split() == ["again/trajectories.svg"]


def test_nobody_asked_for_a_world_so_the_first_is_driven(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["figure", "trajectories", "map=env1", "robot=stage", "hydra.run.dir=out", *WORDS]) == 0
    (job,) = read_jobs([Path("out")])
    assert job.frame["world"].tolist() == [0]


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["trajectorys"], ["figure=trajectorys: no such option", "did you mean trajectories?"]),
        (["run=nowhere"], ["nowhere is not a directory"]),
        (["run=nowhere", "map=env1"], ["map=env1: the episodes of run= are driven already"]),
        (["world=a"], ["world is 'a': must be a number, or a list of numbers"]),
        (["world=300"], ["300", "0 to 299"]),
        (["formats=[jpg]"], ["formats is ['jpg']: must be some of png, pdf, svg"]),
        (["formats=[]"], ["formats is []"]),
        (["experiment=table2"], ["experiment=table2: no such option"]),
    ],
)
def test_mistakes_are_told_in_one_line(words, parts, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["figure", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert all(part in error for part in parts)
    assert not Path("outputs").exists()


def test_a_world_that_was_not_driven_is_named(sweep):
    with pytest.raises(InputError, match=r"world is 7: .* has only 206"):
        chosen_world(read_jobs([sweep])[0], [7])


def test_the_kinds_are_completed(capsys):
    assert cli.main(["completion", "words", "--", "lme figure tra"]) == 0
    assert "trajectories" in capsys.readouterr().out.split()
