"""Damaged inputs for every reader, in processes of their own: `python -m tests.torture readers`."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from tests.places import ROOT
from tests.torture.child import BETWEEN, NOW
from tests.torture.guard import MEMORY_MB, SLOWEST_S
from tests.torture.readers import READERS, Reader

BYTES = "bytes"
MUTATORS = {BYTES: "bytes, words and values", "structure": "what a file is, its encoding and its parts"}

_DEATHS = 5  # of a reader's process, after which its other inputs are left out


class Tried(NamedTuple):
    """What came of a reader's inputs. faults: why inputs were not survived, each with the folder of one."""

    reader: str
    inputs: int
    read: int
    refused: int
    faults: dict[str, str]
    slowest_s: float
    peak_mb: float

    def __str__(self) -> str:
        return (
            f"| {self.reader} | {self.inputs} | {self.read} | {self.refused} | {self.slowest_s:.1f} | "
            f"{self.peak_mb:.0f} | {len(self.faults)} |"
        )


HEAD = "| reader | inputs | read | refused | slowest [s] | peak [MB] | faults |\n|---|---:|---:|---:|---:|---:|---:|"


def readers(
    inputs: int, seed: int, only: str = "", mutator: str = BYTES, at_once: int = 2
) -> Iterator[Tried]:
    """Give `inputs` in total to all readers whose names hold `only`, by their shares; yield what came of them.

    A reader that needs a module which is not installed is left out.
    """
    chosen = [reader for reader in READERS if only in reader.name and not missing(reader)]
    total = sum(reader.share for reader in chosen)
    with ThreadPoolExecutor(at_once) as pool:
        yield from pool.map(
            lambda reader: tried([reader], max(round(inputs * reader.share / total), 1), seed, mutator),
            chosen,
        )


def missing(reader: Reader) -> bool:
    """Whether the reader needs a module that is not installed."""
    return reader.needs is not None and find_spec(reader.needs) is None


def tried(chosen: Sequence[Reader], count: int, seed: int, mutator: str = BYTES) -> Tried:
    """What came of `count` inputs for each reader, in one process. If it dies, another one takes the rest."""
    names = BETWEEN.join(reader.name for reader in chosen)
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    ends: Counter[str] = Counter()
    faults: dict[str, str] = {}
    slowest, peak, first = 0.0, 0.0, 0
    for _ in range(_DEATHS):
        death = _death([str(folder), names, mutator, str(first), str(count), str(seed)])
        if not (folder / NOW).is_file():
            raise RuntimeError(f"{names}: a good input was not read:\n{death}")
        found = json.loads((folder / NOW).read_text())
        ends.update(found["ends"])
        faults |= found["faults"]
        slowest, peak = max(slowest, found["slowest_s"]), max(peak, found["peak_mb"])
        first = found["number"]
        if death:
            faults[death] = str(folder / "faults" / str(first))
            first += 1
        (folder / NOW).unlink()
        if first >= count * len(chosen):
            break
    if not faults:
        shutil.rmtree(folder)
    return Tried(names, first, ends["read"], ends["refused"], faults, slowest, peak)


def _death(words: Sequence[str]) -> str:
    """How the process with these inputs died; empty if it did not."""
    command = [sys.executable, "-X", "faulthandler", "-m", "tests.torture.child", *words]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace")
    said = done.stderr.split()
    said = said if len(said) < 200 else [*said[:60], "…", *said[-100:]]
    return "" if done.returncode == 0 else f"died with status {done.returncode}: {' '.join(said)}"


def report(inputs: int, seed: int, only: str, mutator: str) -> int:
    """Print a table of all readers, and the faults; the exit status."""
    for reader in READERS:
        if only in reader.name and missing(reader):
            print(f"skipped: {reader.name}, which need {reader.needs}")
    print(f"Limits: {SLOWEST_S:g} s and {MEMORY_MB} MB an input; mutator {mutator}, seed {seed}\n{HEAD}")
    found = []
    for one in readers(inputs, seed, only, mutator):
        print(one, flush=True)
        found.append(one)
        for fault, place in one.faults.items():
            print(f"  {place}: {fault}", flush=True)
    print(
        f"{sum(one.inputs for one in found)} inputs, {sum(len(one.faults) for one in found)} kinds of faults"
    )
    return int(any(one.faults for one in found))
