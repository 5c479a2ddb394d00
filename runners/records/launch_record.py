"""Launch record `launch.json`, which every directory of a run or of a sweep holds; and the versions that it depends on.

Two runs have the same fingerprint if their configs differ only in keys that cannot change a result.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import os
import platform
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cache, lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, NamedTuple

import lme
from lme.errors import InputError
from lme.inputs.guarded_file import decode_json, read_bytes
from lme.perception.people.source import People
from runners.config import catalogue
from runners.config.changes import flatten
from runners.config.escaping import masked_text, masked_values
from runners.config.instantiate import fill_dataclass
from runners.config.job import Job
from runners.config.quoting import key_of, lme_command
from runners.config.schema import RecordedConfig, SystemConfig
from runners.records import input_search, inputs, trust
from runners.records.atomic_write import write_atomically
from runners.records.inputs import Input

LAUNCH = "launch.json"
# Keys that cannot change a result.
NO_RESULTS = ("resume", "executor", "tracking", "system", "record", "explain", "picture")
# Values of keys that older runs lack; they are left out, so that these runs can be resumed.
DEFAULTS: dict[str, Any] = {"people": People.truth, "crowd": {}, "filter": {}}
_SHOWN = 3  # number of differing keys that a message names at most
_ROOT = Path(__file__).resolve().parents[2]
_DIGITS = 8  # digits of a commit, as text


@dataclass(slots=True)
class Launch:
    """Record of how a run was started.

    configs: the part of the config that decides results; one for a run, one per job for a sweep. choices: the option
    of every config group. changes: keys whose values differ from those in their options' files. Both are in the order
    of configs. weights: the set that each job drives with, which may be its guide's own. config_dir: folder of the
    user's own options. job: number within a sweep. num_jobs: size of the whole sweep. num_worlds: number of worlds
    that a run of `lme eval` was to drive; None for a sweep. inputs: the user's own files that were read. started:
    date and time. code: the version that drove it, as text. seal: signature by which a user's own runs are known.
    directory: where the record was found; it is not recorded.
    """

    command: str
    fingerprint: str
    multirun: bool
    overrides: list[str]
    configs: list[dict[str, Any]]
    choices: list[dict[str, str]] = field(default_factory=list)
    changes: list[dict[str, Any]] = field(default_factory=list)
    weights: list[str] = field(default_factory=list)
    config_dir: str | None = None
    config_name: str | None = None
    job: int | None = None
    num_jobs: int | None = None
    num_worlds: int | None = None
    inputs: list[Input] = field(default_factory=list)
    started: str = ""
    code: str = ""
    seal: str = field(default="", compare=False)
    directory: Path | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        self.choices = self.choices or [{} for _ in self.configs]
        self.changes = self.changes or [{} for _ in self.configs]

    @property
    def config(self) -> RecordedConfig:
        """Config of the run, or of the first job. Raises as `recorded_config` does."""
        return recorded_config(self.configs[0], self.directory, self.inputs)

    @property
    def worlds_config(self) -> RecordedConfig:
        """Config without the system, which is enough to draw the worlds. Raises as `config` does."""
        nothing: dict[str, Any] = {"guide": {}, "planner": {}, "filter": {}}
        return recorded_config({**self.configs[0], **nothing}, self.directory, self.inputs)

    @property
    def folders(self) -> tuple[Path, ...]:
        """Config folders, the shipped one first; the user's own one is the copy in the run, if there is one."""
        config_folder = None if self.directory is None else inputs.options_folder(self.inputs, self.directory)
        if (
            config_folder is None
            and self.config_dir
            and (self.directory is None or trust.is_trusted(self.directory))
        ):
            config_folder = Path(self.config_dir)
        return catalogue.shipped(*([config_folder] if config_folder else [])).folders

    @property
    def is_own(self) -> bool:
        """Return whether this user has started the run, and nobody has changed its record since."""
        return trust.is_signed(self._text(), self.seal)

    @property
    def command_line(self) -> str:
        """Command that starts the run again, as a line for a shell."""
        flags = ["-m"] * self.multirun + (["--config-name", self.config_name] if self.config_name else [])
        # The experiment or config of a sweep's job may ask for the whole sweep: run this job alone.
        files = self.config_name or "experiment" in map(key_of, self.overrides)
        single_mode = ["hydra.mode=RUN"] * (self.job is not None and bool(files))
        return lme_command(self.command, *flags, *self.overrides, *single_mode, folders=self.folders)

    def write(self, directory: Path, anew: bool = False) -> None:
        """Write `launch.json` atomically. Unless `anew`, a run keeps the changes, inputs, date and code of its start.

        Raises InputError if the directory cannot be written, or if a damaged one is there.
        """
        record, previous = self, read_launch(directory)
        if previous is not None and previous.configs == self.configs and not anew:
            preserved = ("changes", "inputs", "started", "code")
            record = dataclasses.replace(self, **{name: getattr(previous, name) for name in preserved})
        record = dataclasses.replace(record, seal=trust.sign(record._text()))
        try:
            write_atomically(directory / LAUNCH, record._text(sealed=True) + "\n")
        except OSError as error:
            raise directory_error(directory, "written", error) from error

    def _text(self, *, sealed: bool = False) -> str:
        """Return the text of `launch.json`, or the text that its seal signs."""
        fields = dataclasses.asdict(self)
        del fields["directory"]
        return json.dumps(fields if sealed else {**fields, "seal": ""}, indent=1, sort_keys=True)


