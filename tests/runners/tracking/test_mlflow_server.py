"""Four sweeps at once are tracked on an MLflow server with a PostgreSQL behind it, also when the server goes away."""

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
import yaml

from runners.config.changes import flatten
from runners.records.launch_record import read_launch
from runners.records.records import read_episodes
from runners.reports.analysis.summary import metrics
from runners.tracking.store import DEFAULTS, RUN_ID_FILE
from tests import postgres
from tests.places import ROOT
from tests.runners.tracking.test_mlflow import logged

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(postgres.lacking()), reason=postgres.lacking() or "never"),
]
FILES = ["config.yaml", "episodes.parquet", "table.csv", "table.md", "table.tex", "trajectories.png"]


class Server:
    """An MLflow server. url: of its database. folder: of its artifacts."""

    def __init__(self, url, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.uri = f"http://127.0.0.1:{self._port}"
        self._words = [f"--backend-store-uri={url}", f"--artifacts-destination={folder}/artifacts"]
        self._log = folder / "log"

    def start(self):
        words = [*self._words, "--host=127.0.0.1", f"--port={self._port}"]
        with self._log.open("a") as log:
            self._process = subprocess.Popen(
                [Path(sys.executable).with_name("mlflow"), "server", *words],
                stdout=log, stderr=log, start_new_session=True,
            )  # fmt: skip
        while not self._answers():
            assert self._process.poll() is None, self._log.read_text()
            time.sleep(0.2)

    def kill(self):
        """Kill the server and its workers, which form a process group."""
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def _answers(self):
        try:
            return urllib.request.urlopen(f"{self.uri}/health", timeout=5).status == 200
        except (OSError, urllib.error.URLError):
            return False


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    pytest.importorskip("psycopg")
    with postgres.running() as database:
        url = database.create("mlflow").replace("postgresql:", "postgresql+psycopg:")
        found = Server(url, tmp_path_factory.mktemp("server"))
        found.start()
        yield found
        found.kill()


@pytest.fixture(autouse=True)
def _settings(monkeypatch):
    for name, value in DEFAULTS.items():
        monkeypatch.setenv(name, value)


def sweep(server, folder, *words):
    """Start `lme eval -m` in `folder`."""
    folder.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "runners.cli.main", "eval", "-m", "map.worlds=[0,1]", "runs=1", *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MLFLOW_TRACKING_URI": server.uri}
    return subprocess.Popen(
        [*command, "executor=serial", "hydra.sweep.dir=sweep"],
        cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


def agrees(server, run_dir, run, tmp_path):
    """Check that a run is finished, and equal to its directory."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=server.uri)
    assert run.info.status == "FINISHED"
    assert run.data.tags["run_dir"] == str(run_dir)
    assert run.data.metrics == metrics(read_episodes([run_dir]))
    for key, value in flatten(read_launch(run_dir).configs[0]):
        assert yaml.safe_load(run.data.params[key]) == yaml.safe_load(str(value)), key
    files = [file.path for file in client.list_artifacts(run.info.run_id)]
    assert files == FILES
    for name in FILES[1:]:
        copy = client.download_artifacts(run.info.run_id, name, str(tmp_path))
        assert Path(copy).read_bytes() == (run_dir / name).read_bytes()


def runs_below(server, folder):
    """All runs of the server that have their directory in `folder`, by directory."""
    from mlflow import MlflowClient

    client = MlflowClient(tracking_uri=server.uri)
    experiments = [experiment.experiment_id for experiment in client.search_experiments()]
    found = client.search_runs(experiments, f"tags.run_dir LIKE '{folder}/%'")
    by_directory = {Path(run.data.tags["run_dir"]): run for run in found}
    assert len(by_directory) == len(found)  # none is doubled
    return by_directory


def test_four_sweeps_at_once_lose_and_double_no_run(server, tmp_path):
    launchers = ["basic", "joblib", "basic", "basic"]  # jobs of a joblib launcher start at the same time
    places = [tmp_path / f"sweep{number}" for number in range(len(launchers))]
    sweeps = [
        sweep(server, place, f"seed={2 * number},{2 * number + 1}", f"hydra/launcher={launchers[number]}")
        for number, place in enumerate(places)
    ]
    for process in sweeps:
        output, _ = process.communicate()
        assert process.returncode == 0, output
        assert "not logged" not in output
    found = runs_below(server, tmp_path)
    parents = [place / "sweep" for place in places]
    assert set(found) == {*parents, *(parent / job for parent in parents for job in "01")}
    for parent in parents:
        assert found[parent].info.status == "FINISHED"
        assert found[parent].info.run_id == logged(server.uri, parent).info.run_id
        for job in "01":
            run = found[parent / job]
            assert run.data.tags["mlflow.parentRunId"] == found[parent].info.run_id
            agrees(server, parent / job, run, tmp_path / "copies")


def test_a_server_that_is_killed_costs_no_record_and_a_resumed_run_is_tracked(server, tmp_path):
    process = sweep(server, tmp_path / "a", "seed=0,1")
    note = tmp_path / "a" / "sweep" / "0" / RUN_ID_FILE
    while not note.is_file():
        assert process.poll() is None
        time.sleep(0.05)
    server.kill()
    output, _ = process.communicate()
    assert process.returncode == 0, output
    assert f"not logged to MLflow at {server.uri}; the results are on disk" in output
    jobs = [tmp_path / "a" / "sweep" / job for job in "01"]
    assert [len(read_episodes([job])) for job in jobs] == [2, 2]
    server.start()
    process = sweep(server, tmp_path / "a", "seed=0,1", "resume=true")
    output, _ = process.communicate()
    assert process.returncode == 0, output
    assert "not logged" not in output
    found = runs_below(server, tmp_path)
    assert set(found) == {jobs[0].parent, *jobs}
    for job in jobs:
        agrees(server, job, found[job], tmp_path / "copies")
