"""What a run has read from the user's own files: copies beside its records, so that its directory is complete.

`gather` finds the files of the jobs that are about to run: those that the config names (maps with their pictures,
tracks, networks, weights), the options of --config-dir, and the source of own classes and criteria with what it
imports from the user's own folders. `keep` copies them, once for a sweep, into inputs/DIGEST/. `launch.json` holds the
list.
"""

from __future__ import annotations

import ast
import hashlib
import importlib
import json
import os
import re
import stat
import sys
import sysconfig
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

import yaml

from lme.errors import InputError
from lme.resources import resource_dir
from lme.weight_files import find_network, find_weights
from lme.yaml_entry import read_yaml
from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.schema import SystemConfig
from runners.records import trust
from runners.records.whole_file import replacing

FOLDER = "inputs"  # in the directory of a run or of a sweep
LARGEST, MOST = 64 * 2**20, 256 * 2**20  # [bytes] of a file that is copied, and of all together
CODE, OPTIONS = "code", "--config-dir"  # keys of inputs that no key of the config names

_PATHS = ("path", "paths", "source")  # keys that name a file or a folder
_WEIGHTS = "weights"
_NOT_READ = (
    "bag",
    "run",
    "resume",
    "storage",
    "study",
    "executor",
    "tracking",
    "hydra",
)  # not inputs of a drive
_ABOVE = 3  # folders from a recording up to the directory of its sweep
_DIGEST = re.compile(r"[0-9a-f]{16}")
_DOTTED = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)+")

C = TypeVar("C")


@dataclass(slots=True)
class InputFile:
    """source: its absolute path at launch. sha256, size: of its content then. copy: SHA-256 of the copy, if any."""

    source: str
    sha256: str
    size: int
    copy: str


@dataclass(slots=True)
class Input:
    """What one value of the config names. key, given: the value's key and the value. name: within the copies.

    digest: the folder of the copies. files: by their paths in it.
    """

    key: str
    given: str
    name: str
    digest: str
    files: dict[str, InputFile]


def gather(jobs: Sequence[Job[SystemConfig]], config_name: str | None = None) -> list[Input]:
    """The user's own files that these jobs read. Raises InputError for one that cannot be read."""
    found: dict[tuple[str, str], Input] = {}
    budget = [MOST]
    for job in jobs:
        values = {each.name: getattr(job.config, each.name) for each in fields(job.config)}
        for key, given, node in _named(values):
            if (key, given) in found:
                continue
            path = _path_of(key, given)
            if path is not None and not _is_shipped(path):
                files, name = _files_of(path, key, node)
                found[key, given] = _input(key, given, name, files, budget)
    options = _options(jobs, config_name)
    code = _sources(jobs)
    if options:
        found[OPTIONS, ""] = _input(OPTIONS, "", "", options, budget)
    if code:
        found[CODE, ""] = _input(CODE, "", "", code, budget)
    return list(found.values())


def keep(inputs: Sequence[Input], directory: Path) -> None:
    """Copy the files into the directory of a run or of a sweep, unless that of which it is a part has them.

    Raises InputError if that cannot be done.
    """
    for each in (each for each in inputs if _copies(each, directory) is None):
        for name, file in each.files.items():
            place = directory / FOLDER / each.digest / name
            if not file.copy:
                continue
            try:
                content = _content(Path(file.source))
                place.parent.mkdir(parents=True, exist_ok=True)
                with replacing(place) as draft:
                    draft.write_bytes(content)
            except OSError as error:
                raise InputError(
                    f"{place}: the copy of {file.source} cannot be written ({error.strerror})"
                ) from error
            if _sha(content) != file.copy:
                raise InputError(
                    f"{file.source}: has changed while the run was being started: start it again"
                )


def sentence(inputs: Sequence[Input]) -> str:
    """What a run says when it starts, since whoever is sent its folder gets these files; empty if there are none."""
    files = {file.source: file for each in inputs for file in each.files.values()}
    kept = dict.fromkeys(Path(source).name for source, file in files.items() if file.copy)
    large = dict.fromkeys(Path(source).name for source, file in files.items() if not file.copy)
    parts = (
        [f"kept with the run: {_listed(list(kept))}; whoever you send its folder to gets these files"]
        if kept
        else []
    )
    parts += [f"too large to keep, so only their checksums are: {_listed(list(large))}"] if large else []
    return "; ".join(parts)


