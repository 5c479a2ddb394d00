"""`lme play` from the command line: what it prints, refuses and how it ends."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request

import pytest

from lme.errors import InputError
from runners.cli import main
from runners.play import run
from tests.hearing import hear_signals
from tests.places import ROOT

pytest.importorskip("uvicorn", reason="needs uvicorn: the extra play")


@pytest.fixture
def started(tmp_path):
    """Starts `lme play` with words; returns the process and what it printed."""
    running = []

    def start(*words, **environment):
        command = [sys.executable, "-m", "runners.cli.main", "play", "browser=false", *words]
        settings = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
        process = subprocess.Popen(
            command,
            cwd=tmp_path,
            env=settings,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            preexec_fn=hear_signals,
        )
        running.append(process)
        lines = []
        while not (lines and "Ctrl-C" in lines[-1]):
            lines.append(process.stdout.readline())
            assert lines[-1], "".join(lines)
        return process, "".join(lines)

    yield start
    for process in running:
        process.kill()
        process.wait()


def answered(address):
    end = time.monotonic() + 20
    while True:
        try:
            return urllib.request.urlopen(address, timeout=5).status
        except OSError:
            assert time.monotonic() < end
            time.sleep(0.1)


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGTERM])
def test_it_serves_until_it_is_ended(started, end):
    process, said = started("port=0")
    address = re.search(r"http://127\.0\.0\.1:\d+/[\w-]{20,}/", said)[0]
    assert answered(address) == 200
    assert "ssh" not in said
    process.send_signal(end)
    assert process.wait(timeout=15) == 128 + end
    assert "Traceback" not in process.stdout.read()


def test_over_ssh_it_says_how_to_reach_it(started):
    _, said = started("port=0", SSH_CONNECTION="10.0.0.1 50000 10.0.0.2 22")
    port = re.search(r"127\.0\.0\.1:(\d+)/", said)[1]
    assert f"ssh -N -L {port}:127.0.0.1:{port} " in said


def test_a_port_in_use_is_one_line(capsys):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        assert main.main(["play", "browser=false", f"port={port}"]) == 2
    assert f"lme play: port {port} cannot be used" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["port=99999"],
        ["system=lem"],
        ["map=barn", "map.worlds=[77777]"],
        ["nowhere", "1/0"],
        ["--step", "3"],
        ["nowhere", "--step", "x"],
        ["nowhere", "1/0", "system=lme"],
        ["a", "b", "c"],
    ],
    ids=" ".join,
)
def test_a_mistake_is_one_line(words, capsys, tmp_path, monkeypatch, says):
    monkeypatch.chdir(tmp_path)
    assert main.main(["play", *words]) == 2
    said = capsys.readouterr().err
    says(said)
    assert len(said.strip().splitlines()) == 1


def test_without_the_extra_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert main.main(["play"]) == 2
    assert re.search(r"needs the packages .*uvicorn.*: pip install 'starlette", capsys.readouterr().err)


def test_a_browser_may_call_before_the_server_runs_and_on_this_machine_alone():
    with run.bound(0) as listener:
        host, port = listener.getsockname()
        assert host == "127.0.0.1"
        socket.create_connection((host, port), timeout=5).close()
        with pytest.raises(InputError, match="port=0 for any"):
            run.bound(port)
    with pytest.raises(InputError, match="must be 1 to 65535"):
        run.bound(-1)


def test_the_config_can_be_printed(capsys):
    assert main.main(["play", "system=lme", "--cfg", "job"]) == 0
    assert "lme.guides.lme.guide.Lme" in capsys.readouterr().out
    assert main.main(["play", "--help"]) == 0
    assert "lme play outputs/eval/RUN 282/1" in capsys.readouterr().out
