"""Several `lme train` share one study in a real PostgreSQL, MariaDB or Redis, and some of them are killed."""

import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import optuna
import pytest
import yaml

from runners.cli.main import main
from runners.training import study
from runners.training.storage import open_storage
from tests import mariadb, postgres, redis_server
from tests.places import ROOT

pytestmark = pytest.mark.usefixtures("undrawn")

SMALL = (
    "map=env1",
    "race=null",
    "study=shared", "search=random", "search.batch=3", "configurations=1", "runs=1", "map.configurations=1",
    "tracking=none", "executor=serial",
)  # fmt: skip
# lme train with quick heartbeats. It stores no scores before each process has a trial. It is killed when it stores the
# scores of its n-th trial; 0: never. Then it takes some seconds for the third.
PROGRAM = """
import os, pathlib, signal, sys, time
from runners.cli.main import main
from runners.training import storage, study
storage.HEARTBEAT_S, storage.GRACE_S = 1, 3
left, pause, started, keep = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), study.Study.store_scores

def counted(*given):
    global left
    pathlib.Path("has_a_trial").touch()
    while len(list(pathlib.Path("..").glob(f"{started}-*/has_a_trial"))) < started:
        time.sleep(0.01)
    left -= 1
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    if left == -3:
        time.sleep(pause)
    keep(*given)

study.Study.store_scores = counted
sys.exit(main(["train", *sys.argv[4:]]))
"""


def served(module, driver):
    """A running server, if it and its driver are installed."""
    pytest.importorskip(driver)
    if module.lacking():
        pytest.skip(module.lacking())
    with module.running() as found:
        yield found


@pytest.fixture(scope="module")
def server():
    yield from served(postgres, "psycopg")


@pytest.fixture(scope="module")
def mysql():
    yield from served(mariadb, "pymysql")


@pytest.fixture(scope="module")
def redis():
    yield from served(redis_server, "redis")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def started(name, url, killed_at, trials, pause, processes):
    Path(name).mkdir()
    words = [*SMALL, f"trials={trials}", f"storage='{url}'", "hydra.run.dir=run"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(killed_at), str(pause), str(processes), *words],
        cwd=name, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def trials_of(url):
    return optuna.load_study(study_name="shared", storage=open_storage(url)).get_trials()


def train_together(url, killed_at, trials, pause=0.0):
    """Start one process per entry at once. Returns the trials, and the weights of those that were not killed."""
    processes = [
        started(f"{len(killed_at)}-{number}", url, kill, trials, pause, len(killed_at))
        for number, kill in enumerate(killed_at)
    ]
    outputs = [process.communicate(timeout=200) for process in processes]
    for process, kill, (_, errors) in zip(processes, killed_at, outputs, strict=True):
        assert process.returncode == (-signal.SIGKILL if kill else 0), errors
    whole = [f"{len(killed_at)}-{number}" for number, kill in enumerate(killed_at) if not kill]
    return trials_of(url), [yaml.safe_load(Path(name, "run/weights.yaml").read_text()) for name in whole]


def check(found, weights, trials):
    states = Counter(trial.state.name for trial in found)
    assert states["COMPLETE"] == trials
    assert set(states) <= {"COMPLETE", "FAIL"}
    told = [trial for trial in found if trial.state.name == "COMPLETE"]
    best = max(told, key=lambda trial: (trial.value, -trial.number))
    for each in weights:
        assert (each["trial"], each["reward"], each["trials"]) == (best.number, best.value, trials)
    repeated = [trial.system_attrs["failed_trial"] for trial in told if "failed_trial" in trial.system_attrs]
    assert len(set(repeated)) == len(repeated)
    values = {trial.number: trial.params for trial in found}
    for trial in told:
        assert trial.params == values[trial.system_attrs.get("failed_trial", trial.number)]
    return repeated


def test_the_trials_of_a_killed_process_go_to_the_other(server):
    found, weights = train_together(server.create("two"), [1, 0], trials=8)
    assert len(check(found, weights, 8)) >= 3


@pytest.mark.slow
def test_four_processes_of_which_two_are_killed(server):
    """A trial of the others takes longer than a silent process is given, and is not taken from them."""
    found, weights = train_together(server.create("four"), [2, 0, 5, 0], trials=30, pause=5.0)
    assert len(weights) == 2
    assert 4 <= len(check(found, weights, 30)) <= 6


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("postgresql://guest:wrong@/postgres?host={folder}", "password authentication failed"),
        ("postgresql://me:wrong@/nowhere?host={folder}", 'database "nowhere" does not exist'),
        ("postgresql://me:wrong@/postgres?host=/nowhere", "connection to server on socket"),
    ],
)
def test_a_storage_that_refuses_is_one_line(server, url, said, capsys):
    words = [*SMALL, "trials=1", f"storage='{url.format(folder=server.folder)}'"]
    assert main(["train", *words]) == 2
    shown = capsys.readouterr().err
    assert "storage is postgresql://" in shown
    assert said in shown
    assert "wrong" not in shown
    assert shown.count("\n") == 1
    assert not list(Path().iterdir())


def test_a_storage_that_goes_away_loses_no_finished_trial(server, monkeypatch, capsys):
    """It goes when the second trial of three has been driven; the first is stored."""
    kept, keep = [], study.Study.store_scores

    def stopping(self, number, scores):
        kept.append(number)
        if len(kept) == 2:
            server.stop()
        keep(self, number, scores)

    monkeypatch.setattr(study.Study, "store_scores", stopping)
    words = [*SMALL, "trials=3", f"storage='{server.create('away')}'", "hydra.run.dir=run"]
    assert main(["train", *words]) == 2
    shown = capsys.readouterr().err.splitlines()[-1]
    assert shown.count("storage is ") == 1
    assert "no longer answers" in shown
    assert "finished trials are kept, continue with: lme train resume=" in shown
    server.start()
    assert main(["train", "resume=run"]) == 0
    assert kept == [0, 1, 2]
    assert yaml.safe_load(Path("run/weights.yaml").read_text())["trials"] == 3


@pytest.mark.slow
def test_mariadb_keeps_what_postgresql_keeps(mysql, monkeypatch, capsys):
    """Processes that start together create its tables, one is killed, and the server stops and comes again."""
    found, weights = train_together(mysql.create("two"), [1, 0], trials=8)
    assert len(check(found, weights, 8)) >= 3
    found, weights = train_together(mysql.create("three"), [0, 0, 0], trials=9)
    assert len(weights) == 3
    check(found, weights, 9)
    test_a_storage_that_goes_away_loses_no_finished_trial(mysql, monkeypatch, capsys)


@pytest.mark.slow
def test_redis_ends_with_exactly_the_trials_and_a_killed_run_continues(redis):
    found, weights = train_together(redis, [1, 0], trials=8)
    states = Counter(trial.state.name for trial in found)
    assert len(weights) == 1
    assert 0 < states["RUNNING"] <= 3  # those of the killed process
    assert states["COMPLETE"] + states["RUNNING"] == 8
    assert main(["train", "resume=2-0/run"]) == 0
    states = Counter(trial.state.name for trial in trials_of(redis))
    assert states["COMPLETE"] == 8
    assert set(states) <= {"COMPLETE", "FAIL"}
