"""Copies of the user's own files that a run has read, beside its records, so that its directory is complete.

`input_search.gather` finds the files. `keep` copies them, once for a sweep, into inputs/DIGEST/, and `launch.json`
holds the list. `located` and `provide_code` later lead to the copies, and `check_unchanged` compares them with the
files as they are then.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import re
import stat
import sys
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from importlib.machinery import PathFinder
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

import yaml

from lme.errors import InputError
from lme.guides.lme.weight_files import find_network, find_weights
from lme.inputs.guarded_file import expanded, read_yaml
from lme.inputs.resources import resource_dir
from runners.records import trust
from runners.records.atomic_write import replacing

FOLDER = "inputs"  # in the directory of a run or of a sweep
LARGEST = 64 * 2**20  # [bytes] largest file that is copied
CODE, OPTIONS, WEIGHTS = "code", "--config-dir", "weights"  # keys of inputs that no path in the config names
PATHS = ("path", "paths", "source")  # keys that name a file or a folder

_ABOVE = 3  # folders from a recording up to the directory of its sweep
_DIGEST = re.compile(r"[0-9a-f]{16}")

C = TypeVar("C")


@dataclass(slots=True)
class InputFile:
    """One file. source: absolute path at launch. sha256, size: its content's then. copy: its copy's SHA-256 or ""."""

    source: str
    sha256: str
    size: int
    copy: str


@dataclass(slots=True)
class Input:
    """The files that one value of the config names. key, given: the value's key and text. name: path in the copies.

    digest: the folder of the copies. files: by their paths in it.
    """

    key: str
    given: str
    name: str
    digest: str
    files: dict[str, InputFile]


def keep(inputs: Sequence[Input], directory: Path) -> None:
    """Copy the files into the directory of a run or of a sweep, unless it or a directory above has them.

    Raises InputError if that cannot be done.
    """
    for entry in (entry for entry in inputs if _copy_folder(entry, directory) is None):
        for name, file in entry.files.items():
            copy_path = directory / FOLDER / entry.digest / name
            if not file.copy:
                continue
            try:
                content = content_of(Path(file.source))
                copy_path.parent.mkdir(parents=True, exist_ok=True)
                with replacing(copy_path) as draft:
                    draft.write_bytes(content)
            except OSError as error:
                raise InputError(
                    f"{copy_path}: the copy of {file.source} cannot be written ({error.strerror})"
                ) from error
            # The digest was taken a moment ago: a file that has changed meanwhile is refused.
            if sha(content) != file.copy:
                raise InputError(
                    f"{file.source}: has changed while the run was being started: start it again"
                )


def sentence(inputs: Sequence[Input]) -> str:
    """Return the notice at the start of a run that anyone who is sent its folder gets these files; empty for none."""
    files = {file.source: file for entry in inputs for file in entry.files.values()}
    kept_names = dict.fromkeys(Path(source).name for source, file in files.items() if file.copy)
    large_names = dict.fromkeys(Path(source).name for source, file in files.items() if not file.copy)
    clauses = []
    if kept_names:
        kept = _listed(list(kept_names))
        clauses.append(f"kept with the run: {kept}; whoever you send its folder to gets these files")
    if large_names:
        clauses.append(f"too large to keep, so only their checksums are: {_listed(list(large_names))}")
    return "; ".join(clauses)


def located(values: C, inputs: Sequence[Input], directory: Path) -> C:
    """Return a recorded config, or a part of it, whose paths lead to the copies.

    directory: that of the run or the recording. Where today's file differs from the copy, a warning says that the
    copy is used. Raises InputError for a missing or damaged copy, and UntrustedError for a file outside the run.
    """
    inputs_by_value = {(last_part(saved.key), saved.given): saved for saved in inputs}

    def moved(value: Any, key: str) -> Any:
        if isinstance(value, Mapping):
            return {
                name: moved(child, f"{key}.{name}" if key else str(name)) for name, child in value.items()
            }
        if isinstance(value, list):
            return [moved(child, key) for child in value]
        if (
            not isinstance(value, str) or key == WEIGHTS
        ):  # the config records the parameters of a weight set themselves
            return value
        # A text is an input of the run if key and value agree; other files must be inside, shipped or trusted.
        entry = inputs_by_value.get((last_part(key), value))
        if entry is not None:
            return _input_path(entry, directory)
        _refuse_outside(key, value, directory)
        return value

    return moved(values, "")  # type: ignore[no-any-return]


def as_at_launch(config: C, inputs: Sequence[Input], directory: Path) -> C:
    """Return the config of a starting job with paths to the copies of files that changed since the launch.

    Own code that has changed is imported from its copy.
    """
    changed_inputs = [entry for entry in inputs if changed_files(entry)]
    if not changed_inputs:
        return config
    provide_code(changed_inputs, directory, is_running=True)
    values = {field.name: getattr(config, field.name) for field in fields(config)}  # type: ignore[arg-type]
    groups = {name: value for name, value in values.items() if isinstance(value, dict)}
    return replace(config, **located(groups, changed_inputs, directory))  # type: ignore[type-var]


def changed_files(entry: Input) -> list[str]:
    """Return the files that are now missing or differ from what they were at launch."""
    return [file.source for file in entry.files.values() if not _is_same(file)]


def is_gone(entry: Input) -> bool:
    """Return whether a run's own code is no longer there to import."""
    return entry.key == CODE and not _is_importable(entry)


