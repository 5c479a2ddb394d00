"""`lme ui` serves the store on loopback, and says plainly when it cannot."""

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

from lme.config.presets import load_settings
from lme.errors import InputError
from runners.cli.commands import ui
from runners.tracking.mlflow import MlflowTracking
from runners.tracking.store import open_client
from tests.hearing import hear_signals
from tests.places import ROOT
from tests.runners.reports.explainer import conftest

browser = conftest.browser  # the fixture
SCRIPT = "import sys; from runners.cli.commands import ui; sys.exit(ui.main(sys.argv[1:]))"


@pytest.fixture
def port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def fetch(port, limit_s=60.0):
    """The page, once it is there."""
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        try:
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5) as answer:
                return answer.status, answer.read().decode()
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.2)
    raise TimeoutError(f"nothing on port {port}")


@pytest.mark.slow
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM])
def test_ui_serves_on_loopback_until_it_is_ended(tmp_path, port, ending):
    uri = f"sqlite:///{tmp_path}/mlflow.db"
    open_client(uri)
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, "--uri", uri, "--port", str(port)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=hear_signals,
    )
    try:
        status, page = fetch(port)
        assert (status, "MLflow" in page) == (200, True)
        addresses = Path("/proc/net/tcp")
        if addresses.exists():
            listening = [line.split()[1:4] for line in addresses.read_text().splitlines()[1:]]
            own = [local for local, _, state in listening if state == "0A" and local.endswith(f":{port:04X}")]
            assert own == [f"0100007F:{port:04X}"]  # 127.0.0.1 and nothing else
    finally:
        process.send_signal(ending)
        output, _ = process.communicate(timeout=30)
    assert process.returncode == 0
    assert f"http://127.0.0.1:{port}" in output
    assert "Traceback" not in output
    assert [path.name for path in tmp_path.iterdir()] == ["mlflow.db"]
    with socket.socket() as probe:
        assert probe.connect_ex(("127.0.0.1", port)) != 0


@pytest.mark.slow
def test_the_printed_address_shows_a_table_of_runs_with_their_metrics(tmp_path, port, browser):
    uri = f"sqlite:///{tmp_path}/mlflow.db"
    tracking = MlflowTracking(load_settings("tracking/mlflow", uri=uri))
    tags = {"system": "Walker", "map": "hall", "command": "eval"}
    tracking.start({"seed": 0}, tmp_path / "sweep" / "0", tags, tmp_path / "sweep")
    tracking.finish({"success": 0.875, "barn_metric": 0.4375}, [])
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT, "--uri", uri, "--port", str(port)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        line = next(line for line in process.stdout if line.startswith("Runs of lme: "))
        page = browser.new_context(viewport={"width": 1600, "height": 900}).new_page()
        page.goto(line.split()[-1])
        for shown in ("success", "barn_metric", "Walker", "0.875", "0.4375"):
            page.get_by_text(shown, exact=True).first.wait_for(timeout=60_000)
        assert page.get_by_text("1 matching run").count() == 1  # its sweep has no metrics of its own
        page.context.close()
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=30)
    assert process.returncode == 0


def test_ui_without_a_store_is_an_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=r"no store at outputs/mlflow\.db: run `lme eval` here first"):
        ui.main([])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--port", "0"], "--port is 0: must be 1 to 65535"),
        (["--host", "203.0.113.1"], "--host 203.0.113.1 --port 5000 cannot be used"),
        (["--uri", "http://127.0.0.1:5000"], "a server already: open it in a browser"),
        (["--uri", "outputs"], "--uri is outputs: must be a database or a server"),
    ],
)
def test_an_error_of_ui_is_one_line(tmp_path, arguments, message):
    (tmp_path / "mlflow.db").touch()
    with pytest.raises(InputError, match=message) as caught:
        ui.main(["--uri", f"sqlite:///{tmp_path}/mlflow.db", *arguments])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("words", "is_open"), [([], False), (["--host", "0.0.0.0"], True)])
def test_a_server_that_others_reach_is_warned_of(tmp_path, port, monkeypatch, recwarn, words, is_open):
    (tmp_path / "mlflow.db").touch()
    served = []
    monkeypatch.setattr(ui, "_serve", lambda command, *_: served.append(command) or 0)
    assert ui.main(["--uri", f"sqlite:///{tmp_path}/mlflow.db", "--port", str(port), *words]) == 0
    assert served[0][served[0].index("--host") + 1] == ("0.0.0.0" if is_open else "127.0.0.1")
    assert ["asks for no password" in str(warning.message) for warning in recwarn] == [True] * is_open


@pytest.mark.parametrize(
    ("host", "address"),
    [
        ("127.0.0.1", "http://127.0.0.1:5000"),
        ("0.0.0.0", "http://127.0.0.1:5000"),
        ("::", "http://[::1]:5000"),
        ("robot.local", "http://robot.local:5000"),
    ],
)
def test_the_address_is_one_that_a_browser_here_can_open(host, address):
    assert ui._address(host, 5000) == address


def test_a_port_that_is_taken(tmp_path):
    (tmp_path / "mlflow.db").touch()
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        taken = other.getsockname()[1]
        with pytest.raises(InputError, match=f"--port {taken} cannot be used .*choose another port"):
            ui.main(["--uri", f"sqlite:///{tmp_path}/mlflow.db", "--port", str(taken)])
