"""Find the user's own files that the jobs of a command read.

These are the files that the config names (maps with their pictures, tracks, networks, weights), the options of
--config-dir, and the source of own classes and criteria, with what it imports from the user's own folders.
"""

from __future__ import annotations

import ast
import json
import re
import sys
import sysconfig
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path, PurePosixPath
from typing import Any

from lme.errors import InputError
from lme.inputs.guarded_file import expanded
from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.schema import SystemConfig
from runners.records import trust
from runners.records.inputs import (
    CODE,
    LARGEST,
    OPTIONS,
    Input,
    InputFile,
    content_of,
    is_beside,
    is_shipped,
    last_part,
    path_of,
    picture_of,
    sha,
    sha_of,
)

_MOST = 256 * 2**20  # [bytes] of all files that are copied for a run
_NOT_READ = (
    "bag",
    "run",
    "resume",
    "storage",
    "study",
    "executor",
    "tracking",
    "hydra",
)  # keys whose values are not inputs of a drive
_DOTTED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")


def gather(jobs: Sequence[Job[SystemConfig]], config_name: str | None = None) -> list[Input]:
    """Return the user's own files that these jobs read. Raises InputError for one that cannot be read."""
    inputs: dict[tuple[str, str], Input] = {}
    budget = [_MOST]
    for job in jobs:
        values = {field.name: getattr(job.config, field.name) for field in fields(job.config)}
        for key, value, node in _named_values(values):
            if (key, value) in inputs:
                continue
            path = path_of(key, value)
            if path is not None and not is_shipped(path):
                files, name = _files_of(path, key, node)
                inputs[key, value] = _input(key, value, name, files, budget)
    options = _options(jobs, config_name)
    code = _sources(jobs)
    if options:
        inputs[OPTIONS, ""] = _input(OPTIONS, "", "", options, budget)
    if code:
        inputs[CODE, ""] = _input(CODE, "", "", code, budget)
    return list(inputs.values())


