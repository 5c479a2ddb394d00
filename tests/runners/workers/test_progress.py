"""What a bar shows: what it waits for, the rungs of a race, and on a terminal no control code as text."""

import os
import pty
import subprocess
import sys

import pytest

from lme import numba_cache
from runners.workers.progress import EpisodeProgress, RaceProgress, TrialProgress
from tests.places import ROOT

SHOWING = """
import time
from runners.cli.guards import plain_output, starting
from runners.workers.progress import EpisodeProgress, activity
with plain_output():
    with starting("eval"):
        pass
    with activity("Reading"):
        time.sleep(0.3)
    with EpisodeProgress("LME", 2) as bar:
        time.sleep(0.3)
        print("a line beside the bar")
        bar.add("success")
        time.sleep(0.3)
"""


@pytest.mark.parametrize("bar", [EpisodeProgress, TrialProgress])
@pytest.mark.parametrize("compiled", [False, True])
def test_a_bar_says_what_it_waits_for(bar, compiled, monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: compiled)
    with bar("LME", 3):
        pass
    assert ("Compiling kernels" in capsys.readouterr().err) == (not compiled)


def test_every_rung_of_a_race_is_announced_and_keeps_its_bar(monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: True)
    with RaceProgress() as bar:
        for episodes, candidates in ((2, 1), (3, 40)):
            bar.begin(episodes, candidates)
            for _ in range(episodes):
                bar.add()
            assert f"{episodes} episodes" in capsys.readouterr().err
    shown = capsys.readouterr().err
    assert all(line in shown for line in ("2/2 1 candidate ", "3/3 40 candidates"))


def test_trials_count_their_episodes_until_the_batch_is_done(monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: True)
    with TrialProgress("train", 12) as bar:
        bar.add_episode()
        bar.add_episode()
    assert "2 episodes" in capsys.readouterr().err


def test_a_log_has_a_line_a_minute(monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: True)
    clock = iter([0.0, 30.0, 61.0, 61.0, 90.0])
    monkeypatch.setattr("runners.workers.progress.monotonic", lambda: next(clock))
    with EpisodeProgress("LME", 9) as bar:
        lines = []
        for _ in range(3):
            bar.add("success")
            lines.append(capsys.readouterr().err.splitlines())
    assert [len(line) for line in lines] == [0, 1, 0]
    assert "2/9 2 success" in lines[1][0]


def test_a_bar_says_that_its_workers_start_unless_nothing_is_left(monkeypatch, capsys):
    monkeypatch.setattr(numba_cache, "compiled", lambda: True)
    for done, is_said in ((0, True), (3, False)):
        with EpisodeProgress("LME", 3) as bar:
            bar.skip(done)
        assert ("workers start" in capsys.readouterr().err) == is_said


def test_a_terminal_is_sent_control_codes_and_not_their_names():
    leader, follower = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "100", "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-c", SHOWING], env=environment, stdout=follower, stderr=follower, cwd=ROOT
    )
    os.close(follower)
    shown = b""
    try:
        while block := os.read(leader, 65536):
            shown += block
    except OSError:  # the process has closed the terminal
        pass
    os.close(leader)
    assert process.wait() == 0
    for text in (b"lme eval starts", b"\r\x1b[K", b"Reading", b"a line beside the bar", b"1 success"):
        assert text in shown
    assert b"\\x1b" not in shown