def is_lost(entry: Input) -> bool:
    """Return whether a value that named a file or folder at launch names none here."""
    return entry.key not in (CODE, OPTIONS) and path_of(entry.key, entry.given) is None


def check_unchanged(saved: Sequence[Input], current: Sequence[Input], directory: Path) -> None:
    """Raise InputError, naming the file, unless a run that is resumed reads the same content as before.

    saved: inputs of the run in this directory, or of its whole sweep. current: inputs of the same command line today.
    """
    for entry, name in differing(saved, current):
        file = entry.files[name]
        copy = f"; the run holds its copy, {FOLDER}/{entry.digest}/{name}" if file.copy else ""
        raise InputError(
            f"{directory}: {file.source} has changed since the run began, so it cannot be resumed: "
            f"restore the file, or start again in another directory{copy}"
        )


def differing(saved: Sequence[Input], current: Sequence[Input]) -> list[tuple[Input, str]]:
    """Return the files that both have read and that differ, as the saved input and the name of the file in it."""
    today = {(entry.key, entry.given): entry.files for entry in current}
    return [
        (entry, name)
        for entry in saved
        for name, file in entry.files.items()
        for current_file in [today.get((entry.key, entry.given), {}).get(name)]
        if current_file is not None and current_file.sha256 != file.sha256
    ]


def options_folder(inputs: Sequence[Input], directory: Path) -> Path | None:
    """Return the copy of the user's own options that a run has used; None if it has none."""
    options = next((entry for entry in inputs if entry.key == OPTIONS), None)
    return None if options is None else _copy_folder(options, directory)


def provide_code(inputs: Sequence[Input], directory: Path, is_running: bool = False) -> None:
    """Import a run's own code from its copies, unless the same code is importable today.

    is_running: whether the run is that of this process, which loaded the code before it changed. Raises InputError if
    another version of it is loaded already.
    """
    for entry in (entry for entry in inputs if entry.key == CODE):
        folder = _copy_folder(entry, directory)
        if folder is None or (not changed_files(entry) and _is_importable(entry)):
            continue
        if not is_running:
            _check_loaded(entry)
        changed_sources = [source for source in changed_files(entry) if os.path.exists(source)]  # noqa: PTH110
        _say_copy(changed_sources, folder)
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))  # before today's versions; worker processes inherit it
            importlib.invalidate_caches()


def from_record(values: Any) -> list[Input]:
    """Return the inputs that `launch.json` lists.

    Raises ValueError, TypeError or KeyError for entries that `gather` cannot have made.
    """
    loaded = []
    for value in values:
        files = {name: InputFile(**file) for name, file in value["files"].items()}
        entry = Input(**{**value, "files": files})
        texts = [
            entry.key,
            entry.given,
            entry.name,
            *(text for file in files.values() for text in (file.source, file.copy)),
        ]
        names = [PurePosixPath(name) for name in (entry.name, *files)]
        is_inside = all(not name.is_absolute() and ".." not in name.parts for name in names)
        if not (
            is_inside and all(isinstance(text, str) for text in texts) and _DIGEST.fullmatch(entry.digest)
        ):
            raise ValueError(value)
        loaded.append(entry)
    return loaded


def path_of(key: str, value: str) -> Path | None:
    """Return the file or folder that a value names; None if it names none."""
    with suppress(OSError, ValueError):
        if key == WEIGHTS:
            return find_weights(value)
        if last_part(key) == WEIGHTS or key == "start":
            return find_network(value)
        path = expanded(value)
        if path.is_file() and (last_part(key) in PATHS or path.suffix or "/" in value):
            return path
        return path if last_part(key) in PATHS and path.is_dir() else None
    return None


def picture_of(path: Path) -> str | None:
    """Return the picture that a ROS map names; None for any other file."""
    if path.suffix.lower() not in (".yaml", ".yml") or path.stat().st_size > LARGEST:
        return None
    with suppress(InputError):
        content = read_yaml(path)
        image = content.get("image") if isinstance(content, dict) else None
        if isinstance(image, str) and (path.parent / expanded(image)).is_file():
            return image
    return None


def is_beside(picture: str) -> bool:
    """Return whether a picture is found beside a copy of its map under the same name."""
    return not (picture.startswith("~") or Path(picture).is_absolute() or ".." in Path(picture).parts)


