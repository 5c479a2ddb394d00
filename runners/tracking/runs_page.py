"""Addresses of MLflow's page with tables of runs and their metrics.

MLflow's page opens without runs, and its tables without metrics. A shared view is a tag of its experiment, and an
address can name it. `addresses` shares one view of every experiment. It asks the server, because importing MLflow takes
seconds.
"""

from __future__ import annotations

import json
import urllib.request
from typing import Any, NamedTuple

VIEW = "lme"
METRICS = ("success", "barn_metric", "collision", "timeout", "time_s", "spl")
COLUMNS = ["tags.`system`", *(f"metrics.`{name}`" for name in METRICS), "tags.`map`", "tags.`command`"]
STATE = {
    "selectedColumns": COLUMNS,
    "columnOrder": COLUMNS,
    "searchFilter": "tags.command != 'sweep'",  # the metrics belong to a sweep's jobs
    "orderByKey": "tags.`mlflow.runName`",  # dates; sorted by creation, jobs are hidden below their sweeps
    "orderByAsc": False,
}
_TIMEOUT_S = 30.0


class RunsPage(NamedTuple):
    """Table of the runs of one experiment."""

    experiment: str
    address: str


def is_up(server: str) -> bool:
    """Return whether the server is up."""
    try:
        with _opener_without_proxy().open(f"{server}/health", timeout=_TIMEOUT_S):
            return True
    except OSError:
        return False


def addresses(server: str) -> list[RunsPage]:
    """Return the tables of all experiments that have runs, the latest experiment first.

    server: its address, without a trailing slash. Raises OSError or ValueError if it does not answer as MLflow does.
    """
    return [
        RunsPage(
            str(experiment["name"]),
            f"{server}/#/experiments/{experiment['experiment_id']}/runs{_shared(server, experiment)}",
        )
        for experiment in _ask(server, "experiments/search", max_results=1000).get("experiments", [])
        if _ask(server, "runs/search", experiment_ids=[experiment["experiment_id"]], max_results=1).get(
            "runs"
        )
    ]


def _shared(server: str, experiment: dict[str, Any]) -> str:
    """Share our view of the experiment; return the end of its address, or "" if the store cannot be written."""
    tag = {"key": f"mlflow.sharedViewState.{VIEW}", "value": json.dumps(STATE)}
    try:
        _ask(server, "experiments/set-experiment-tag", experiment_id=experiment["experiment_id"], **tag)
    except OSError:
        return ""
    return f"?viewStateShareKey={VIEW}"


def _ask(server: str, method: str, **content: Any) -> dict[str, Any]:
    """Return the server's answer to a request of its REST interface."""
    request = urllib.request.Request(
        f"{server}/api/2.0/mlflow/{method}",
        json.dumps(content).encode(),
        {"Content-Type": "application/json"},
    )
    with _opener_without_proxy().open(request, timeout=_TIMEOUT_S) as answer:
        return dict(json.load(answer))


def _opener_without_proxy() -> urllib.request.OpenerDirector:
    """Return an opener that ignores the user's proxy, since the server is on this machine."""
    return urllib.request.build_opener(urllib.request.ProxyHandler({}))