def read_launch(directory: Path) -> Launch | None:
    """Return the launch of a run directory; None if it holds none. Raises InputError for a damaged one."""
    try:
        text = read_bytes(directory / LAUNCH)
    except InputError:
        raise
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: not a possible file name
        return None
    except OSError as error:
        raise InputError(f"{directory}: its {LAUNCH} cannot be read ({error.strerror})") from error
    try:
        fields = {**decode_json(text), "directory": directory}
        launch = Launch(**{**fields, "inputs": inputs.from_record(fields.get("inputs", []))})
    except (ValueError, TypeError, KeyError, AttributeError):
        launch = None
    if launch is None or not _is_complete(launch):
        raise InputError(f"{directory}: its {LAUNCH} is damaged: restore or remove it")
    return launch


def sweep_launch(sweep_dir: Path) -> Launch | None:
    """Return what `read_launch` does, read once per process: each job of a sweep asks for the sweep's large record."""
    path = (sweep_dir / LAUNCH).resolve()
    return _launch_at(path, path.stat().st_mtime_ns) if path.is_file() else None


@lru_cache(maxsize=1)
def _launch_at(path: Path, time_ns: int) -> Launch | None:
    """time_ns: when the file was written."""
    return read_launch(path.parent)


def job_folders(sweep_dir: Path, marked_by: str = LAUNCH) -> Iterator[Path]:
    """Yield the folders of a sweep's jobs: those below it that hold a file of this name, without looking into them."""
    with os.scandir(sweep_dir) as entries:
        folders = [sweep_dir / entry.name for entry in entries if entry.is_dir(follow_symlinks=False)]
    for folder in folders:
        if (folder / marked_by).is_file():
            yield folder
        else:
            yield from job_folders(folder, marked_by)


def trust_flags(directory: Path) -> list[str]:
    """Return the flags for a command that builds a run's classes: `--trust` unless they are all lme's."""
    launch = read_launch(directory)
    return [trust.FLAG] if launch is not None and any(trust.foreign(launch.configs[0])) else []


def recorded_config(
    values: Mapping[str, Any], directory: Path | None = None, saved_inputs: Sequence[Input] = ()
) -> RecordedConfig:
    """Return the typed config from what `identity` returned, which may come from anyone.

    Everything that is built from a run is built from this config. directory: that of the run or the recording; None
    for one that this process has made. saved_inputs: the files that the run has read; the paths lead to their copies.
    Raises InputError if the config is incomplete, and UntrustedError if it names code that is not lme's, or a file
    outside the run.
    """
    names = [field.name for field in dataclasses.fields(RecordedConfig)]
    config_values = {name: values[name] for name in names if name in values}
    if directory is not None:
        trust.check_config(config_values, directory)
        config_values = inputs.located(config_values, saved_inputs, directory)
        if trust.is_trusted(directory):
            inputs.provide_code(saved_inputs, directory)
    config: RecordedConfig = fill_dataclass(RecordedConfig, config_values, "config")
    return config


def launch_of(
    command: str,
    jobs: Sequence[Job[Any]],
    overrides: list[str],
    multirun: bool,
    config_name: str | None,
    saved_inputs: Sequence[Input] | None = None,
) -> Launch:
    """Return the launch of a run, or of a sweep's jobs.

    overrides: those that decide results. saved_inputs: the files that the run reads; None to search for them.
    """
    from runners.config import build

    configs = [identity(job.config) for job in jobs]
    own_folders = jobs[0].folders[1:]
    return Launch(
        command=command,
        fingerprint=fingerprint(configs, multirun),
        multirun=multirun,
        overrides=[masked_text(word) for word in overrides],
        configs=[masked_values(config) for config in configs],
        choices=[dict(job.choices) for job in jobs],
        changes=[_canonical(dict(job.changes)) for job in jobs],
        weights=[job.weights for job in jobs],
        config_dir=str(own_folders[0]) if own_folders else None,
        config_name=config_name,
        num_worlds=len(build.map_set(jobs[0].config).numbers) if command == "eval" and not multirun else None,
        inputs=input_search.gather(jobs, config_name) if saved_inputs is None else list(saved_inputs),
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        code=code(),
    )


