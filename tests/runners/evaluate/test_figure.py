"""`lme figure`: the name of the kind, what may be given with run=, and episodes where none are given."""

import shutil
from pathlib import Path

import pytest

from lme.errors import InputError
from runners.cli.main import main
from runners.evaluate import figure
from runners.reports.figures import driven_runs
from runners.reports.figures.driven_runs import chosen_world, read_runs
from tests.places import ROOT

WORDS = ["runs=1", "executor=serial", "map.time_limit=1", "formats=[png]"]


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figure")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        words = ["trajectories", "-m", "system=simple,lme", "map.world=206", "hydra.sweep.dir=out"]
        assert main(["figure", *words, *WORDS]) == 0
    return folder / "out"


def test_the_systems_of_a_sweep_are_driven_in_the_world_asked_for(sweep):
    jobs = read_runs([sweep])
    assert [job.label for job in jobs] == ["Simple", "LME"]
    assert [chosen_world(job, [206]) for job in jobs] == [(206, 0)] * 2
    assert all(job.frame["world"].tolist() == [206] for job in jobs)
    assert all(job.frame["subset"].tolist() == ["custom"] for job in jobs)


def test_a_sweep_has_one_figure_of_all_its_systems(sweep):
    assert (sweep / "trajectories.png").read_bytes().startswith(b"\x89PNG")
    assert not list(sweep.glob("?/*.png"))


