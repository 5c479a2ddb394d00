"""Open MLflow's page with the runs tracked so far."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
import sysconfig
import time
import urllib.request
import warnings
from typing import Any, NamedTuple

from lme.errors import InputError
from runners.cli.help import texts

EXAMPLES = (
    "lme ui",
    "lme ui --port 5001 --uri sqlite:///elsewhere/mlflow.db",
)
_LOOPBACK = ("127.0.0.1", "::1", "localhost")
_OPEN = (
    "--host is {}: MLflow asks for no password, so whoever reaches port {} can read, change and delete runs"
)
VIEW = "lme"
METRICS = ("success", "barn_metric", "collision", "timeout", "time_s", "spl")
COLUMNS = ["tags.`system`", *(f"metrics.`{name}`" for name in METRICS), "tags.`map`", "tags.`command`"]
STATE = {
    "selectedColumns": COLUMNS,
    "columnOrder": COLUMNS,
    "searchFilter": "tags.command != 'sweep'",  # the metrics belong to a sweep's jobs
    "orderByKey": "tags.`started`",  # sorted by creation, jobs are hidden below their sweeps
    "orderByAsc": False,
}
_PAGES = "?workflowType=machine_learning"  # those for runs with metrics, not those for agents
_TIMEOUT_S = 30.0


def main(argv: list[str]) -> int:
    """Serve until Ctrl-C. Raises InputError if there is no store or the port is taken."""
    from runners.config.escaping import masked
    from runners.tracking.store import DEFAULTS

    arguments = _parser().parse_args(argv)
    _check_store(arguments.uri)
    _check_address(arguments.host, arguments.port)
    if arguments.host not in _LOOPBACK:
        warnings.warn(_OPEN.format(arguments.host, arguments.port), stacklevel=2)
    address = _address(arguments.host, arguments.port)
    print(f"MLflow on {address} shows {masked(arguments.uri)}; Ctrl-C ends it", flush=True)
    # MLflow's job execution is not used here and would start five more processes.
    environment = {
        **DEFAULTS,
        "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false",
        "PYTHONWARNINGS": "ignore",
        **os.environ,
    }
    return _serve(_server(arguments.uri, arguments.host, arguments.port), environment, address)


def _parser() -> argparse.ArgumentParser:
    from runners.tracking.store import DEFAULT_URI

    parser = argparse.ArgumentParser(prog="lme ui", **texts(__doc__, EXAMPLES))
    parser.add_argument("--port", type=int, default=5000, help="default: 5000")
    parser.add_argument("--host", default="127.0.0.1", help="default: 127.0.0.1, this machine alone")
    parser.add_argument(
        "--uri",
        default=os.environ.get("MLFLOW_TRACKING_URI", DEFAULT_URI),
        help=f"where runs are tracked; default: MLFLOW_TRACKING_URI, else {DEFAULT_URI}",
    )
    return parser


def _server(uri: str, host: str, port: int) -> list[str]:
    """Return the command that starts MLflow's server. One worker is enough for one person."""
    options = {"backend-store-uri": uri, "host": host, "port": str(port), "workers": "1"}
    # Without a folder to import from, uvicorn searches the working folder before the standard library.
    options["uvicorn-opts"] = f"--log-level warning --app-dir {shlex.quote(sysconfig.get_path('stdlib'))}"
    flags = [word for name, value in options.items() for word in (f"--{name}", value)]
    return [sys.executable, "-m", "mlflow", "server", *flags]


def _address(host: str, port: int) -> str:
    """Return the server's address for a browser on this machine."""
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def _serve(command: list[str], environment: dict[str, str], address: str) -> int:
    """Run the server until it ends or this process is terminated; print where the runs are once it answers."""
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    # In a session of its own: the server answers a Ctrl-C with a traceback.
    server = subprocess.Popen(command, env=environment, start_new_session=True)
    try:
        _announce(server, address)
        return server.wait()
    except KeyboardInterrupt:
        return 0
    finally:
        server.terminate()
        server.wait()


def _announce(server: subprocess.Popen[bytes], address: str) -> None:
    """Print where the runs are as soon as the server answers; print nothing if it ends before."""
    while not is_up(address):
        if server.poll() is not None:
            return
        time.sleep(0.2)
    try:
        pages = addresses(address)
    except (OSError, ValueError, KeyError):  # the page itself says more
        return
    for page in pages:
        print(f"Runs of {page.experiment}: {page.address}", flush=True)
    if not pages:
        print("No run is tracked there yet", flush=True)


def _check_store(uri: str) -> None:
    from runners.config.escaping import masked
    from runners.tracking.store import check_uri, sqlite_path

    check_uri("--uri", uri)
    if uri.startswith("http"):
        raise InputError(f"--uri is {masked(uri)}, a server already: open it in a browser")
    path = sqlite_path(uri)
    if path is not None and not path.is_file():
        raise InputError(f"no store at {path}: run `lme eval` here first, or name another with --uri")


def _check_address(host: str, port: int) -> None:
    """Bind the port once as a check, since the server itself reports a taken port in forty lines."""
    if not 0 < port < 65536:
        raise InputError(f"--port is {port}: must be 1 to 65535")
    try:
        with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        raise InputError(
            f"--host {host} --port {port} cannot be used ({error.strerror}): choose another port"
        ) from None


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
            f"{server}/#/experiments/{experiment['experiment_id']}/runs{_PAGES}{_shared(server, experiment)}",
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
    return f"&viewStateShareKey={VIEW}"


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
