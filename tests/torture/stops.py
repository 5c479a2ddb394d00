"""Commands that are stopped at random moments and resumed, which must end as undisturbed ones.

`python -m tests.torture kills`: SIGKILL to all processes. `terms`: SIGTERM to all, as Slurm sends it. `disk`: the disk
is full; needs root, to mount small disks. `clock`: it is set back; needs Debian's faketime.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import yaml

from tests.places import ROOT

_PLACE = "run"
_LOG = Path(_PLACE, "parts", "episodes.jsonl")
_TIMINGS = ("wall_s", "decision_us_p50", "decision_us_p99", "hours", "steps_per_s")
_COMMON = ("tracking=none", "executor.workers=2")
_LARGE = 256 * 2**20  # [bytes] of a disk


class Kind(NamedTuple):
    """A command that can be stopped and resumed. result: of its folder, without timings; equal if all went well."""

    words: tuple[str, ...]
    result: Callable[[Path], Any]


def _records(run_dir: Path) -> dict[str, Any]:
    """Records and trajectories of a run, what is left of its writing, and its table, which shows no timings."""
    frame = pd.read_parquet(run_dir / "episodes.parquet").drop(columns=list(_TIMINGS[:3]))
    return {
        "episodes": frame.to_json(),
        "steps": pd.read_parquet(run_dir / "trajectories.parquet").to_json(double_precision=15),
        "left": sorted(
            path.name for path in run_dir.rglob("*") if ".new" in path.name or path.name == "parts"
        ),
        "table": (run_dir / "table.md").read_text(),
    }


def _of_eval(folder: Path) -> Any:
    return _records(folder / _PLACE)


def _of_sweep(folder: Path) -> Any:
    jobs = [_records(folder / _PLACE / str(number)) for number in range(3)]
    return [*jobs, (folder / _PLACE / "table.md").read_text()]


def _of_train(folder: Path) -> Any:
    weights = yaml.safe_load((folder / _PLACE / "weights.yaml").read_text())
    return [_rows(folder / _PLACE / "trials.csv"), weights["parameters"], _records(folder / _PLACE / "barn")]


def _of_learn(folder: Path) -> Any:
    with np.load(folder / _PLACE / "weights.npz") as file:
        weights = {name: file[name].tobytes().hex() for name in file.files}
    return [weights, _rows(folder / _PLACE / "curves.csv"), _records(folder / _PLACE / "barn")]


def _rows(path: Path) -> list[Mapping[str, str]]:
    with path.open() as file:
        return [{key: row[key] for key in row if key not in _TIMINGS} for row in csv.DictReader(file)]


KINDS = {
    "eval": Kind(("eval", "map.worlds=[0,6]", "runs=3", f"hydra.run.dir={_PLACE}", *_COMMON), _of_eval),
    "sweep": Kind(
        ("eval", "-m", "seed=0,1,2", "map.worlds=[0]", "runs=2", f"hydra.sweep.dir={_PLACE}", *_COMMON), _of_sweep
    ),
    "train": Kind(
        (
            "train", "trials=4", "search=random", "configurations=2", "training_numbers=[1,20]", "map=barn", "runs=2",
            "race.candidates=[2]", "race.worlds=[2]", "held_out={}", "map.worlds=[0,6]",
            f"hydra.run.dir={_PLACE}", *_COMMON,
        ),
        _of_train,
    ),
    "learn": Kind(
        (
            "learn", "validation=2", "runs=1", "map.worlds=[0,6]", "learner.rounds=2", "learner.episodes=4",
            "learner.updates=[3,5]", "learner.time_limit=3", "map.time_limit=6", "training.fresh.time_limit=6",
            "training.fresh_hard.time_limit=6", f"hydra.run.dir={_PLACE}", *_COMMON,
        ),
        _of_learn,
    ),
}  # fmt: skip


def report(how: str, names: Sequence[str], times: int, seed: int) -> int:
    """Stop each kind of run so many times; print what came of it; the exit status."""
    print("| command | stopped | of them after the end | resumed and equal |\n|---|---:|---:|---:|")
    faults = 0
    for name in names:
        kind, rng = KINDS[name], np.random.default_rng([seed, *name.encode()])
        wanted, seconds, used = _undisturbed(kind)
        ends = []
        for number in range(times):
            try:
                ends.append(STOPS[how](kind, rng, seconds, used, wanted))
            except (AssertionError, OSError, subprocess.SubprocessError) as error:
                ends.append(f"{type(error).__name__}: {error}")
            print(f"{name} {number + 1}/{times}: {ends[-1]}", file=sys.stderr, flush=True)
        wrong = [end for end in ends if end not in ("stopped", "ended")]
        faults += len(wrong)
        row = f"| {name} | {times} | {ends.count('ended')} | {times - len(wrong)} |"
        print(row, *wrong, sep="\n  ", flush=True)
    return int(faults > 0)


def _undisturbed(kind: Kind) -> tuple[str, float, int]:
    """The result of a run that is not stopped, its time [s] with compiled kernels, and its size [bytes]."""
    for _ in range(2):
        with tempfile.TemporaryDirectory(prefix="torture-") as name:
            began = time.perf_counter()
            _finished(kind.words, Path(name))
            seconds = time.perf_counter() - began
            used = sum(path.stat().st_size for path in Path(name).rglob("*") if path.is_file())
            wanted = _told(kind, Path(name))
    return wanted, seconds, used


def _killed(kind: Kind, rng: np.random.Generator, seconds: float, used: int, wanted: str) -> str:
    folder, process = _started(kind)
    time.sleep(rng.uniform(0.0, seconds))
    had_ended = process.poll() is not None
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    _check_resumed(kind, folder, wanted)
    return "ended" if had_ended else "stopped"


def _terminated(kind: Kind, rng: np.random.Generator, seconds: float, used: int, wanted: str) -> str:
    """Stop a run that has begun its work: status 143, one line that continues it, and no process left."""
    folder, process = _started(kind)
    progress = (f"{_PLACE}/**/episodes.jsonl", f"{_PLACE}/study.journal", f"{_PLACE}/data/*.npz")
    _wait(lambda: process.poll() is not None or any(_size(p) for glob in progress for p in folder.glob(glob)))
    had_ended = process.poll() is not None
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    said = process.communicate(timeout=60)[1]
    assert had_ended or process.returncode == 143, f"status {process.returncode}: {said[-1000:]}"
    assert had_ended or "Continue with: lme " in said, said[-1000:]
    assert "Traceback" not in said, said[-1000:]
    _wait(lambda: not _in_group(process.pid))
    assert not _in_group(process.pid), "processes are left"
    _check_resumed(kind, folder, wanted)
    return "ended" if had_ended else "stopped"


def _filled(kind: Kind, rng: np.random.Generator, seconds: float, used: int, wanted: str) -> str:
    """Run on a disk that is too small, which one line must say, and again when it is larger."""
    with _disk(int(rng.uniform(4096, used))) as folder:
        done = _run(kind.words, folder)
        lines = [line for line in done.stderr.splitlines() if line.startswith("lme ")]
        is_said = len(lines) == 1 and ("disk full" in lines[0] or "No space left" in lines[0])
        assert done.returncode == 0 or (is_said and "Traceback" not in done.stderr), done.stderr[-1500:]
        subprocess.run(["mount", "-o", f"remount,size={_LARGE}", str(folder)], check=True)
        _check_resumed(kind, folder, wanted)
    return "stopped" if done.returncode else "ended"


STOPS = {"kills": _killed, "terms": _terminated, "disk": _filled}


def clock() -> int:
    """The clock is set back by ten days in the middle of a run, and by a year before it is resumed."""
    library = next(Path("/usr/lib").glob("*/faketime/libfaketimeMT.so.1"), None)
    if library is None:
        print("skipped: needs Debian's faketime")
        return 1
    kind = KINDS["eval"]
    wanted, *_ = _undisturbed(kind)
    with tempfile.TemporaryDirectory(prefix="torture-") as name:
        shift = Path(name, "shift")
        fake = {
            "LD_PRELOAD": str(library), "FAKETIME_TIMESTAMP_FILE": str(shift), "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        }  # fmt: skip
        shift.write_text("+0")
        folder, process = _started(kind, **fake)
        _wait(lambda: _size(folder / _LOG) > 0 or process.poll() is not None)
        shift.write_text("-10d")
        _wait(lambda: _size(folder / _LOG) > 20_000 or process.poll() is not None)
        process.kill()
        process.communicate()
        shift.write_text("-365d")
        _check_resumed(kind, folder, wanted, **fake)
    print("The records are those of an undisturbed run.")
    return 0


def _started(kind: Kind, **more: str) -> tuple[Path, subprocess.Popen[str]]:
    """A run that has begun in a folder of its own, in a group of processes of its own."""
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    process = subprocess.Popen(
        _lme(kind.words), cwd=folder, env=_environment(**more), start_new_session=True, text=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    return folder, process


def _check_resumed(kind: Kind, folder: Path, wanted: str, **more: str) -> None:
    """Resume a run. Raises AssertionError, and leaves the folder, unless it ends as an undisturbed one."""
    _finished([*kind.words, "resume=true"], folder, **more)
    assert _told(kind, folder) == wanted, f"another result, in {folder}"
    if not os.path.ismount(folder):
        shutil.rmtree(folder)


def _finished(words: Sequence[str], folder: Path, **more: str) -> None:
    """Run `lme` in a folder. Raises AssertionError if it fails, or says more than it should."""
    done = _run(words, folder, **more)
    if done.returncode or "Traceback" in done.stderr:
        raise AssertionError(
            f"{' '.join(words)}, in {folder}: status {done.returncode}: {done.stderr[-2000:]}"
        )


def _run(words: Sequence[str], folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        _lme(words), cwd=folder, env=_environment(**more), capture_output=True, text=True, timeout=600
    )


def _lme(words: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "runners.cli.main", *words]


def _environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **more}


def _told(kind: Kind, folder: Path) -> str:
    """The result as text, to compare and to show."""
    return json.dumps(kind.result(folder), sort_keys=True)


@contextmanager
def _disk(size: int) -> Iterator[Path]:
    """A folder on a disk of its own. Raises CalledProcessError where that is not allowed."""
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)
        folder.rmdir()


def _in_group(number: int) -> list[str]:
    """The processes of a group that still run."""
    done = subprocess.run(["ps", "-eo", "pgid=,stat="], capture_output=True, text=True, check=True)
    rows = [line.split() for line in done.stdout.splitlines()]
    return [state for group, state in rows if int(group) == number and not state.startswith("Z")]


def _size(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _wait(ready: Callable[[], bool]) -> None:
    end = time.monotonic() + 120
    while not ready() and time.monotonic() < end:
        time.sleep(0.02)
