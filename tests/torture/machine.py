"""What a machine may do: `python -m tests.torture machine`. The clock is set back, folders cannot be written, two
processes want one directory, SIGTERM comes to all of them.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from tests.torture.disk import disk
from tests.torture.runs import KINDS, PLACE, environment, finished, lme, resuming, run, told

_LONG = ["eval", "runs=20", "tracking=none", "executor.workers=2", f"hydra.run.dir={PLACE}"]


class SkippedError(Exception):
    """The machine has not what it takes."""


def report() -> int:
    """Print what came of each check; the exit status."""
    faults = 0
    for check in (clock, read_only, two_processes, *(_terminated(name) for name in KINDS)):
        try:
            said = check()
        except (AssertionError, OSError, subprocess.SubprocessError) as error:
            said, faults = f"FAULT {error}", faults + 1
        except SkippedError as why:
            said = f"skipped: {why}"
        print(f"{check.__doc__} {said}", flush=True)
    return int(faults > 0)


def clock() -> str:
    """The clock is set back by ten days in the middle of a run, and by a year before it is resumed:"""
    library = next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"), None)
    if library is None:
        raise SkippedError("needs Debian's faketime")
    kind, folder = KINDS["eval"], Path(tempfile.mkdtemp(prefix="torture-"))
    finished(kind.words, folder)
    wanted = told(kind.result(folder))
    shutil.rmtree(folder / PLACE)
    shift = folder / "shift"
    shift.write_text("+0")
    fake = {
        "LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": str(shift), "FAKETIME_NO_CACHE": "1",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
    }  # fmt: skip
    process = subprocess.Popen(
        lme(kind.words), cwd=folder, env=environment(**fake), stderr=subprocess.DEVNULL
    )
    log = folder / PLACE / "parts" / "episodes.jsonl"
    _wait(lambda: _size(log) > 0 or process.poll() is not None)
    shift.write_text("-10d")
    _wait(lambda: _size(log) > 20_000 or process.poll() is not None)
    process.kill()
    process.wait()
    shift.write_text("-365d")
    done = run(resuming(kind), folder, **fake)
    assert done.returncode == 0, done.stderr
    assert told(kind.result(folder)) == wanted, "another result"
    return "the records are those of an undisturbed run."


def read_only() -> str:
    """Home, working directory and outputs cannot be written:"""
    with disk(64 * 2**20) as folder:
        finished([*KINDS["eval"].words, "hydra.run.dir=run"], folder)
        subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
        for words in (
            ["eval", "tracking=none"], ["eval", "-m", "seed=0,1"], ["eval", "resume=run"], ["train", "trials=1"],
            ["learn"], ["figure", "world=0"], ["explain", "run", "0"],
        ):  # fmt: skip
            done = run(words, folder, HOME=str(folder))
            lines = [line for line in done.stderr.splitlines() if line.startswith("lme ")]
            assert done.returncode in (1, 2), f"{words}: status {done.returncode}: {done.stderr[-500:]}"
            assert len(lines) == 1, f"{words}: {done.stderr[-500:]}"
            assert "Traceback" not in done.stderr, f"{words}: {done.stderr[-500:]}"
        done = run(["table", "run"], folder, HOME=str(folder))
        assert "the table above is all" in done.stderr, done.stderr[-500:]
        _run_elsewhere(folder)
    return "every command says so in one line, and lme table prints its table; a run elsewhere is complete at once."


def _run_elsewhere(folder: Path) -> None:
    """A run whose MLflow store cannot be written says so in one line, and does not wait for MLflow."""
    place = Path(tempfile.mkdtemp(prefix="torture-"))
    began = time.monotonic()
    done = run(["eval", "map.worlds=[0]", "runs=1", f"hydra.run.dir={place / 'run'}"], folder)
    assert done.returncode == 0, done.stderr[-500:]
    assert done.stderr.count("outputs/mlflow.db: ") == done.stderr.count("lme: warning") == 1, done.stderr
    assert (place / "run" / "episodes.parquet").is_file()
    assert time.monotonic() - began < 60.0, "it waited for MLflow"


def two_processes() -> str:
    """Two processes want one run directory:"""
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    process = subprocess.Popen(
        lme(_LONG), cwd=folder, env=environment(), start_new_session=True, stderr=subprocess.DEVNULL
    )
    _wait(lambda: (folder / PLACE / "parts" / "episodes.jsonl").exists() or process.poll() is not None)
    try:
        for words in ([*_LONG, "seed=1"], [*_LONG, "resume=true"], ["eval", f"resume={PLACE}"]):
            done = run(words, folder)
            assert done.returncode == 2, done.stderr
            assert f"{PLACE}" in done.stderr, done.stderr
            assert "Traceback" not in done.stderr, done.stderr
        assert process.poll() is None, "the first one has ended"
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return "the second one is refused in one line, whether it resumes or not, and the first one continues."


def _terminated(name: str) -> Callable[[], str]:
    def check() -> str:
        kind, folder = KINDS[name], Path(tempfile.mkdtemp(prefix="torture-"))
        finished(kind.words, folder)
        wanted = told(kind.result(folder))
        shutil.rmtree(folder / PLACE)
        shutil.rmtree(folder / "outputs", ignore_errors=True)
        process = subprocess.Popen(
            lme(kind.words), cwd=folder, env=environment(), start_new_session=True, text=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )  # fmt: skip
        _wait(lambda: any(map(_size, _progress(folder))) or process.poll() is not None)
        os.killpg(process.pid, signal.SIGTERM)
        said = process.communicate(timeout=60)[1]
        assert process.returncode == 143, f"status {process.returncode}: {said[-1000:]}"
        assert "Continue with: lme " in said, said[-1000:]
        assert "Traceback" not in said, said[-1000:]
        _wait(lambda: not _group(process.pid))
        assert not _group(process.pid), "processes are left"
        finished(resuming(kind), folder)
        assert told(kind.result(folder)) == wanted, "another result"
        return "status 143, one line, no process left, and resumed it ends as the undisturbed run."

    check.__doc__ = f"SIGTERM comes to all processes of {name}:"
    return check


def _progress(folder: Path) -> list[Path]:
    """Files that show that a run has begun its work."""
    return [*folder.glob(f"{PLACE}/**/episodes.jsonl"), *folder.glob(f"{PLACE}/study.journal"),
            *folder.glob(f"{PLACE}/data/*.npz")]  # fmt: skip


def _group(number: int) -> list[str]:
    """The processes of a group that still run."""
    done = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True, check=True)
    rows = [line.split() for line in done.stdout.splitlines()]
    return [state for group, state in rows if int(group) == number and not state.startswith("Z")]


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


def _wait(ready: Callable[[], bool]) -> None:
    end = time.monotonic() + 120
    while not ready() and time.monotonic() < end:
        time.sleep(0.02)
