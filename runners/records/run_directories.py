"""Where a run writes, how it is known again, and what `resume=` finds.

Every run directory and every sweep directory holds a `launch.json`: how it was started and what its config
came to. Two runs whose configs differ in nothing that can change a result have the same fingerprint.
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

from lme.errors import InputError
from runners.config import catalogue
from runners.config.flatten import flatten
from runners.config.instantiate import filled
from runners.config.job import Job
from runners.config.schema import RecordedConfig, SystemConfig

LAUNCH = "launch.json"
NO_RESULTS = ("resume", "executor", "tracking", "system", "record", "explain")  # they cannot change a result
ROOT = Path("outputs")
_RESULTS = ("episodes.parquet", "study.journal")
_SHOWN = 3  # differing keys that a message names


@dataclass(slots=True)
class Launch:
    """How a run was started.

    configs: as far as they decide results, one of a run, one per job of a sweep. choices: the option of every
    config group, changes: keys that have other values than their options' files, both in the same order.
    folders: of the user's own configs. job: its number within a sweep.
    """

    command: str
    fingerprint: str
    multirun: bool
    overrides: list[str]
    configs: list[dict[str, Any]]
    choices: list[dict[str, str]] = field(default_factory=list)
    changes: list[dict[str, Any]] = field(default_factory=list)
    config_dir: str | None = None
    config_name: str | None = None
    job: int | None = None

    @property
    def config(self) -> RecordedConfig:
        """The config of the run, or of the first job. Raises InputError where it is not complete."""
        names = [field.name for field in dataclasses.fields(RecordedConfig)]
        values = {name: self.configs[0][name] for name in names if name in self.configs[0]}
        config: RecordedConfig = filled(RecordedConfig, values, LAUNCH)
        return config

    @property
    def folders(self) -> tuple[Path, ...]:
        """The config folders, the shipped one first."""
        return catalogue.shipped(*([Path(self.config_dir)] if self.config_dir else [])).folders

    def write(self, directory: Path) -> None:
        """Write `launch.json`, whole or not at all. Raises InputError where the directory takes no file."""
        text = json.dumps(dataclasses.asdict(self), indent=1, sort_keys=True)
        draft = directory / f"{LAUNCH}.new"
        try:
            draft.write_text(text + "\n", encoding="utf-8")
            draft.replace(directory / LAUNCH)
        except OSError as error:
            raise _unwritable(directory, error) from error


def read_launch(directory: Path) -> Launch | None:
    """The launch of a run directory; None where there is none."""
    try:
        return Launch(**json.loads((directory / LAUNCH).read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        return None


def launch_of(
    command: str,
    jobs: Sequence[Job[SystemConfig]],
    overrides: list[str],
    multirun: bool,
    config_name: str | None,
) -> Launch:
    """The launch of a run, or of a sweep's jobs. overrides: those that decide results."""
    configs = [identity(job.config) for job in jobs]
    own = jobs[0].folders[1:]
    return Launch(
        command=command,
        fingerprint=fingerprint(configs, multirun),
        multirun=multirun,
        overrides=overrides,
        configs=configs,
        choices=[dict(job.choices) for job in jobs],
        changes=[_canonical(dict(job.changes)) for job in jobs],
        config_dir=str(own[0]) if own else None,
        config_name=config_name,
    )


def jobs_of_sweep(sweep_dir: Path) -> list[Path]:
    """The directories of a sweep's jobs in the order of the jobs."""
    places = [path.parent for path in sweep_dir.rglob(LAUNCH)]
    found = [(read_launch(place), place) for place in places]
    jobs = {record.job: path for record, path in found if record is not None and record.job is not None}
    return [jobs[number] for number in sorted(jobs)]


def identity(config: SystemConfig) -> dict[str, Any]:
    """What decides the results of a config, as plain JSON values."""
    return {
        key: _canonical(value) for key, value in dataclasses.asdict(config).items() if key not in NO_RESULTS
    }


def fingerprint(configs: Sequence[Mapping[str, Any]], multirun: bool) -> str:
    """SHA-256 of one identity, or of those of a sweep's jobs in order; its first eight digits name it."""
    value = list(configs) if multirun else configs[0]
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def resumable(launch: Launch, root: Path = ROOT) -> Path:
    """The newest directory with the launch's fingerprint. Raises InputError where there is none."""
    pattern = f"*-{_tail(launch)}*"
    folder = root / launch.command
    for directory in sorted(folder.glob(pattern), reverse=True):
        saved = read_launch(directory)
        if saved is not None and saved.fingerprint == launch.fingerprint:
            return directory
    raise InputError(
        f"resume=true: no run with this config, {folder / pattern} does not exist: "
        "leave resume away to start one, or name the directory with resume=PATH"
    )


def check_same(launch: Launch, directory: Path) -> None:
    """Raise InputError naming the first differing keys, unless `directory` was started with this config."""
    saved = read_launch(directory)
    if saved is None:
        raise InputError(
            f"{directory}: holds no {LAUNCH}, so it is no run to resume; choose another directory"
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
    """The first few changes, and how many more there are."""
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
    """Make the directory of a new run and write its `launch.json`: `given`, or one of its own under `root`.

    Raises InputError where it cannot be written or holds a run already.
    """
    if given is not None and holds_run(given):
        raise InputError(f"{given}: already holds a run: add resume=true or choose another directory")
    directory = _own(launch, root) if given is None else _made(given, exist_ok=True)
    launch.write(directory)
    return directory


def _own(launch: Launch, root: Path) -> Path:
    """A directory that no other run has, not even one that starts in the same second."""
    name = f"{datetime.now():%Y-%m-%d_%H-%M-%S}-{_tail(launch)}"
    for candidate in _numbered(root / launch.command / name):
        with contextlib.suppress(FileExistsError):
            return _made(candidate, exist_ok=False)
    raise AssertionError("an endless sequence ended")


def _tail(launch: Launch) -> str:
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
    """Dotted keys and values that all of these identities have in common."""
    first, *others = (dict(flatten(config)) for config in configs)
    return {key: value for key, value in first.items() if all(other.get(key) == value for other in others)}


def _canonical(value: Any) -> Any:
    """One way to write a value: 4.0 is 4, and infinity is a word."""
    if isinstance(value, dict):
        return {str(key): _canonical(child) for key, child in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(child) for child in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            return str(value)
        return int(value) if value.is_integer() else value
    return value
