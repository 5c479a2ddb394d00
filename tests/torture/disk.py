"""A disk that is full at a random moment: `python -m tests.torture disk`. Needs root, to mount small disks."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from tests.torture.runs import KINDS, Kind, finished, resuming, run, told

_MUCH = 256 * 2**20  # [bytes]


def report(names: list[str], times: int, seed: int) -> int:
    """Fill the disk of each kind of run so many times; print what came of it; the exit status."""
    print(
        "| command | disks that filled | large enough | one line, resumed and equal |\n|---|---:|---:|---:|"
    )
    faults = 0
    for name in names:
        kind, rng = KINDS[name], np.random.default_rng([seed, *name.encode()])
        with disk(_MUCH) as folder:
            finished(kind.words, folder)
            wanted, used = told(kind.result(folder)), shutil.disk_usage(folder).used
        ends = []
        for number in range(times):
            ends.append(_filled(kind, int(rng.uniform(4096, used)), wanted))
            print(f"{name} {number + 1}/{times}: {ends[-1]}", file=sys.stderr, flush=True)
        wrong = [end for end in ends if end not in ("full", "enough")]
        faults += len(wrong)
        right = times - len(wrong)
        print(f"| {name} | {times} | {ends.count('enough')} | {right} |", *wrong, sep="\n  ", flush=True)
    return int(faults > 0)


@contextmanager
def disk(size: int) -> Iterator[Path]:
    """A folder on a disk of its own. Raises CalledProcessError where that is not allowed."""
    folder = Path(tempfile.mkdtemp(prefix="torture-"))
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", str(folder)], check=True)
        folder.rmdir()


def _filled(kind: Kind, size: int, wanted: str) -> str:
    """Run on a disk of this size, and again when it is larger; "full", "enough", or what is wrong."""
    with disk(size) as folder:
        try:
            done = run(kind.words, folder)
            if done.returncode and (done.returncode not in (1, 2) or not _is_one_line(done.stderr)):
                return f"{size} bytes: status {done.returncode}: {done.stderr[-1500:]}"
            subprocess.run(["mount", "-o", f"remount,size={_MUCH}", str(folder)], check=True)
            finished(resuming(kind), folder)
            equal = told(kind.result(folder)) == wanted
        except Exception as error:
            return f"{size} bytes: {type(error).__name__}: {error}"
    if not equal:
        return f"{size} bytes: another result"
    return "full" if done.returncode else "enough"


def _is_one_line(said: str) -> bool:
    """Whether one line, the last, names the disk, besides progress and the numbers of a sweep's jobs."""
    lines = [line for line in said.splitlines() if line.startswith("lme ")]
    return (
        "Traceback" not in said
        and len(lines) == 1
        and ("disk full" in lines[0] or "No space left" in lines[0])
    )