def located(values: C, inputs: Sequence[Input], directory: Path) -> C:
    """A recorded config, or a part of it, whose paths lead to the copies.

    directory: of the run or the recording. Where today's file differs from the copy, a warning says that the copy is
    used. Raises InputError for a copy that is missing or damaged, and UntrustedError for a file outside the run.
    """
    known = {(_last(each.key), each.given): each for each in inputs}

    def moved(value: Any, key: str) -> Any:
        if isinstance(value, Mapping):
            return {
                name: moved(child, f"{key}.{name}" if key else str(name)) for name, child in value.items()
            }
        if isinstance(value, list):
            return [moved(child, key) for child in value]
        if (
            not isinstance(value, str) or key == _WEIGHTS
        ):  # the parameters of a weight set are recorded themselves
            return value
        own = known.get((_last(key), value))
        if own is not None:
            return _place(own, directory)
        _refuse_outside(key, value, directory)
        return value

    return moved(values, "")  # type: ignore[no-any-return]


def as_at_launch(config: C, inputs: Sequence[Input], directory: Path) -> C:
    """The config of a job that begins: its paths lead to the copies of files that have changed since the launch.

    Own code that has changed is imported from its copy.
    """
    changed = [each for each in inputs if changed_files(each)]
    if not changed:
        return config
    provide_code(changed, directory, is_running=True)
    named = {each.name: getattr(config, each.name) for each in fields(config)}  # type: ignore[arg-type]
    groups = {name: value for name, value in named.items() if isinstance(value, dict)}
    return replace(config, **located(groups, changed, directory))  # type: ignore[type-var]


def changed_files(each: Input) -> list[str]:
    """The files that today are missing or differ from what they were at launch."""
    return [file.source for file in each.files.values() if not _is_same(file)]


def is_gone(each: Input) -> bool:
    """Whether a run's own code is no longer there to import."""
    return each.key == CODE and not _is_importable(each)


def is_lost(each: Input) -> bool:
    """Whether a value that named a file or folder at launch names none here."""
    return each.key not in (CODE, OPTIONS) and _path_of(each.key, each.given) is None


def check_unchanged(saved: Sequence[Input], now: Sequence[Input], directory: Path) -> None:
    """Raise InputError, naming the file, unless a run that is resumed reads today what it read before.

    saved: of the run in this directory, or of its whole sweep. now: of the same command line today.
    """
    for each, name in differing(saved, now):
        file = each.files[name]
        copy = f"; the run holds its copy, {FOLDER}/{each.digest}/{name}" if file.copy else ""
        raise InputError(
            f"{directory}: {file.source} has changed since the run began, so it cannot be resumed: "
            f"restore the file, or start again in another directory{copy}"
        )


def differing(saved: Sequence[Input], now: Sequence[Input]) -> list[tuple[Input, str]]:
    """The files that both have read and that differ: the saved input, and the name of the file in it."""
    today = {(each.key, each.given): each.files for each in now}
    return [
        (each, name)
        for each in saved
        for name, file in each.files.items()
        for new in [today.get((each.key, each.given), {}).get(name)]
        if new is not None and new.sha256 != file.sha256
    ]


def options_folder(inputs: Sequence[Input], directory: Path) -> Path | None:
    """The copy of the user's own options that a run has used; None if it has none."""
    own = next((each for each in inputs if each.key == OPTIONS), None)
    return None if own is None else _copies(own, directory)


def provide_code(inputs: Sequence[Input], directory: Path, is_running: bool = False) -> None:
    """Import a run's own code from its copies, unless the same code is importable today.

    is_running: the run is that of this process, which has loaded the code before it changed. Raises InputError if
    another version of it is loaded already.
    """
    for each in (each for each in inputs if each.key == CODE):
        folder = _copies(each, directory)
        if folder is None or (not changed_files(each) and _is_importable(each)):
            continue
        if not is_running:
            _check_loaded(each)
        differing = [source for source in changed_files(each) if os.path.exists(source)]  # noqa: PTH110
        _say_copy(differing, folder)
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))  # before today's versions; worker processes inherit it
            importlib.invalidate_caches()


