"""SIGTERM as Slurm sends it, to every process of the command: one line, status 143, no process left, nothing lost."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from runners.cli import main as cli
from runners.cli.guards import Terminated, status_of, terminable
from runners.tracking.store import RUN_ID_FILE
from tests.places import ROOT

WORDS = ["map.subset=all", "tracking=none", "executor.workers=2", "hydra.run.dir=run"]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def in_group(group):
    """The processes of a group that still run."""
    done = subprocess.run(["ps", "-eo", "pgid=,stat=,args="], capture_output=True, text=True, check=True)
    rows = [line.split(None, 2) for line in done.stdout.splitlines()]
    return [args for pgid, state, args in rows if int(pgid) == group and not state.startswith("Z")]


def stopped(words, ready):
    """Exit status, output and group of `lme` that gets SIGTERM, with all its workers, as soon as `ready()`."""
    process = subprocess.Popen(
        [sys.executable, "-m", "runners.cli.main", *words],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120
    while not ready() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGTERM)
    said = process.communicate(timeout=60)[1]
    return process.returncode, said, process.pid


def test_an_evaluation_ends_in_order(tmp_path):
    log = Path("run", "parts", "episodes.jsonl")
    status, said, group = stopped(["eval", *WORDS], lambda: log.is_file() and log.stat().st_size)
    assert status == 143
    assert "finished work is kept. Continue with: lme eval resume=run" in said
    assert "Traceback" not in said
    for _ in range(100):
        if not in_group(group):
            break
        time.sleep(0.1)
    assert in_group(group) == []
    kept = log.read_bytes().count(b"\n")
    assert kept > 0
    assert cli.main(["eval", "resume=run", "map.worlds=[0]"]) == 2  # another config
    assert cli.main(["table", "run", "--format", "md"]) == 0
    assert log.read_bytes().count(b"\n") == kept


def test_a_sweep_names_the_whole_sweep():
    words = ["eval", "-m", "seed=range(50)", "map.worlds=[0]", "runs=1", "executor=serial", "tracking=none"]
    first = Path("sweep", "0", "episodes.parquet")
    status, said, _ = stopped([*words, "hydra.sweep.dir=sweep"], first.is_file)
    assert status == 143
    assert "The whole sweep: lme eval resume=sweep" in said
    assert "Traceback" not in said
    assert len(pd.read_parquet(first)) == 1


@pytest.mark.slow
@pytest.mark.parametrize("launcher", ["joblib", "submitit_local"])
def test_mlflow_knows_that_the_jobs_of_a_launcher_were_killed(launcher):
    pytest.importorskip(f"hydra_plugins.hydra_{launcher.partition('_')[0]}_launcher")
    words = [
        "eval",
        "-m",
        "seed=0,1",
        "map.subset=all",
        "runs=30",
        "executor=serial",
        "hydra.sweep.dir=sweep",
    ]
    notes = [Path("sweep", job, RUN_ID_FILE) for job in "01"]
    status, said, _ = stopped(
        [*words, f"hydra/launcher={launcher}", "tracking.uri=sqlite:///mlflow.db"],
        lambda: all(note.is_file() for note in notes),
    )
    assert status == 143
    assert "The whole sweep: lme eval resume=sweep" in said
    assert "Traceback" not in said
    states = sqlite3.connect("mlflow.db").execute("SELECT status FROM runs").fetchall()
    assert states == [("KILLED",)] * 3  # the sweep and its jobs


def terminated_twice(said):
    """SIGTERM, and once more while what it stops is being stopped."""
    with terminable():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(60)
        finally:
            os.kill(os.getpid(), signal.SIGTERM)
            said.append("stopped")


def test_the_second_signal_changes_nothing():
    said = []
    with pytest.raises(Terminated) as caught:
        terminated_twice(said)
    assert said == ["stopped"]
    assert status_of(caught.value) == 143
    assert status_of(KeyboardInterrupt()) == 130
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
