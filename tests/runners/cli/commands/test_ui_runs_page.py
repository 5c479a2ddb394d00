"""The addresses of tables of runs, as an MLflow server of ours would give them."""

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from runners.cli.commands.ui import METRICS, STATE, VIEW, RunsPage, addresses, is_up
from runners.reports.analysis import summary


class Mlflow(BaseHTTPRequestHandler):
    """Answers as MLflow does: experiment 1 has a run, experiment 0 has none."""

    experiments = (("1", "lme"), ("0", "Default"))
    is_read_only = False

    def do_GET(self):
        self._say(200, {})

    def do_POST(self):
        asked = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        what = self.path.removeprefix("/api/2.0/mlflow/")
        if what == "experiments/search":
            self._say(
                200,
                {
                    "experiments": [
                        {"experiment_id": number, "name": name} for number, name in self.experiments
                    ]
                },
            )
        elif what == "runs/search":
            self._say(200, {"runs": [{}]} if asked["experiment_ids"] == ["1"] else {})
        elif what == "experiments/set-experiment-tag":
            self.server.tags.append(asked)
            self._say(500 if self.is_read_only else 200, {})

    def _say(self, status, content):
        self.send_response(status)
        self.end_headers()
        self.wfile.write(json.dumps(content).encode())

    def log_message(self, *_):
        pass


@pytest.fixture
def server():
    with ThreadingHTTPServer(("127.0.0.1", 0), Mlflow) as found:
        found.tags = []
        found.address = f"http://127.0.0.1:{found.server_port}"
        threading.Thread(target=found.serve_forever, daemon=True).start()
        yield found
        found.shutdown()


def test_an_experiment_with_runs_has_a_table_with_our_columns(server, monkeypatch):
    monkeypatch.setenv("http_proxy", "http://192.0.2.1:9")  # would not answer
    assert is_up(server.address)
    page = f"{server.address}/#/experiments/1/runs?workflowType=machine_learning&viewStateShareKey={VIEW}"
    assert addresses(server.address) == [RunsPage("lme", page)]
    (tag,) = server.tags
    assert (tag["experiment_id"], tag["key"]) == ("1", f"mlflow.sharedViewState.{VIEW}")
    assert json.loads(tag["value"]) == STATE
    assert {"metrics.`success`", "metrics.`barn_metric`", "tags.`system`"} <= set(STATE["selectedColumns"])


def test_the_columns_are_metrics_that_runs_have():
    assert set(METRICS) <= {metric.key for metric in summary.METRICS}


def test_a_store_that_cannot_be_written_still_has_its_tables(server, monkeypatch):
    monkeypatch.setattr(Mlflow, "is_read_only", True)
    assert addresses(server.address) == [
        RunsPage("lme", f"{server.address}/#/experiments/1/runs?workflowType=machine_learning")
    ]


def test_without_runs_the_page_has_no_table(server, monkeypatch):
    monkeypatch.setattr(Mlflow, "experiments", (("0", "Default"),))
    assert addresses(server.address) == []


def test_a_server_that_is_not_up_does_not_answer(server):
    server.server_close()
    assert not is_up(server.address)