def from_record(values: Any) -> list[Input]:
    """The inputs that `launch.json` lists. Raises ValueError, TypeError or KeyError for what `gather` cannot make."""
    found = []
    for value in values:
        files = {name: InputFile(**file) for name, file in value["files"].items()}
        each = Input(**{**value, "files": files})
        texts = [
            each.key,
            each.given,
            each.name,
            *(text for file in files.values() for text in (file.source, file.copy)),
        ]
        names = [PurePosixPath(name) for name in (each.name, *files)]
        inside = all(not name.is_absolute() and ".." not in name.parts for name in names)
        if not (inside and all(isinstance(text, str) for text in texts) and _DIGEST.fullmatch(each.digest)):
            raise ValueError(value)
        found.append(each)
    return found


def _named(values: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """(dotted key, text, the mapping that it is in) for every text of a job's config that may name an input."""

    def walk(node: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
        for name, value in node.items():
            if isinstance(value, Mapping):
                yield from walk(value, f"{prefix}{name}.")
            for text in value if isinstance(value, list) else [value]:
                if isinstance(text, str):
                    yield f"{prefix}{name}", text, node

    yield from walk({name: value for name, value in values.items() if name not in _NOT_READ}, "")


def _path_of(key: str, given: str) -> Path | None:
    """The file or folder that a value names; None if it names none."""
    with suppress(InputError, OSError, RuntimeError, ValueError):
        if key == _WEIGHTS:
            return find_weights(given)
        if _last(key) == _WEIGHTS or key == "start":
            return find_network(given)
        path = Path(given).expanduser()
        if path.is_file() and (_last(key) in _PATHS or path.suffix or "/" in given):
            return path
        return path if _last(key) in _PATHS and path.is_dir() else None
    return None


def _files_of(path: Path, key: str, node: Mapping[str, Any]) -> tuple[dict[str, Path], str]:
    """The files that belong to an input by their paths among the copies, and the path of the input itself there."""
    if path.is_file():
        return _with_companions(path, PurePosixPath(path.name)), path.name
    if _last(key) == "paths":
        maps = sorted(path.glob("*.yaml"))
        return {
            name: file
            for each in maps
            for name, file in _with_companions(each, PurePosixPath(each.name)).items()
        }, ""
    worlds = _barn_files(path, key, node) if _last(key) == "source" else []
    files = worlds or sorted(each for each in path.rglob("*") if each.is_file())
    return {each.relative_to(path).as_posix(): each for each in files}, ""


def _barn_files(source: Path, key: str, node: Mapping[str, Any]) -> list[Path]:
    """The published files of the BARN worlds that are driven; none if the folder holds others."""
    from lme.worlds.barn.files import find_worlds, path_file
    from runners.config.instantiate import build

    with suppress(InputError):
        worlds, numbers = find_worlds(source), build(node, key.rpartition(".")[0]).numbers
        driven = [worlds[number] for number in numbers if number in worlds]
        return [file for world in driven for file in (world, path_file(world)) if file.is_file()]
    return []


def _with_companions(path: Path, name: PurePosixPath) -> dict[str, Path]:
    """A file and those that it leads to: the picture of a ROS map, the weights beside an ONNX file."""
    picture = _picture(path)
    if picture is not None:
        return {
            str(name): path,
            str(name.parent / (picture if _is_beside(picture) else Path(picture).name)): _shown(path),
        }
    if path.suffix == ".onnx":
        beside = sorted(path.parent.glob(f"{path.stem}*data"))
        return {str(name): path, **{str(name.parent / each.name): each for each in beside if each.is_file()}}
    return {str(name): path}


def _picture(path: Path) -> str | None:
    """The picture that a ROS map names; None for another file."""
    if path.suffix.lower() not in (".yaml", ".yml") or path.stat().st_size > LARGEST:
        return None
    with suppress(InputError):
        content = read_yaml(path)
        image = content.get("image") if isinstance(content, dict) else None
        if isinstance(image, str) and (path.parent / Path(image).expanduser()).is_file():
            return image
    return None


def _shown(path: Path) -> Path:
    """The picture of a ROS map that has one."""
    return path.parent / Path(str(_picture(path))).expanduser()


def _is_beside(picture: str) -> bool:
    """Whether a picture is found beside a copy of its map under the same name."""
    return not (picture.startswith("~") or Path(picture).is_absolute() or ".." in Path(picture).parts)


def _content(path: Path) -> bytes:
    """The content of a copy: that of the file, except that a ROS map names the copy of its picture."""
    picture = _picture(path)
    if picture is None or _is_beside(picture):
        return path.read_bytes()
    content = read_yaml(path)
    assert isinstance(content, dict)
    return yaml.safe_dump({**content, "image": Path(picture).name}, allow_unicode=True).encode()


def _input(key: str, given: str, name: str, files: Mapping[str, Path], budget: list[int]) -> Input:
    """budget: bytes that may still be copied, in a list that this changes."""
    found = {}
    for place, path in sorted(files.items()):
        try:
            size = path.stat().st_size
            fits = size <= min(LARGEST, budget[0])
            budget[0] -= size if fits else 0
            copy = _sha(_content(path)) if fits else ""
            found[place] = InputFile(str(path.absolute()), _sha_of(path), size, copy)
        except OSError as error:
            raise InputError(f"{key} is {given}: {path} cannot be read ({error.strerror})") from error
    contents = json.dumps([[place, file.copy or file.sha256] for place, file in found.items()])
    return Input(key, given, name, _sha(contents.encode())[:16], found)


def _options(jobs: Sequence[Job[SystemConfig]], config_name: str | None) -> dict[str, Path]:
    """The files below --config-dir of the options that these jobs chose, with those that they inherit."""
    found: dict[str, Path] = {}
    for job in jobs:
        catalogue, own = Catalogue(job.folders), job.folders[1:]
        names = [
            f"{group.partition('@')[0]}/{name}"
            for group, option in job.choices.items()
            for name in option.split("+")
        ]
        names += [f"system/{name}" for name in getattr(job.config, "table", [])]
        for name in [*names, *([config_name] if config_name else [])]:
            files = catalogue.files(name) if own and catalogue.has(name) else []
            found |= {
                file.relative_to(own[0]).as_posix(): file for file in files if file.is_relative_to(own[0])
            }
    return found


def _sources(jobs: Sequence[Job[SystemConfig]]) -> dict[str, Path]:
    """The source of the user's own modules that these jobs name, with what it imports from the user's own folders."""
    texts = (
        text
        for job in jobs
        for each in fields(job.config)
        if each.name not in _NOT_READ
        for _, text in trust.leaves(getattr(job.config, each.name))
    )
    waiting = [text.rpartition(".")[0] for text in texts if isinstance(text, str) and _DOTTED.fullmatch(text)]
    found: dict[str, Path] = {}
    seen = set()
    while waiting:
        module = waiting.pop()
        file = None if module in seen else _own_source(module)
        seen.add(module)
        if file is not None:
            end = "/__init__.py" if file.name == "__init__.py" else ".py"
            found[module.replace(".", "/") + end] = file
            waiting += [module.rpartition(".")[0], *_imported(file, module)]
    return found


def _own_source(module: str) -> Path | None:
    """The source of a module that is the user's own; None for an installed one, or one that is not there."""
    top = module.partition(".")[0]
    if top in ("", "lme", "runners", "__main__") or top in sys.stdlib_module_names:
        return None
    loaded = sys.modules.get(module)
    origin = _origin(module) if loaded is None else getattr(loaded, "__file__", None)
    path = Path(origin) if origin else None
    if path is None or path.suffix != ".py" or not path.is_file() or _is_installed(path):
        return None
    return path


def _origin(module: str) -> str | None:
    """Where a module would be imported from, found without importing anything."""
    spec: ModuleSpec | None = None
    places: list[str] | None = None
    name = ""
    for part in module.split("."):
        name = f"{name}.{part}" if name else part
        spec = PathFinder.find_spec(name, places)
        if spec is None:
            return None
        places = spec.submodule_search_locations or []
    return None if spec is None else spec.origin


def _is_installed(path: Path) -> bool:
    library = [Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib")]
    return bool({"site-packages", "dist-packages"} & set(path.parts)) or any(
        map(path.is_relative_to, library)
    )


def _imported(file: Path, module: str) -> list[str]:
    """The modules that a source file may import, by name."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, OSError):
        return []
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - (node.level - 1)] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return found


def _place(each: Input, directory: Path) -> str:
    """Where an input is read: at its own place if it is there as it was and may be used, else from its copy."""
    changed = changed_files(each)
    if not changed and _is_at_home(each) and (trust.is_trusted(directory) or not _is_copied(each)):
        return each.given
    folder = _copies(each, directory)
    if folder is None:
        why = f"no {FOLDER}/{each.digest}" if _is_copied(each) else "only a checksum of it, as it is large"
        raise InputError(
            f"{directory}: its {each.key} is {each.given}, which is missing or has changed, and the run has {why}"
        )
    _say_copy([source for source in changed if os.path.exists(source)], folder)  # noqa: PTH110
    return str(folder / each.name)


def _is_at_home(each: Input) -> bool:
    """Whether the value leads to the files that it led to at launch, which it may not from another folder."""
    path = _path_of(each.key, each.given)
    if path is None or not each.files:
        return False
    file = path if path.is_file() else path / next(iter(each.files))
    return str(file.absolute()) in {file.source for file in each.files.values()}


def _say_copy(differing: Sequence[str], folder: Path) -> None:
    if differing:
        what = f"{differing[0]} has" if len(differing) == 1 else f"{_listed(differing)} have"
        warnings.warn(f"{what} changed since the run: its copy in {folder} is used", stacklevel=2)


def _copies(each: Input, directory: Path) -> Path | None:
    """The folder with the copies of an input, checked; None if there is none. Raises InputError for a damaged one."""
    here = directory.absolute()
    for place in (here, *here.parents[:_ABOVE]):
        folder = place / FOLDER / each.digest
        if not folder.is_dir() or not _is_copied(each):
            continue
        for name, file in each.files.items():
            path = folder / name
            inside = path.resolve().is_relative_to(place.resolve() / FOLDER)
            if not (inside and _is_regular(path) and _sha_of(path) == file.copy):
                raise InputError(
                    f"{path}: is missing or not what the run kept there: restore the run's directory"
                )
        return folder
    return None


def _is_copied(each: Input) -> bool:
    return all(file.copy for file in each.files.values())


def _refuse_outside(key: str, given: str, directory: Path) -> None:
    """Raise UntrustedError for a file or folder that a run names and that belongs neither to it nor to lme."""
    path = Path(given) if _last(key) in _PATHS and os.path.exists(given) else _path_of(key, given)  # noqa: PTH110
    if path is None or _is_shipped(path) or trust.is_trusted(directory):
        return
    if not path.resolve().is_relative_to(directory.resolve()):
        raise trust.UntrustedError(
            f"{directory}: its {key} is {given}, of which it holds no copy: "
            f"add {trust.FLAG} to read that file, if you trust whoever made the run"
        )


def _is_shipped(path: Path) -> bool:
    here = path.resolve()
    return any(here.is_relative_to(resource_dir(name).resolve()) for name in ("conf", "maps"))


def _is_importable(each: Input) -> bool:
    """Whether today's Python finds the sources of a run's own code where they were."""
    sources = {file.source for file in each.files.values()}
    tops = {name.partition("/")[0].removesuffix(".py") for name in each.files}
    specs = [PathFinder.find_spec(top, None) for top in tops]
    return all(spec is not None and (spec.origin is None or spec.origin in sources) for spec in specs)


def _check_loaded(each: Input) -> None:
    """Raise InputError if another version of a run's own code is loaded, as that of the run before."""
    for name, file in each.files.items():
        module = sys.modules.get(name.removesuffix(".py").removesuffix("/__init__").replace("/", "."))
        origin = getattr(module, "__file__", None)
        if origin and not (_is_regular(Path(origin)) and _sha_of(Path(origin)) == file.copy):
            raise InputError(
                f"{Path(file.source).name}: two versions of it are asked for: give the runs one at a time"
            )


def _is_same(file: InputFile) -> bool:
    """Whether a source is today what it was."""
    path = Path(file.source)
    with suppress(OSError, ValueError):
        return _is_regular(path) and path.stat().st_size == file.size and _sha_of(path) == file.sha256
    return False


def _is_regular(path: Path) -> bool:
    try:
        return stat.S_ISREG(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def _sha_of(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _sha(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _last(key: str) -> str:
    return key.rpartition(".")[2]


def _listed(names: Sequence[str]) -> str:
    """The first few names, and the number of the others."""
    return ", ".join([*names[:8], *([f"{len(names) - 8} more"] if len(names) > 8 else [])])