def test_records_are_drawn_without_driving(sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words = ["trajectories", f"run={sweep}", "formats=[svg]", "hydra.run.dir=again"]
    assert main(["figure", *words]) == 0
    assert Path("again/trajectories.svg").read_text().startswith("<?xml")
    assert not list(Path("again").glob("*.parquet"))
    assert capsys.readouterr().out.split() == ["again/trajectories.svg"]


@pytest.mark.parametrize("words", [[], ["moment=3", "figure.subgoals=faded"]])
def test_paths_without_their_steps_are_driven_again(sweep, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(sweep, "bare")
    for path in Path("bare").glob("?/trajectories.parquet"):
        path.unlink()
    for run, place in ((sweep, "before"), ("bare", "after")):
        drawn = ["trajectories", f"run={run}", "formats=[png]", f"hydra.run.dir={place}", *words]
        assert main(["figure", *drawn]) == 0
    before, after = (Path(place, "trajectories.png").read_bytes() for place in ("before", "after"))
    assert after == before


def test_only_the_worlds_asked_for_are_driven_again(sweep, tmp_path, monkeypatch):
    shutil.copytree(sweep / "0", tmp_path / "bare")
    (tmp_path / "bare" / "trajectories.parquet").unlink()
    (run,) = read_runs([tmp_path / "bare"])
    assert run.steps([205]).empty
    driven = run.steps([206])
    assert len(driven) == run.frame["steps"].iloc[0] + 1
    monkeypatch.setattr(driven_runs, "step_tables", None)
    assert run.steps([206]).equals(driven)


def test_nobody_asked_for_a_world_so_the_first_is_driven(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["figure", "trajectories", "map=env1", "robot=stage", "hydra.run.dir=out", *WORDS]) == 0
    (job,) = read_runs([Path("out")])
    assert job.frame["world"].tolist() == [0]


def test_an_own_map_set_need_not_name_its_worlds(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = (ROOT / "conf" / "map" / "_room.yaml").read_text().splitlines()
    kept = [line for line in lines if not line.startswith(("worlds:", "name:"))]
    Path("own/map").mkdir(parents=True)
    Path("own/map/mine.yaml").write_text("\n".join([*kept, "name: env1"]))
    words = ["trajectories", "--config-dir", "own", "map=mine", "robot=stage", "hydra.run.dir=out"]
    assert main(["figure", *words, *WORDS]) == 0
    (job,) = read_runs([Path("out")])
    assert job.frame["world"].tolist() == [0]


@pytest.mark.parametrize(
    ("kind", "words", "guide"),
    [
        ("expected_time", ["guide=lme"], "lme_plus"),
        ("method", ["system=dwa"], "lme"),
        ("features", ["system=dwa"], "lme"),
    ],
)
def test_another_guide_is_refused_before_it_drives(tmp_path, monkeypatch, capsys, kind, words, guide):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(figure, "drive", None)
    assert main(["figure", kind, "world=206", *words, *WORDS]) == 2
    assert f": {kind} draws how LME" in (error := capsys.readouterr().err)
    assert f"choose guide={guide}, or" in error
    assert not list(Path("outputs").glob("figure/*"))


def test_a_sweep_leaves_out_what_another_guide_guides(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["features", "-m", "system=simple,lme", "step=2", "map.world=206", "hydra.sweep.dir=out"]
    assert main(["figure", *words, *WORDS]) == 0
    assert Path("out/features.png").is_file()


@pytest.mark.parametrize(
    "words",
    [
        ["trajectorys"],
        ["run=nowhere"],
        ["maps", "map=env1"],
        ["run=nowhere", "map=env1"],
        ["world=a"],
        ["world=300"],
        ["run=nowhere", "stpe=3"],
        ["features", "step=-1"],
        ["-m", "world=3,4"],
        ["-m", "run=a,b"],
        ["features", "-m", "step=3,4"],
        ["formats=jpg"],
        ["formats=[jpg]"],
        ["formats=[]"],
        ["experiment=table2"],
    ],
    ids=" ".join,
)
def test_mistakes_are_reported_in_one_line(words, tmp_path, monkeypatch, capsys, says):
    monkeypatch.chdir(tmp_path)
    assert main(["figure", *words]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    says(error)
    assert not Path("outputs").exists()


def test_a_world_that_was_not_driven_is_named(sweep, says):
    with says.raises(InputError, match="world.*7"):
        chosen_world(read_runs([sweep])[0], [7])


def test_a_world_that_the_map_set_does_not_choose_is_driven_and_run_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["trajectories", "world=3", "moment=2", "hydra.run.dir=out", *WORDS]
    assert main(["figure", *words]) == 0  # no world of lab100
    assert main(["figure", "features", "run=out", "step=2", "formats=png", "hydra.run.dir=again"]) == 0
    assert Path("out/trajectories.png").is_file()
    assert Path("again/features.png").is_file()


@pytest.mark.parametrize(
    ("words", "part"), [(["world=7"], "world is 7"), (["moment=900"], "figure.moment is 900")]
)
def test_a_figure_that_cannot_be_drawn_leaves_no_directory(sweep, tmp_path, monkeypatch, capsys, words, part):
    monkeypatch.chdir(tmp_path)
    assert main(["figure", "trajectories", f"run={sweep}", "hydra.run.dir=out", *words]) == 2
    assert part in capsys.readouterr().err
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]
    assert not Path("out").exists()


def test_records_without_a_config_cannot_be_drawn(sweep, tmp_path, monkeypatch, capsys, says):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(sweep / "1", "bare")
    Path("bare/launch.json").unlink()
    assert main(["figure", "trajectories", "run=bare"]) == 2
    says(capsys.readouterr().err)


def test_help_lists_the_keys_of_the_kind(capsys):
    assert main(["figure", "features", "--help"]) == 0
    told = capsys.readouterr().out
    assert "lme figure [KIND]" in told
    assert "figure.percentiles=[5, 95]" in told
    assert "figure.layout" not in told
    assert main(["figure", "--help"]) == 0
    assert "figure.layout=side_by_side" in capsys.readouterr().out


def test_keys_of_the_kind_are_completed(capsys):
    assert main(["completion", "words", "--", "lme figure video figure."]) == 0
    assert "figure.fps=" in capsys.readouterr().out.split()


def test_the_kinds_are_completed(capsys):
    assert main(["completion", "words", "--", "lme figure tra"]) == 0
    assert "trajectories" in capsys.readouterr().out.split()