def identity(config: SystemConfig) -> dict[str, Any]:
    """Return the part of a config that decides its results, as plain JSON values."""
    return {
        key: _canonical(value)
        for key, value in dataclasses.asdict(config).items()
        if key not in NO_RESULTS and not (key in DEFAULTS and DEFAULTS[key] == value)
    }


def fingerprint(configs: Sequence[Mapping[str, Any]], multirun: bool) -> str:
    """Return the SHA-256 of the identity of a run, or of the identities of a sweep's jobs in order."""
    value = list(configs) if multirun else configs[0]
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> Iterator[str]:
    """Yield "key: old there, new now" for every key in which two identities differ."""
    old_values, new_values = dict(flatten(old)), dict(flatten(new))
    for key in sorted(old_values.keys() | new_values.keys()):
        if old_values.get(key) != new_values.get(key):
            yield f"{key}: {old_values.get(key, 'absent')} there, {new_values.get(key, 'absent')} now"


def shortened(texts: Sequence[str]) -> str:
    """Return the first few changes, and the number of the others."""
    remainder = f" and {len(texts) - _SHOWN} more" if len(texts) > _SHOWN else ""
    return f"{'; '.join(texts[:_SHOWN])}{remainder}"


def common(configs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the dotted keys and values that all identities have in common."""
    first_values, *other_configs = (dict(flatten(config)) for config in configs)
    return {
        key: value
        for key, value in first_values.items()
        if all(values.get(key) == value for values in other_configs)
    }


def directory_error(directory: Path, action: str, error: OSError) -> InputError:
    """Return the error of a directory that cannot be "read" or "written"; action: one of these words."""
    return InputError(
        f"output directory {directory}: cannot be {action} ({error.strerror}): "
        "choose another with hydra.run.dir=PATH"
    )


def _is_complete(launch: Launch) -> bool:
    """Return whether a launch that was read holds, for every job, what `launch_of` writes."""
    texts = [launch.command, launch.fingerprint, launch.started, launch.code]
    texts += [launch.config_dir or "", launch.config_name or ""]
    numbers = (launch.job, launch.num_jobs, launch.num_worlds)
    lists = (launch.configs, launch.choices, launch.changes)
    return (
        all(isinstance(text, str) for text in texts)
        and isinstance(launch.multirun, bool)
        and all(number is None or isinstance(number, int) for number in numbers)
        and _is_list_of(str, launch.overrides)
        and _is_list_of(str, launch.weights)
        and isinstance(launch.seal, str)
        and all(_is_list_of(dict, entries) and len(entries) == len(launch.configs) > 0 for entries in lists)
        and all(isinstance(name, str) for choices in launch.choices for name in choices.values())
        and all(_is_scale(config.get("scale", {})) for config in launch.configs)
        and all(_is_list_of(str, config.get("table", [])) for config in launch.configs)
    )


def _is_scale(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(factor, int | float) for factor in value.values())


def _is_list_of(kind: type, value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(item, kind) for item in value)


def _canonical(value: Any) -> Any:
    """Return equal values in the same form, fit for JSON: 4.0 becomes 4, and infinity becomes text."""
    if isinstance(value, dict):
        return {str(key): _canonical(child) for key, child in value.items()}
    if isinstance(value, list | tuple):
        return [_canonical(child) for child in value]
    if isinstance(value, float):
        if not math.isfinite(value):
            return str(value)
        return int(value) if value.is_integer() else value
    return value


class Commit(NamedTuple):
    """Commit of a checkout. changed: whether its files have uncommitted changes."""

    number: str
    changed: bool


def versions(*packages: str) -> dict[str, str]:
    """Return the versions of Python, lme, and each of the packages that is installed, by name."""
    versions_by_package = {"python": platform.python_version(), "lme": lme.__version__}
    for package in packages:
        with suppress(PackageNotFoundError):
            versions_by_package[package] = version(package)
    return versions_by_package


@cache
def commit() -> Commit | None:
    """Return the commit of this file's checkout; None in an installed wheel."""
    try:
        if Path(_git("rev-parse", "--show-toplevel")).resolve() != _ROOT:
            return None
        has_changes = bool(_git("status", "--porcelain", "--untracked-files=no"))
        return Commit(_git("rev-parse", "HEAD"), has_changes)
    except (OSError, subprocess.SubprocessError):
        return None


def code() -> str:
    """Return the version of lme and its commit as text: "lme 0.2.0, commit 1ec8305b, changed"."""
    checkout = commit()
    notes = (
        [] if checkout is None else [f"commit {checkout.number[:_DIGITS]}", *["changed"] * checkout.changed]
    )
    return ", ".join([f"lme {lme.__version__}", *notes])


def _git(*arguments: str) -> str:
    command = ["git", "-C", str(_ROOT), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
