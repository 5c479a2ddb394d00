"""Every command that lme prints or writes can be pasted into a shell, whatever runs and folders are called."""

import html
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from runners.cli.main import main
from tests.places import ROOT
from tests.runners.config.test_quoting import words_of

pytestmark = pytest.mark.usefixtures("undrawn")

RUN = Path("it's (50%), no. 1")
SHORT = ("map=env1", "map.worlds=[0]", "runs=1", "tracking=none", "executor=serial")
NO_HYDRA = str(RUN).replace("'", r"\'")


@pytest.fixture(autouse=True)
def _own_robot(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = Path("my own, conf/robot")
    folder.mkdir(parents=True)
    text = (ROOT / "conf" / "robot" / "stage.yaml").read_text()
    (folder / "mine.yaml").write_text(text.replace("name: stage", "name: mine"))


def paste(command, *more):
    """Run a command as a shell would."""
    program, *words = words_of(command)
    assert program == "lme"
    assert main([*words, *more]) == 0, command


def start(command, *words):
    place = f"hydra.{'sweep' if '-m' in words else 'run'}.dir='{NO_HYDRA}'"
    assert main([command, *words, "--config-dir", "my own, conf", place]) == 0


def test_those_of_a_run(capsys):
    start("eval", "robot=mine", *SHORT)
    capsys.readouterr()
    assert main(["explain", str(RUN)]) == 0
    commands = re.findall("lme explain .*", capsys.readouterr().out)
    assert len(commands) >= 2
    for command in commands:
        paste(command)


def test_those_of_a_sweep_and_of_its_jobs(capsys):
    start("eval", "-m", "robot=mine", "seed=0,1", *SHORT)
    capsys.readouterr()
    assert main(["explain", str(RUN)]) == 2
    said = capsys.readouterr().out
    driven = re.findall("lme eval .*", said)
    assert len(driven) == 2
    paste(driven[1], "hydra.run.dir=again")
    columns = ["seed", "robot", "world", "outcome", "steps", "path_length_m"]
    job, again = (
        pd.read_parquet(Path(folder, "episodes.parquet"))[columns] for folder in (RUN / "1", "again")
    )
    pd.testing.assert_frame_equal(job, again)
    assert main(["leaderboard", str(RUN), "--into", "board.html"]) == 0
    text = html.unescape(Path("board.html").read_text())
    assert all(f"<code>{command}</code>" in text for command in driven)


def test_those_of_a_training(capsys):
    words = (
        "map=env1",
        "map.configurations=1",
        "race=null",
        "trials=1",
        "configurations=1",
        "search.startup=1",
    )
    given = (
        "robot=mine",
        "name='w, 1'",
        "start_from_config=false",
        "runs=1",
        "tracking=none",
        "executor=serial",
    )
    start("train", *words, *given)
    said = capsys.readouterr().out
    use = re.search(r"(?:use them with|not recommended): (.*)", said)[1]
    written = (RUN / "weights.yaml").read_text().splitlines()[0]
    assert written == f"# Written by lme train; use with: {use}"
    paste(use, *SHORT)
    report = html.unescape((RUN / "report.html").read_text().replace("<wbr>", ""))
    others = set(re.findall(r"<code>(lme [^<]*)</code>", report)) - {use}
    assert {command.split()[1] for command in others} >= {"compare", "train"}
    shutil.rmtree(RUN / "explain", ignore_errors=True)
    for command in sorted(others):
        paste(command)
