"""Check this installation, and print what a bug report needs.

Reads package metadata and imports none of the packages.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, metadata, version
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import lme
from lme import numba_cache
from lme.errors import InputError
from lme.requirements import DISTRIBUTION, declared, install
from runners.cli.help import texts
from runners.config.escaping import masked
from runners.records.atomic_write import obstacle
from runners.tracking.store import DEFAULT_URI, check_uri, sqlite_path
from runners.workers.executor import available_cores

EXAMPLES = (
    "lme doctor",
    "lme doctor > report.txt",
)
_MARK = "!"
_NOTES = f"""\
A line that begins with {_MARK} is a problem; the next line says what to do.
The exit status is 1 if there is a problem, else 0.
Call it in the folder where you call lme: outputs and the MLflow store are relative to it.
Nothing is written, sent or started. The report names your folders: read it before you publish it."""
OUTPUTS = Path("outputs")
WORKER_GB = 0.3  # memory of a worker process, with room to spare
_REINSTALL = "in a checkout: pip install --editable ."
_FOR_DEVELOPERS = {"dev", "docs"}
_EXTRA = re.compile(r'extra == "([\w-]+)"')


def main(argv: list[str]) -> int:
    """Print the report; return 1 if there is a problem."""
    title = (__doc__ or "").partition("\n")[0]
    argparse.ArgumentParser(prog="lme doctor", **texts(title, EXAMPLES, _NOTES)).parse_args(argv)
    lines = report()
    # Print two columns, with advice below each problem, and the number of problems at the end.
    width = max(len(line.name) for line in lines)
    for line in lines:
        print(f"{_MARK if line.advice else ' '} {line.name.ljust(width)}  {line.found}")
        if line.advice:
            print(f"{' ' * (width + 4)}{line.advice}")
    problems = sum(bool(line.advice) for line in lines)
    print(f"\n{problems or 'No'} problem{'' if problems == 1 else 's'}.")
    return int(problems > 0)


class Line(NamedTuple):
    """One line of the report. advice: how to fix the problem; empty where there is none."""

    name: str
    found: str
    advice: str = ""


def report() -> list[Line]:
    """Return all lines: versions, extras, machine, folders."""
    packages = [_package(requirement) for requirement in needed()]
    extras = [_extra(name, requirements) for name, requirements in optional().items()]
    cores = Line("cores", f"{available_cores()} of {os.cpu_count()}, with a worker process on each")
    return [_lme(), _python(), *packages, *extras, cores, *_memory(), _numba(), _outputs(), _mlflow()]


def _lme() -> Line:
    description = f"{lme.__version__}, {Path(lme.__file__).parent}"
    installed = _version(DISTRIBUTION)
    if installed is None:
        return Line(
            "lme", description, f"{DISTRIBUTION} is not installed, so what it needs is unknown; {_REINSTALL}"
        )
    if installed != lme.__version__:
        return Line("lme", description, f"the installed metadata is of {installed}; {_REINSTALL}")
    return Line("lme", description)


def _python() -> Line:
    description = f"{platform.python_version()}, {platform.platform()}, {sys.executable}"
    try:
        specifier = metadata(DISTRIBUTION)["Requires-Python"]
    except PackageNotFoundError:
        specifier = ""
    is_supported = SpecifierSet(specifier).contains(platform.python_version(), prereleases=True)
    return Line(
        "Python",
        description,
        "" if is_supported else f"must be {specifier}: make an environment with such a Python",
    )


def _package(needed: Requirement) -> Line:
    version = _version(needed.name)
    is_suitable = version is not None and needed.specifier.contains(version, prereleases=True)
    return Line(needed.name, version or "missing", "" if is_suitable else install(needed.name))


def _extra(name: str, needed: Sequence[Requirement]) -> Line:
    """Describe an extra. It is no problem if it is not installed, but it is one if its version is unsuitable."""
    versions_by_name = {requirement.name: _version(requirement.name) for requirement in needed}
    label, names = f"extra {name}", [requirement.name for requirement in needed]
    if None in versions_by_name.values():
        return Line(label, f"no; {install(*names)}")
    are_suitable = all(
        requirement.specifier.contains(str(versions_by_name[requirement.name]), prereleases=True)
        for requirement in needed
    )
    versions = ", ".join(f"{package} {version}" for package, version in versions_by_name.items())
    return Line(label, f"yes, {versions}", "" if are_suitable else install(*names))


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _memory(meminfo: Path = Path("/proc/meminfo")) -> list[Line]:
    """Return total and available memory; an empty list where the system does not report them."""
    try:
        fields = dict(line.split(":") for line in meminfo.read_text().splitlines())
        total, free = (int(fields[name].split()[0]) / 2**20 for name in ("MemTotal", "MemAvailable"))
    except (OSError, KeyError, ValueError):
        return []
    max_workers = max(int(free / WORKER_GB), 1)
    advice = f"little for {available_cores()} worker processes: try executor.workers={max_workers}"
    enough = max_workers >= available_cores()
    return [Line("memory", f"{total:.1f} GB, {free:.1f} GB available", "" if enough else advice)]


def _numba() -> Line:
    folder = numba_cache.folder(numba_cache.FIRST_STEP)
    if not _is_writable(folder):
        return Line("Numba cache", f"{folder}, not writable", "set NUMBA_CACHE_DIR to a folder that you own")
    warm = "warm" if _version("numba") and numba_cache.compiled() else "cold: the first episode compiles"
    return Line("Numba cache", f"{folder}, writable, {warm}")


def _outputs() -> Line:
    directory = OUTPUTS.absolute()
    if _is_writable(directory):
        return Line("outputs", f"{directory}, writable")
    return Line(
        "outputs", f"{directory}, not writable", "call lme in a folder that you own, or set hydra.run.dir=DIR"
    )


def _mlflow() -> Line:
    uri = os.environ.get("MLFLOW_TRACKING_URI", DEFAULT_URI)
    try:
        check_uri("MLFLOW_TRACKING_URI", uri)
    except InputError:
        advice = f"MLFLOW_TRACKING_URI must be a database or a server, such as {DEFAULT_URI}"
        return Line("MLflow store", masked(uri), advice)
    path = sqlite_path(uri)
    if path is None:
        return Line("MLflow store", f"{masked(uri)}, not asked")
    path = path.absolute()
    if obstacle(path) is None:
        return Line("MLflow store", f"{path}, writable")
    return Line(
        "MLflow store", f"{path}, not writable", "set MLFLOW_TRACKING_URI to another store, or tracking=none"
    )


def _is_writable(folder: Path) -> bool:
    """Return whether files can be made in `folder`, which may have to be created first."""
    return obstacle(folder / "file") is None


def needed() -> list[Requirement]:
    """Return the requirements of every installation; none if lme is not installed."""
    return [requirement for requirement in map(Requirement, declared()) if requirement.marker is None]


def optional() -> dict[str, list[Requirement]]:
    """Return the packages of each extra by its name, without the extras for developers."""
    extras: dict[str, list[Requirement]] = {}
    for requirement in map(Requirement, declared()):
        extra = _EXTRA.search(str(requirement.marker))
        if extra and extra[1] not in _FOR_DEVELOPERS:
            extras.setdefault(extra[1], []).append(requirement)
    return extras
