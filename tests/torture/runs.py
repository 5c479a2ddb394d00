"""Short runs of the commands that write records, by the real command line, and what must be the same in the end."""

from __future__ import annotations

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from tests.places import ROOT

PLACE = "run"
_TIMINGS = ("wall_s", "decision_us_p50", "decision_us_p99", "hours", "steps_per_s")
_COMMON = ("tracking=none", "executor.workers=2")


class Kind(NamedTuple):
    """A command that can be stopped and resumed. result: of its folder, without timings; equal if all went well."""

    words: tuple[str, ...]
    result: Callable[[Path], Any]


def lme(words: Sequence[str]) -> list[str]:
    """The command line of `lme`."""
    return [sys.executable, "-m", "runners.cli.main", *words]


def environment(**more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(ROOT), **more}


def run(words: Sequence[str], folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    """Run `lme` in a folder to its end. more: environment variables."""
    return subprocess.run(
        lme(words), cwd=folder, env=environment(**more), capture_output=True, text=True, timeout=600
    )


def finished(words: Sequence[str], folder: Path) -> None:
    """Run `lme` in a folder. Raises AssertionError if it fails, or says more than it should."""
    done = run(words, folder)
    if done.returncode or "Traceback" in done.stderr:
        raise AssertionError(f"{' '.join(words)}: status {done.returncode}: {done.stderr[-2000:]}")


def resuming(kind: Kind) -> list[str]:
    return [*kind.words, "resume=true"]


def _records(run_dir: Path) -> dict[str, Any]:
    """Records and trajectories of a run, and its table, whose numbers are none of them timings."""
    import pandas as pd

    frame = pd.read_parquet(run_dir / "episodes.parquet").drop(columns=list(_TIMINGS[:3]))
    steps = pd.read_parquet(run_dir / "trajectories.parquet")
    left = sorted(path.name for path in run_dir.rglob("*") if ".new" in path.name or path.name == "parts")
    table = (run_dir / "table.md").read_text()
    return {
        "episodes": frame.to_json(),
        "steps": steps.to_json(double_precision=15),
        "left": left,
        "table": table,
    }


def _of_eval(folder: Path) -> Any:
    return _records(folder / PLACE)


def _of_sweep(folder: Path) -> Any:
    jobs = [_records(folder / PLACE / str(number)) for number in range(3)]
    return [*jobs, (folder / PLACE / "table.md").read_text()]


def _of_train(folder: Path) -> Any:
    with (folder / PLACE / "trials.csv").open() as file:
        trials = list(csv.DictReader(file))
    weights = yaml.safe_load((folder / PLACE / "weights.yaml").read_text())
    return [trials, weights["parameters"], _records(folder / PLACE / "barn")]


def _of_learn(folder: Path) -> Any:
    weights = (folder / PLACE / "weights.onnx").read_bytes().hex()
    with (folder / PLACE / "curves.csv").open() as file:
        curves = [_untimed(row) for row in csv.DictReader(file)]
    return [weights, curves, _records(folder / PLACE / "barn")]


def _untimed(row: Mapping[str, str]) -> dict[str, str]:
    return {key: value for key, value in row.items() if key not in _TIMINGS}


def told(result: Any) -> str:
    """A result as text, to compare and to show."""
    return json.dumps(result, sort_keys=True)


KINDS = {
    "eval": Kind(("eval", "map.worlds=[0,6]", "runs=3", f"hydra.run.dir={PLACE}", *_COMMON), _of_eval),
    "sweep": Kind(
        ("eval", "-m", "seed=0,1,2", "map.worlds=[0]", "runs=2", f"hydra.sweep.dir={PLACE}", *_COMMON), _of_sweep
    ),
    "train": Kind(
        (
            "train", "trials=4", "search=random", "configurations=2", "training_numbers=[1,20]", "map=barn", "runs=2",
            "race.candidates=[2]", "race.worlds=[2]", "held_out={}", "map.worlds=[0,6]",
            f"hydra.run.dir={PLACE}", *_COMMON,
        ),
        _of_train,
    ),
    "learn": Kind(
        (
            "learn", "validation=2", "runs=1", "map.worlds=[0,6]", "learner.rounds=2", "learner.episodes=4",
            "learner.updates=[3,5]", "learner.time_limit=3", "map.time_limit=6", "training.fresh.time_limit=6",
            "training.fresh_hard.time_limit=6", f"hydra.run.dir={PLACE}", *_COMMON,
        ),
        _of_learn,
    ),
}  # fmt: skip
