"""The process that reads damaged inputs: `python -m tests.torture.child FOLDER READER|READER MUTATOR FIRST COUNT SEED`.

The file `now` in its folder tells at which input it is, and what came of those before.
"""

from __future__ import annotations

import gc
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from lme.errors import InputError
from tests.torture import structure
from tests.torture.guard import Guard, Hang, peak_mb
from tests.torture.readers import READERS, Reader

NOW, BETWEEN = "now", "|"


def main(words: list[str]) -> None:
    folder, names, mutator = Path(words[0]).resolve(), words[1].split(BETWEEN), words[2]
    first, count, seed = map(int, words[3:])
    folder.mkdir(parents=True, exist_ok=True)
    os.environ["HOME"] = tempfile.tempdir = str(folder)  # torch makes a temporary folder when it is imported
    os.chdir(folder)
    warnings.simplefilter("ignore")
    readers = [next(reader for reader in READERS if reader.name == name) for name in names]
    for reader in readers:
        good = folder / reader.name
        shutil.rmtree(good, ignore_errors=True)
        good.mkdir()
        reader.write(good)
        _copy(good, folder / "case")
        reader.read(folder / "case")  # compiles and imports what it needs
    guard = Guard(folder)
    guard.limit_memory()
    _many(readers, folder, guard, range(first, len(readers) * count), count, seed, mutator)


def _many(
    readers: list[Reader], folder: Path, guard: Guard, numbers: range, count: int, seed: int, mutator: str
) -> None:
    """Read the inputs of these numbers; every reader has `count` of them, one reader after the other."""
    ends: Counter[str] = Counter()
    faults: dict[str, str] = {}
    slowest = 0.0
    for number in numbers:
        reader = readers[number // count]
        _note(folder, number, ends, faults, slowest)
        _copy(folder / reader.name, folder / "case")
        key = int.from_bytes(hashlib.sha256(reader.name.encode()).digest()[:4], "little")
        spoil = structure.spoil if mutator == "structure" and reader.of_files else reader.spoil
        spoil(np.random.default_rng([seed, key, number % count]), folder / "case")
        kept = folder / "faults" / str(number)
        kept.parent.mkdir(exist_ok=True)
        subprocess.run(["cp", "-a", folder / "case", kept], check=True)  # pipes and holes as they are
        began = time.process_time()
        fault = _one(reader, folder / "case", guard, ends)
        slowest = max(slowest, time.process_time() - began)
        kind = fault.partition(": ")[0]
        if fault and not any(known.startswith(kind) for known in faults):
            faults[fault] = str(kept)
        else:
            shutil.rmtree(kept)
    _note(folder, numbers.stop, ends, faults, slowest)


def _note(folder: Path, number: int, ends: Counter[str], faults: dict[str, str], slowest: float) -> None:
    found = {"number": number, "ends": ends, "faults": faults, "slowest_s": slowest, "peak_mb": peak_mb()}
    (folder / NOW).write_text(json.dumps(found))


def _one(reader: Reader, case: Path, guard: Guard, ends: Counter[str]) -> str:
    """Why this input was not survived; empty if it was."""
    guard.trespasses.clear()
    try:
        with guard.watched():
            reader.read(case)
        ends["read"] += 1
    except InputError as error:
        if "\n" in str(error) or not str(error):
            return f"a message of other than one line: {error!r:.300}"
        ends["refused"] += 1
    except (Exception, Hang) as error:
        if isinstance(error, MemoryError):
            gc.collect()
        return _where(error)
    return "; ".join(guard.trespasses)


def _where(error: BaseException) -> str:
    """Type and message of an error, and the last line of this project that it came through."""
    own = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if "/lme/" in frame.filename or "/runners/" in frame.filename
    ]
    place = f"{'/'.join(Path(own[-1].filename).parts[-3:])}:{own[-1].lineno}" if own else "outside"
    return f"{type(error).__name__} at {place}: {' '.join(str(error).split())[:160]}"


def _copy(source: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target)


if __name__ == "__main__":
    main(sys.argv[1:])
