"""A run of few episodes starts no workers."""

from dataclasses import dataclass

import pytest

from runners.cli.main import main
from runners.workers import forkserver
from runners.workers.executor import ProcessExecutor, SerialConfig, SerialExecutor


@dataclass
class StillConfig:
    """No settings."""


class Still:
    """A user's own planner."""

    Config = StillConfig

    def __init__(self, config, robot):
        pass

    def reset(self, rng):
        pass

    def plan(self, observation, guidance):
        return 0.0, 0.0


OWN = f"planner._target_={Still.__module__}.Still"
TWO = ["map.worlds=[0,1]", "runs=1"]


@pytest.mark.parametrize(
    ("words", "starts_early", "in_workers"),
    [
        (TWO, False, False),
        (["map.worlds=[0]", "runs=2"], False, False),
        (["map.worlds=[0,1,2]", "runs=1"], True, True),
        ([*TWO, "executor.workers=2"], False, True),
        ([*TWO, OWN], False, True),  # may end its process
    ],
)
def test_few_episodes_run_in_this_process(monkeypatch, tmp_path, words, starts_early, in_workers):
    monkeypatch.chdir(tmp_path)
    started, driven = [], []

    def drive_here(executor, initialise, payload, items):
        driven.append(executor)
        return SerialExecutor(SerialConfig()).map(initialise, payload, items)

    monkeypatch.setattr(forkserver, "start", lambda: started.append(True))
    monkeypatch.setattr(ProcessExecutor, "map", drive_here)
    quick = ["sim=fast", "map.time_limit=1", "tracking=none"]
    assert main(["eval", *quick, *words]) == 0
    assert (bool(started), bool(driven)) == (starts_early, in_workers)
