"""`lme table` rebuilds from records what a run wrote, without simulating."""

import re

import numpy as np
import pytest

from lme.errors import InputError
from lme.navigation.episode import TRAJECTORY_COLUMNS
from runners.cli.commands import table
from runners.records.episode_record import EpisodeResult
from runners.records.records import RecordWriter
from tests.builders import episode_record
from tests.composing import jobs_of
from tests.made_runs import write_run


def test_table_prints_one_run_and_rewrites_its_files(tmp_path, capsys):
    with jobs_of() as job:
        write_run(tmp_path, job=job("sim=fast"))
    assert table.main([str(tmp_path), "--format", "md"]) == 0
    text = capsys.readouterr().out
    assert "| LME, 2 of 100 worlds | 0.500 |" in text
    assert "(published)" not in text
    assert text in (tmp_path / "table.md").read_text(encoding="utf-8")
    assert {"table.csv", "table.tex", "trajectories.png"} <= {path.name for path in tmp_path.iterdir()}


def test_a_run_without_its_steps_keeps_its_picture(tmp_path, says):
    with jobs_of() as job:
        write_run(tmp_path, job=job())
    (tmp_path / "trajectories.parquet").unlink()
    (tmp_path / "trajectories.png").write_text("as it was")
    with says.warns():
        assert table.main([str(tmp_path)]) == 0
    assert (tmp_path / "trajectories.png").read_text() == "as it was"


def test_a_run_that_cannot_be_written_still_shows_its_table(tmp_path, capsys):
    with jobs_of() as job:
        write_run(tmp_path, job=job())
    (tmp_path / "table.md").mkdir()
    with pytest.raises(InputError, match=r"cannot write to .*: the table above is all"):
        table.main([str(tmp_path), "--format", "md"])
    assert re.search(r"^(\| )?LME(,|\s)", capsys.readouterr().out, re.MULTILINE)


@pytest.mark.parametrize("style", ["rich", "csv", "tex"])
def test_every_format_of_an_unfinished_run_without_a_config(tmp_path, capsys, style, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    with RecordWriter(tmp_path) as writer:
        writer.append(EpisodeResult(episode_record(200), np.empty((0, len(TRAJECTORY_COLUMNS)))))
    assert table.main([str(tmp_path), "--format", style]) == 0
    assert re.search(r"^(\| )?LME(,|\s)", capsys.readouterr().out, re.MULTILINE)
    assert not (tmp_path / "trajectories.png").exists()


def test_a_sweep_gives_one_table(tmp_path, capsys):
    for number, subset in enumerate(("lab100", "official50")):
        write_run(tmp_path / str(number), subset, worlds=(200 - 200 * number, 201))
    table.main([str(tmp_path), "--format", "csv"])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(",")[:2] for line in lines] == [
        ["label", "subset"],
        ["LME", "lab100"],
        ["LME (published)", "lab100"],
        ["LME", "official50"],
    ]
    assert (tmp_path / "table.md").exists()


def test_a_sweeps_own_files_are_rewritten_but_not_its_jobs(tmp_path, capsys):
    """One of a single job too; the job's own when it is named."""
    with jobs_of() as job:
        write_run(tmp_path / "0", job=job("table=[drl_vo]", "map.worlds=[200,201]"))
    assert table.main([str(tmp_path), "--format", "md"]) == 0
    assert "DRL-VO (published)" in capsys.readouterr().out
    names = {path.name for path in tmp_path.iterdir()}
    assert {"table.md", "comparison.png"} <= names
    assert not {"table.md", "trajectories.png"} & {path.name for path in (tmp_path / "0").iterdir()}
    table.main([str(tmp_path / "0"), "--format", "md"])
    assert "DRL-VO" not in capsys.readouterr().out
    assert {"table.md", "trajectories.png"} <= {path.name for path in (tmp_path / "0").iterdir()}


def test_a_sweep_of_ablations_is_compared_in_text_and_in_a_picture(tmp_path, capsys):
    for number, ablation in enumerate(("none", "no_c_o")):
        write_run(tmp_path / str(number), ablation=ablation)
    table.main([str(tmp_path)])
    assert "No c_o: the paper says the most significant" in capsys.readouterr().out
    names = {f"ablation.{ending}" for ending in ("md", "csv", "png", "pdf")}
    assert names <= {path.name for path in tmp_path.iterdir()}


def test_several_runs_are_printed_and_nothing_is_written(tmp_path, capsys):
    for name in ("a", "b"):
        write_run(tmp_path / name)
    before = sorted(tmp_path.rglob("*"))
    table.main([str(tmp_path / "a"), str(tmp_path / "b")])
    assert capsys.readouterr().out.count("\nLME ") == 2 + 1  # the published row
    assert sorted(tmp_path.rglob("*")) == before


def test_a_folder_without_records(tmp_path, says):
    with says.raises(InputError):
        table.main([str(tmp_path)])


def test_several_runs_are_written_into_a_new_folder(tmp_path, capsys):
    for name, worlds in (("one", (200, 201)), ("two", (202, 203))):
        write_run(tmp_path / name, worlds=worlds)
    place = tmp_path / "both" / "of"
    assert (
        table.main([str(tmp_path / "one"), str(tmp_path / "two"), "--into", str(place), "--format", "md"])
        == 0
    )
    assert capsys.readouterr().out in (place / "table.md").read_text(encoding="utf-8")
    assert not (tmp_path / "one" / "table.md").exists()


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    write_run(tmp_path / "one")
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write to .*file"):
        table.main([str(tmp_path / "one"), "--into", str(tmp_path / "file" / "below")])