def _named_values(values: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Yield (dotted key, text, mapping that holds it) for every text of a job's config that may name an input."""

    def walk(node: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
        for name, value in node.items():
            if isinstance(value, Mapping):
                yield from walk(value, f"{prefix}{name}.")
            for text in value if isinstance(value, list) else [value]:
                if isinstance(text, str):
                    yield f"{prefix}{name}", text, node

    yield from walk({name: value for name, value in values.items() if name not in _NOT_READ}, "")


def _files_of(path: Path, key: str, node: Mapping[str, Any]) -> tuple[dict[str, Path], str]:
    """Return the files of an input by their paths among the copies, and the path of the input itself there."""
    if path.is_file():
        return _with_companions(path, PurePosixPath(path.name)), path.name
    if last_part(key) == "paths":
        maps = sorted(path.glob("*.yaml"))
        return {
            name: file
            for map_file in maps
            for name, file in _with_companions(map_file, PurePosixPath(map_file.name)).items()
        }, ""
    worlds = _barn_files(path, key, node) if last_part(key) == "source" else []
    files = worlds or sorted(map_file for map_file in path.rglob("*") if map_file.is_file())
    return {map_file.relative_to(path).as_posix(): map_file for map_file in files}, ""


def _barn_files(source: Path, key: str, node: Mapping[str, Any]) -> list[Path]:
    """Return the published files of the BARN worlds that are driven; none if the folder holds other files."""
    from lme.worlds.barn.files import find_worlds, path_file
    from runners.config.instantiate import build

    with suppress(InputError):
        worlds, numbers = find_worlds(source), build(node, key.rpartition(".")[0]).numbers
        driven_worlds = [worlds[number] for number in numbers if number in worlds]
        return [file for world in driven_worlds for file in (world, path_file(world)) if file.is_file()]
    return []


def _with_companions(path: Path, name: PurePosixPath) -> dict[str, Path]:
    """Return a file and, for a ROS map, its picture."""
    picture = picture_of(path)
    if picture is not None:
        copy_name = name.parent / (picture if is_beside(picture) else Path(picture).name)
        return {str(name): path, str(copy_name): path.parent / expanded(picture)}
    return {str(name): path}


def _input(key: str, value: str, name: str, files: Mapping[str, Path], budget: list[int]) -> Input:
    """Describe the files of an input. budget: bytes that may still be copied; the one-item list is updated."""
    input_files = {}
    for relative, path in sorted(files.items()):
        try:
            size = path.stat().st_size
            is_small_enough = size <= min(LARGEST, budget[0])
            budget[0] -= size if is_small_enough else 0
            copy = sha(content_of(path)) if is_small_enough else ""
            input_files[relative] = InputFile(str(path.absolute()), sha_of(path), size, copy)
        except OSError as error:
            raise InputError(f"{key} is {value}: {path} cannot be read ({error.strerror})") from error
    contents = json.dumps([[relative, file.copy or file.sha256] for relative, file in input_files.items()])
    return Input(key, value, name, sha(contents.encode())[:16], input_files)


def _options(jobs: Sequence[Job[SystemConfig]], config_name: str | None) -> dict[str, Path]:
    """Return the files below --config-dir of the options that these jobs chose, with those that they inherit."""
    option_files: dict[str, Path] = {}
    for job in jobs:
        catalogue, own_folders = Catalogue(job.folders), job.folders[1:]
        names = [
            f"{group.partition('@')[0]}/{name}"
            for group, option in job.choices.items()
            for name in option.split("+")
        ]
        names += [f"system/{name}" for name in getattr(job.config, "table", [])]
        for name in [*names, *([config_name] if config_name else [])]:
            files = catalogue.option(name).files if own_folders and catalogue.has(name) else ()
            option_files |= {
                file.relative_to(own_folders[0]).as_posix(): file
                for file in files
                if file.is_relative_to(own_folders[0])
            }
    return option_files


def _sources(jobs: Sequence[Job[SystemConfig]]) -> dict[str, Path]:
    """Return the sources of the user's own modules that these jobs name, and of the own modules that they import."""
    texts = (
        text
        for job in jobs
        for field in fields(job.config)
        if field.name not in _NOT_READ
        for _, text in trust.leaves(getattr(job.config, field.name))
    )
    pending = [text.rpartition(".")[0] for text in texts if isinstance(text, str) and _DOTTED.fullmatch(text)]
    source_files: dict[str, Path] = {}
    visited = set()
    while pending:
        module = pending.pop()
        file = None if module in visited else _own_source(module)
        visited.add(module)
        if file is not None:
            suffix = "/__init__.py" if file.name == "__init__.py" else ".py"
            source_files[module.replace(".", "/") + suffix] = file
            pending += [module.rpartition(".")[0], *_imported(file, module)]
    return source_files


def _own_source(module: str) -> Path | None:
    """Return the source of a module of the user's own; None for a module that is installed or does not exist."""
    top_level = module.partition(".")[0]
    if top_level in ("", "lme", "runners", "__main__") or top_level in sys.stdlib_module_names:
        return None
    loaded = sys.modules.get(module)
    origin = _origin(module) if loaded is None else getattr(loaded, "__file__", None)
    path = Path(origin) if origin else None
    if path is None or path.suffix != ".py" or not path.is_file() or _is_installed(path):
        return None
    return path


def _origin(module: str) -> str | None:
    """Return the file that a module would be imported from, without importing anything."""
    spec: ModuleSpec | None = None
    search_paths: list[str] | None = None
    name = ""
    for component in module.split("."):
        name = f"{name}.{component}" if name else component
        spec = PathFinder.find_spec(name, search_paths)
        if spec is None:
            return None
        search_paths = spec.submodule_search_locations or []
    return None if spec is None else spec.origin


def _is_installed(path: Path) -> bool:
    library = [Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")]
    return bool({"site-packages", "dist-packages"} & set(path.parts)) or any(
        map(path.is_relative_to, library)
    )


def _imported(file: Path, module: str) -> list[str]:
    """Return the names of the modules that a source file may import."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, OSError):
        return []
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    modules = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            parent_package = (
                package.split(".")[: len(package.split(".")) - (node.level - 1)] if node.level else []
            )
            base = ".".join([*parent_package, *([node.module] if node.module else [])])
            modules += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return modules
