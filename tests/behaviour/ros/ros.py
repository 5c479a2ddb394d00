"""A ROS of the test's own on the loopback, and the processes in it. All end with the `with` block, whatever happens."""

import contextlib
import json
import os
import queue
import random
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time

from tests.hearing import hear_signals
from tests.places import ROOT

LME = ("-m", "runners.cli.main", "live")
_FOUND = "import importlib.util as u; from runners.ros import {module}; {module}.check_installed()"
_PYTHONS = {1: [sys.executable], 2: [sys.executable, str(ROOT / ".venv-ros2" / "bin" / "python")]}
_NAMES = {1: "LME_ROS1_PYTHON", 2: "LME_ROS2_PYTHON"}  # a Python that has lme and this version of ROS


def python_of(version):
    """A Python that has this version of ROS; None if there is none."""
    named = os.environ.get(_NAMES[version])
    for python in [named] if named else _PYTHONS[version]:
        check = [python, "-c", _FOUND.format(module=f"ros{version}")]
        with contextlib.suppress(OSError):
            done = subprocess.run(check, env=_plain(), capture_output=True, timeout=60)
            if done.returncode == 0 and (version == 2 or shutil.which("roscore")):
                return python
    return None


def missing(version):
    """Why the tests with this version of ROS are skipped."""
    return f"ROS {version} is not installed (docs/howto/live.md); {_NAMES[version]} may name a Python that has it"


class Ros:
    """A ROS of its own."""

    def __init__(self, version, python, folder):
        self.version, self.python, self.folder = version, python, folder
        self._stack = contextlib.ExitStack()
        self._environment = _plain() | {"ROS_LOG_DIR": str(folder / "ros"), "PYTHONUNBUFFERED": "1"}
        if version == 1:
            self._port = _free_port()
            self._environment |= {"ROS_MASTER_URI": f"http://127.0.0.1:{self._port}", "ROS_IP": "127.0.0.1"}
        else:
            domain = str(random.SystemRandom().randrange(1, 101))
            self._environment |= {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_DOMAIN_ID": domain}

    def __enter__(self):
        if self.version == 1:
            self.start(["roscore", "-p", str(self._port)], "roscore")
            self._await_port()
        return self

    def __exit__(self, *_):
        self._stack.close()

    def start(self, words, name, **options):
        """A process in this ROS, which ends with it."""
        log = (self.folder / f"{name}.log").open("a")
        process = subprocess.Popen(
            words, env=self._environment, cwd=self.folder, stderr=log,
            stdout=options.pop("stdout", log), start_new_session=True, preexec_fn=hear_signals, **options,
        )  # fmt: skip
        self._stack.callback(end, process)
        return process

    def lme(self, *words, name="node"):
        """`lme live` with these words."""
        return self.start([self.python, *LME, *words, f"hydra.run.dir={self.folder / name}"], name)

    def probe(self):
        """A robot of `probe.py`."""
        return Probe(self)

    def log(self, name):
        """What a process has printed."""
        return (self.folder / f"{name}.log").read_text()

    def _await_port(self):
        for _ in range(200):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self._port), 1.0):
                return
            time.sleep(0.1)
        raise AssertionError(f"roscore does not answer: {self.log('roscore')}")


class Probe:
    """The process of `probe.py`, and what it says."""

    def __init__(self, ros):
        words = [ros.python, "-m", "tests.behaviour.ros.probe", str(ros.version)]
        self._process = ros.start(words, "probe", stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self._said = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        assert self.next(60.0).get("ready"), ros.log("probe")

    def set(self, **values):
        """Change what the robot senses, or send a goal or cancel."""
        self._process.stdin.write(json.dumps(values) + "\n")
        self._process.stdin.flush()

    def next(self, timeout):
        """The next thing it says."""
        return self._said.get(timeout=timeout)

    def commands(self, seconds):
        """(time [s], v, omega) of every command of the next seconds."""
        return [(one["time"], one["v"], one["omega"]) for one in self._during(seconds) if "v" in one]

    def until(self, fits, timeout=10.0):
        """The first thing it says from now on for which `fits`."""
        self._drain()
        end_time = time.monotonic() + timeout
        while (left := end_time - time.monotonic()) > 0.0:
            with contextlib.suppress(queue.Empty):
                said = self.next(left)
                if fits(said):
                    return said
        raise AssertionError(f"nothing fitting within {timeout} s")

    def _during(self, seconds):
        self._drain()
        time.sleep(seconds)
        return self._drain()

    def _drain(self):
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                found.append(self._said.get_nowait())
        return found

    def _listen(self):
        for line in self._process.stdout:
            self._said.put(json.loads(line))


def end(process, grace=5.0):
    """End a process and its children: as Ctrl-C does, then by force."""
    for number in (signal.SIGINT, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(grace)
    return process.returncode


def _plain():
    kept = {key: value for key, value in os.environ.items() if not key.startswith("ROS")}
    return kept | {"PYTHONPATH": str(ROOT)}


def _free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
