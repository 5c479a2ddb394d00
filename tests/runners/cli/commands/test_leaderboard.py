"""`lme leaderboard` collects what lies in outputs, and says what it left out."""

import json
import os
import shutil

import pytest

from runners.cli.main import main
from tests.composing import jobs_of
from tests.made_runs import write_run


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with jobs_of() as job:
        write_run(tmp_path / "outputs" / "eval" / "one", job=job())
        write_run(tmp_path / "outputs" / "eval" / "two", job=job("seed=1"), seed=1)
    return tmp_path


def test_without_arguments_leaderboard_reads_outputs(here, capsys, says):
    assert main(["leaderboard"]) == 0
    says(capsys.readouterr().out)
    text = (here / "outputs" / "leaderboard.html").read_text(encoding="utf-8")
    assert "outputs/eval/one" in text
    assert "2 of 100 worlds" in text


def test_a_run_that_cannot_be_read_is_reported_here_and_on_the_page(here, capsys, says):
    (here / "outputs" / "eval" / "two" / "episodes.parquet").write_text("junk")
    with says.warns():
        assert main(["leaderboard", "outputs", "--into", "board.html"]) == 0
    says(capsys.readouterr().out)
    assert "<h2>Left out</h2>" in (here / "board.html").read_text(encoding="utf-8")


def test_one_run_that_somebody_has_changed_does_not_stop_the_others(here, capsys):
    runs = here / "outputs" / "eval"
    strange = runs / os.fsdecode(b"caf\xe9\x1b[31m")
    shutil.copytree(runs / "one", strange)
    (runs / "one" / os.fsdecode(b"\xff.png")).write_bytes(b"")
    launch = json.loads((runs / "two" / "launch.json").read_text())
    (runs / "two" / "launch.json").write_text(json.dumps({**launch, "configs": [{"map": 5, "runs": "<b>"}]}))
    with pytest.warns(UserWarning, match="left out"):
        assert main(["leaderboard"]) == 0
    text = (here / "outputs" / "leaderboard.html").read_text(encoding="utf-8")
    assert "outputs/eval/one" in text
    assert "%FF.png" in text
    left_out = text.partition("<h2>Left out</h2>")[2]
    assert r"caf\udce9\x1b[31m: the name is not UTF-8" in left_out
    assert "eval/two: its launch.json is damaged: runs is &#39;&lt;b&gt;&#39;" in left_out
    assert "\x1b" not in text + "".join(capsys.readouterr())


def test_an_error_of_leaderboard_is_one_line(here, capsys, says):
    assert main(["leaderboard", "nowhere"]) == 2
    says(capsys.readouterr().err)
    assert main(["leaderboard", "--into", "outputs"]) == 2
    says(capsys.readouterr().err)
    for name in ("one", "two"):
        (here / "outputs" / "eval" / name / "episodes.parquet").write_text("junk")
    with pytest.warns(UserWarning, match="left out"):
        assert main(["leaderboard"]) == 2
    says(capsys.readouterr().err)


def test_a_link_is_followed_and_a_pipe_refused(here, capsys, says):
    (here / "board.html").symlink_to("elsewhere.html")
    assert main(["leaderboard", "--into", "board.html"]) == 0
    assert (here / "board.html").is_symlink()
    assert "outputs/eval/one" in (here / "elsewhere.html").read_text(encoding="utf-8")
    os.mkfifo(here / "pipe.html")
    assert main(["leaderboard", "--into", "pipe.html"]) == 2
    says(capsys.readouterr().err)
