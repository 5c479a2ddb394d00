"""Modules of the working folder come last, also in the processes that a command starts."""

import importlib.util
import os
import socket
import subprocess
import sys
import sysconfig
import time
import urllib.error
import urllib.request

import pytest

from runners.workers.environment import search_working_folder_last
from tests.hearing import hear_signals

SHORT = ["eval", "map.worlds=[0,3]", "runs=1", "planner._target_=my_module.Planner"]
TRAIN = [
    "train",
    "planner._target_=my_module.Planner",
    "map=env1",
    "map.configurations=2",
    "configurations=2",
    "runs=1",
    "race=null",
    "trials=3",
    "search.startup=1",
]
LEARN = [
    "learn",
    "validation=2",
    "runs=1",
    "map.worlds=[0,6]",
    *(f"{each}.time_limit=8" for each in ("map", "training.fresh", "training.fresh_hard")),
    "learner.rounds=1",
    "learner.episodes=2",
    "learner.updates=[2,2]",
    "learner.time_limit=3",
]
PLANNER = """
from dataclasses import dataclass

@dataclass
class Config:
    pass

class Planner:
    Config = Config

    def __init__(self, config, robot):
        pass

    def reset(self, rng):
        pass

    def plan(self, observation, guidance):
        return 0.5, 0.0
"""
PACKAGES = (
    "numpy",
    "yaml",
    "hydra",
    "matplotlib",
    "mlflow",
    "optuna",
    "pandas",
    "torch",
    "flask",
    "uvicorn",
    "sqlalchemy",
    "joblib",
    "submitit",
    "distributed",
)


def shadowed():
    """Modules of the standard library, from files, and packages that some child imports."""
    folder = sysconfig.get_path("stdlib")
    names = (name for name in sys.stdlib_module_names if not name.startswith("_"))
    specs = {name: importlib.util.find_spec(name) for name in names}
    library = [
        name for name, spec in specs.items() if spec and spec.origin and spec.origin.startswith(folder)
    ]
    return [*library, *PACKAGES]


def shadow(folder, name):
    (folder / f"{name}.py").write_text("raise RuntimeError(__file__ + ' was imported')")


@pytest.fixture
def folder(tmp_path):
    """A planner of one's own, beside files with the names of the modules that Python and lme import."""
    for name in shadowed():
        shadow(tmp_path, name)
    (tmp_path / "my_module.py").write_text(PLANNER)
    return tmp_path


def plain_environment():
    """What a user's shell has: no path that a test runner set."""
    return {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}


def lme(folder, *words, python=("-P", "-m", "runners.cli.main")):
    command = [sys.executable, *python, *words]
    return subprocess.run(
        command, cwd=folder, env=plain_environment(), capture_output=True, text=True, timeout=300
    )


@pytest.mark.parametrize(
    ("package", "words"),
    [
        ("lme", ["executor.workers=2"]),
        pytest.param("distributed", ["executor=dask", "executor.workers=2"], marks=pytest.mark.slow),
        pytest.param(
            "hydra_plugins.hydra_joblib_launcher",
            ["-m", "seed=0,1", "hydra/launcher=joblib"],
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "hydra_plugins.hydra_submitit_launcher",
            ["-m", "seed=0,1", "hydra/launcher=submitit_local", "executor.workers=2"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_workers_find_the_own_planner_and_no_shadow_of_the_library(folder, package, words):
    pytest.importorskip(package)
    done = lme(folder, *SHORT, "tracking=none", *words)
    assert done.returncode == 0, done.stderr
    assert "was imported" not in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(("package", "words"), [("optuna", TRAIN), ("torch", LEARN)])
def test_a_training_imports_nothing_from_the_working_folder(folder, package, words):
    pytest.importorskip(package)
    done = lme(folder, *words, "executor.workers=2", "tracking=none")
    assert done.returncode == 0, done.stderr
    assert "was imported" not in done.stderr


def test_python_m_searches_the_working_folder_last_as_the_command_does(tmp_path):
    """It finds what Python itself needs for -m there first, but nothing that lme imports."""
    for name in ("ast", "json", "numpy", "random", "signal", "socket", "tempfile", "typing", "yaml"):
        shadow(tmp_path, name)
    done = lme(tmp_path, "eval", "--help", python=("-m", "runners.cli.main"))
    assert (done.returncode, done.stderr) == (0, "")


def test_a_script_may_evaluate_where_such_files_are(folder, tmp_path_factory):
    """It starts workers with `python -c`, in the working folder, and its environment stays as it was."""
    script = tmp_path_factory.mktemp("elsewhere") / "script.py"
    script.write_text(
        "import os, lme\n"
        "frame = lme.evaluate('map.worlds=[0,3]', runs=1, workers=2, progress=False)\n"
        "print(len(frame), os.environ.get('PYTHONSAFEPATH'))\n"
    )
    done = lme(folder, python=(str(script),))
    assert (done.returncode, done.stdout) == (0, "2 None\n"), done.stderr


@pytest.mark.slow
def test_mlflows_server_imports_nothing_from_the_working_folder(folder):
    assert lme(folder, *SHORT, "executor=serial").returncode == 0
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-P", "-m", "runners.cli.main", "ui", "--port", str(port)]
    server = subprocess.Popen(
        command,
        cwd=folder,
        env=plain_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=hear_signals,
    )
    deadline, status = time.monotonic() + 120, None
    while status is None and server.poll() is None and time.monotonic() < deadline:
        try:
            status = urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5).status
        except (urllib.error.URLError, ConnectionError):
            time.sleep(0.2)
    server.terminate()
    said, _ = server.communicate(timeout=60)
    assert (status, "was imported" in said) == (200, False), said


def test_the_working_folder_is_added_once_and_last(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    search_working_folder_last()
    search_working_folder_last()
    assert sys.path.index(str(tmp_path)) == len(sys.path) - 1