def content_of(path: Path) -> bytes:
    """Return the content of a copy: that of the file, except that a ROS map names the copy of its picture."""
    picture = picture_of(path)
    if picture is None or is_beside(picture):
        return path.read_bytes()
    content = read_yaml(path)
    assert isinstance(content, dict)
    return yaml.safe_dump({**content, "image": Path(picture).name}, allow_unicode=True).encode()


def _input_path(entry: Input, directory: Path) -> str:
    """Return the path to read an input from: its own if the file is unchanged and may be used, else its copy's."""
    changed_sources = changed_files(entry)
    if not changed_sources and _is_at_home(entry) and (trust.is_trusted(directory) or not _is_copied(entry)):
        return entry.given
    folder = _copy_folder(entry, directory)
    if folder is None:
        reason = (
            f"no {FOLDER}/{entry.digest}" if _is_copied(entry) else "only a checksum of it, as it is large"
        )
        raise InputError(
            f"{directory}: its {entry.key} is {entry.given}, which is missing or has changed, and the run has {reason}"
        )
    _say_copy([source for source in changed_sources if os.path.exists(source)], folder)  # noqa: PTH110
    return str(folder / entry.name)


def _is_at_home(entry: Input) -> bool:
    """Return whether the value leads to the same files as at launch; from another folder it may not."""
    path = path_of(entry.key, entry.given)
    if path is None or not entry.files:
        return False
    file = path if path.is_file() else path / next(iter(entry.files))
    return str(file.absolute()) in {file.source for file in entry.files.values()}


def _say_copy(sources: Sequence[str], folder: Path) -> None:
    if sources:
        subject = f"{sources[0]} has" if len(sources) == 1 else f"{_listed(sources)} have"
        warnings.warn(f"{subject} changed since the run: its copy in {folder} is used", stacklevel=2)


def _copy_folder(entry: Input, directory: Path) -> Path | None:
    """Return the checked folder with the copies of an input; None if there is none. Raises InputError for damage."""
    run_folder = directory.absolute()
    for parent in (run_folder, *run_folder.parents[:_ABOVE]):
        folder = parent / FOLDER / entry.digest
        if not folder.is_dir() or not _is_copied(entry):
            continue
        for name, file in entry.files.items():
            path = folder / name
            is_inside = path.resolve().is_relative_to(parent.resolve() / FOLDER)
            if not (is_inside and _is_regular(path) and sha_of(path) == file.copy):
                raise InputError(
                    f"{path}: is missing or not what the run kept there: restore the run's directory"
                )
        return folder
    return None


def _is_copied(entry: Input) -> bool:
    return all(file.copy for file in entry.files.values())


def _refuse_outside(key: str, value: str, directory: Path) -> None:
    """Raise UntrustedError for a file or folder that a run names and that belongs neither to it nor to lme."""
    path = Path(value) if last_part(key) in PATHS and os.path.exists(value) else path_of(key, value)  # noqa: PTH110
    if path is None or is_shipped(path) or trust.is_trusted(directory):
        return
    if not path.resolve().is_relative_to(directory.resolve()):
        raise trust.UntrustedError(
            f"{directory}: its {key} is {value}, of which it holds no copy: "
            f"add {trust.FLAG} to read that file, if you trust whoever made the run"
        )


def is_shipped(path: Path) -> bool:
    resolved = path.resolve()
    return any(resolved.is_relative_to(resource_dir(name).resolve()) for name in ("conf", "maps"))


def _is_importable(entry: Input) -> bool:
    """Return whether today's Python finds the sources of a run's own code where they were."""
    sources = {file.source for file in entry.files.values()}
    tops = {name.partition("/")[0].removesuffix(".py") for name in entry.files}
    specs = [PathFinder.find_spec(top, None) for top in tops]
    return all(spec is not None and (spec.origin is None or spec.origin in sources) for spec in specs)


def _check_loaded(entry: Input) -> None:
    """Raise InputError if another version of a run's own code is loaded, such as that of the previous run."""
    for name, file in entry.files.items():
        module = sys.modules.get(name.removesuffix(".py").removesuffix("/__init__").replace("/", "."))
        origin = getattr(module, "__file__", None)
        if origin and not (_is_regular(Path(origin)) and sha_of(Path(origin)) == file.copy):
            raise InputError(
                f"{Path(file.source).name}: two versions of it are asked for: give the runs one at a time"
            )


def _is_same(file: InputFile) -> bool:
    """Return whether a source is unchanged since the launch."""
    path = Path(file.source)
    with suppress(OSError, ValueError):
        return _is_regular(path) and path.stat().st_size == file.size and sha_of(path) == file.sha256
    return False


def _is_regular(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def sha_of(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def last_part(key: str) -> str:
    return key.rpartition(".")[2]


def _listed(names: Sequence[str]) -> str:
    """Return the first few names, and the number of the others."""
    return ", ".join([*names[:8], *([f"{len(names) - 8} more"] if len(names) > 8 else [])])
