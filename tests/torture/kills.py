"""SIGKILL at random moments: `python -m tests.torture kills`. The resumed run ends as the undisturbed one."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tests.torture.runs import KINDS, Kind, environment, finished, lme, resuming, told


def report(names: list[str], times: int, seed: int) -> int:
    """Kill each kind of run so many times; print what came of it; the exit status."""
    print(
        "| command | killed | ended before | resumed and equal | undisturbed [s] |\n|---|---:|---:|---:|---:|"
    )
    faults = 0
    for name in names:
        kind, rng = KINDS[name], np.random.default_rng([seed, *name.encode()])
        with tempfile.TemporaryDirectory(prefix="torture-") as folder:
            began = time.perf_counter()
            finished(kind.words, Path(folder))  # compiles what is not compiled yet
            began = time.perf_counter()
            wanted = _undisturbed(kind)
            seconds = time.perf_counter() - began
        ends = []
        for number in range(times):
            ends.append(_killed(kind, rng.uniform(0.0, seconds), wanted))
            print(f"{name} {number + 1}/{times}: {ends[-1]}", file=sys.stderr, flush=True)
        wrong = [end for end in ends if end not in ("killed", "ended")]
        faults += len(wrong)
        print(
            f"| {name} | {times} | {ends.count('ended')} | {times - len(wrong)} | {seconds:.1f} |", *wrong,
            sep="\n  ", flush=True,
        )  # fmt: skip
    return int(faults > 0)


def _undisturbed(kind: Kind) -> str:
    with tempfile.TemporaryDirectory(prefix="torture-") as folder:
        finished(kind.words, Path(folder))
        return told(kind.result(Path(folder)))


def _killed(kind: Kind, after_s: float, wanted: str) -> str:
    """Kill a run and all its processes after so long, and resume it; "killed", "ended", or what is wrong."""
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    process = subprocess.Popen(
        lme(kind.words), cwd=folder, env=environment(), start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    time.sleep(after_s)
    had_ended = process.poll() is not None
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        had_ended = True
    process.wait()
    try:
        finished(resuming(kind), folder)
        found = told(kind.result(folder))
    except Exception as error:
        return f"after {after_s:.3f} s, in {folder}: {type(error).__name__}: {error}"
    if found != wanted:
        (folder / "wanted").write_text(wanted)
        (folder / "found").write_text(found)
        return f"after {after_s:.3f} s, in {folder}: another result"
    shutil.rmtree(folder)
    return "ended" if had_ended else "killed"
