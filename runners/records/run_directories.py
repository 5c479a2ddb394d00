"""The directories of runs: where a run writes, and which directory `resume=` continues.

Every run directory and every sweep directory holds a `launch.json`: how the run was started, and its composed config.
Two runs have the same fingerprint if their configs differ only in keys that cannot change a result.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from lme.errors import InputError
from runners.config.composer import without_hydra
from runners.config.flatten import flatten
from runners.config.hydra_errors import translated
from runners.records.whole_file import write_whole

LAUNCH = "launch.json"
NO_RESULTS = (
    "resume",
    "executor",
    "tracking",
    "system",
    "record",
    "explain",
)  # keys that cannot change a result
ROOT = Path("outputs")
_RESULTS = ("episodes.parquet", "study.journal")
_SHOWN = 3  # differing keys that a message names at most


@dataclass(slots=True)
class Launch:
    """How a run was started.

    configs: the part of the config that decides results; one for a run, one per job for a sweep.
    """

    command: str
    fingerprint: str
    multirun: bool
    overrides: list[str]
    configs: list[dict[str, Any]]
    config_dir: str | None = None
    config_name: str | None = None
    job: int | None = field(default=None)  # number within a sweep

    def write(self, directory: Path) -> None:
        """Write `launch.json` whole. Raises InputError where the directory cannot be written."""
        text = json.dumps(dataclasses.asdict(self), indent=1, sort_keys=True)
        try:
            write_whole(directory / LAUNCH, text + "\n")
        except OSError as error:
            raise _unwritable(directory, error) from error


def read_launch(directory: Path) -> Launch | None:
    """The launch of a run directory; None where it holds no readable one."""
    try:
        return Launch(**json.loads((directory / LAUNCH).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def identity(config: DictConfig) -> dict[str, Any]:
    """The part of a composed config that decides results, resolved, as plain JSON values."""
    try:
        plain = OmegaConf.to_container(
            without_hydra(config), resolve=True, throw_on_missing=True, enum_to_str=True
        )
    except OmegaConfBaseException as error:
        raise translated(error, OmegaConf.get_type(config)) from error
    assert isinstance(plain, dict)
    return {str(key): _canonical(value) for key, value in plain.items() if key not in NO_RESULTS}


def fingerprint(configs: Sequence[Mapping[str, Any]], multirun: bool) -> str:
    """SHA-256 of the identity of a run, or of the identities of a sweep's jobs in order."""
    value = list(configs) if multirun else configs[0]
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def resumable(launch: Launch, root: Path = ROOT) -> Path:
    """The newest directory with the launch's fingerprint. Raises InputError where there is none."""
    pattern = f"*-{_fingerprint_suffix(launch)}*"
    folder = root / launch.command
    for directory in sorted(folder.glob(pattern), reverse=True):
        saved = read_launch(directory)
        if saved is not None and saved.fingerprint == launch.fingerprint:
            return directory
    raise InputError(
        f"resume=true: no run with this config, {folder / pattern} does not exist: "
        "omit resume to start one, or name the directory with resume=PATH"
    )


def check_same(launch: Launch, directory: Path) -> None:
    """Raise InputError, naming the first keys that differ, unless `directory` was started with this config."""
    saved = read_launch(directory)
    if saved is None:
        raise InputError(
            f"{directory}: holds no {LAUNCH}, so there is no run to resume; choose another directory"
        )
    if saved.fingerprint == launch.fingerprint:
        return
    if (saved.command, len(saved.configs)) != (launch.command, len(launch.configs)):
        raise InputError(
            f"{directory}: holds {saved.command} with {len(saved.configs)} jobs, "
            f"not {launch.command} with {len(launch.configs)}: cannot be resumed as that"
        )
    pairs = zip(saved.configs, launch.configs, strict=True)
    found = list(dict.fromkeys(change for old, new in pairs for change in changes(old, new)))
    raise InputError(
        f"{directory}: holds a run with another config ({shortened(found)}): "
        "resume it with resume=PATH alone, or choose another directory"
    )


def shortened(found: Sequence[str]) -> str:
    """The first changes, and the number of the others."""
    more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
    return f"{'; '.join(found[:_SHOWN])}{more}"


def holds_run(directory: Path) -> bool:
    """Whether the directory, or one right below it, holds records or a study."""
    for place in ("", "*/"):
        if any(True for name in _RESULTS for _ in directory.glob(f"{place}{name}")):
            return True
        if any(part.stat().st_size for part in directory.glob(f"{place}parts/*") if part.is_file()):
            return True
    return False


def make_fresh(launch: Launch, given: Path | None, root: Path = ROOT) -> Path:
    """Make the directory of a new run and write its `launch.json`. Returns `given`, or a new one under `root`.

    Raises InputError where it cannot be written or holds a run already.
    """
    if given is not None and holds_run(given):
        raise InputError(f"{given}: already holds a run: add resume=true or choose another directory")
    directory = _new_directory(launch, root) if given is None else _made(given, exist_ok=True)
    launch.write(directory)
    return directory


def _new_directory(launch: Launch, root: Path) -> Path:
    """A new directory, named by date, time and fingerprint. A number follows if another run has that name."""
    name = f"{datetime.now():%Y-%m-%d_%H-%M-%S}-{_fingerprint_suffix(launch)}"
    for candidate in _numbered(root / launch.command / name):
        with contextlib.suppress(FileExistsError):
            return _made(candidate, exist_ok=False)
    raise AssertionError("an endless sequence ended")


def _fingerprint_suffix(launch: Launch) -> str:
    return f"{'sweep-' if launch.multirun else ''}{launch.fingerprint[:8]}"


def _numbered(path: Path) -> Iterator[Path]:
    yield path
    yield from (path.with_name(f"{path.name}-{number}") for number in count(2))


def _made(directory: Path, exist_ok: bool) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=exist_ok)
    except FileExistsError as error:
        if not exist_ok and directory.is_dir():
            raise
        raise _unwritable(directory, error) from error
    except OSError as error:
        raise _unwritable(directory, error) from error
    return directory


def _unwritable(directory: Path, error: OSError) -> InputError:
    return InputError(
        f"output directory {directory}: cannot be written ({error.strerror}): "
        "choose another with hydra.run.dir=PATH"
    )


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """ "key: old there, new now" for every key in which two identities differ."""
    before, after = dict(flatten(old)), dict(flatten(new))
    for key in sorted(before.keys() | after.keys()):
        if before.get(key) != after.get(key):
            yield f"{key}: {before.get(key, 'absent')} there, {after.get(key, 'absent')} now"


def common(configs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Dotted keys and values that all identities have in common."""
    first, *others = (dict(flatten(config)) for config in configs)
    return {key: value for key, value in first.items() if all(other.get(key) == value for other in others)}


def _canonical(value: Any) -> Any:
    """Equal values in the same form, fit for JSON: 4.0 becomes 4, and infinity becomes text."""
    if isinstance(value, dict):
        return {str(key): _canonical(child) for key, child in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(child) for child in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            return str(value)
        return int(value) if value.is_integer() else value
    return value
