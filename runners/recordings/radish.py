"""Maps of ten real buildings, from the corrected CARMEN logs of Radish in github.com/acschaefer/ple."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from lme.errors import InputError
from lme.inputs.guarded_file import LOG_BYTES, read_bytes
from runners.config.quoting import element, lme_command
from runners.recordings.map_build import ENDING, BuildConfig, build_map, check_target, describe, write_map

CHECKOUT = Path("data/carmen")  # where the logs lie in a checkout
SUFFIX = "-corrected.log.gz"  # of a log's file name, after the building's name
DIGESTS = {  # SHA-256 of the logs at commit cfcb5a7 of acschaefer/ple
    "acapulco": "fbd19a018534dee751606a9520fd6be25c86f3d7f1f7d849b1834d047b330116",
    "aces": "5434d44384166250608a64d3a8c32de84512f82c46cb60a2657f138592024569",
    "belgioioso": "a130e3e6d9e5ec5e6a7f94cbb5cb6bca2df2626c7ed6bebb7b7a282253b10f6e",
    "csail": "a98de24fc319651f231f9a8625b78bf1972312b86f7b00d2ddc979c4ac92ae2d",
    "edmonton": "96599a91e0cc9cb2570dbb92f92bbdf1e3a405b16aa99f6d3ce1a703011befdb",
    "freiburg-079": "0631d30baf4b9d1d209af47da9096e876e1b4cb3d5a2d68ef9c39c5a2360a466",
    "freiburg-101": "7792de88bcb050f8edba92914aea75e8ec2fb73b483c01903bd2753aa655e982",
    "intel": "71bef16e9926506cf7417995ef35ace09dbd5de067fd042a3aab85188b5480dc",
    "orebro": "39a189c64489b84996669bc484d6bd6864f8733029a280a0e549a0adaae08a82",
    "seattle": "5719198036b788d78a877ca04efdbfb07c2518508310f51d49c198bf1956bb4b",
}


def build_all(source: Path, destination: Path, overwrite: bool) -> None:
    """Build the map of every building whose log is in `source` in the folder `destination`; print a line for each.

    Raises InputError if there are no logs, one is not the published file, or a map exists and `overwrite` is false.
    Everything is checked before the first map is built.
    """
    logs = dict(_logs(source))
    if not logs:
        raise InputError(
            f"{source}: has no logs of these buildings, such as intel{SUFFIX}: must be a checkout of "
            f"github.com/acschaefer/ple, or a folder with the files of its {CHECKOUT}"
        )
    for name, log in logs.items():
        _check_digest(name, log)
        check_target(_target(destination, name), overwrite)
    for name, log in logs.items():
        built = build_map([log], BuildConfig())
        write_map(built, _target(destination, name))
        print(f"{name:<14}{describe(built)}")
    missing_logs = [name for name in DIGESTS if name not in logs]
    if missing_logs:
        print(f"left out, without a log: {', '.join(missing_logs)}")
    paths = f"map.paths=[{element(str(destination))}]"
    print(f"Drive in them: {lme_command('eval', 'map=building', paths, 'robot=turtlebot2')}")


def _logs(source: Path) -> Iterator[tuple[str, Path]]:
    """Yield the known buildings whose logs are in a checkout or a folder."""
    if not source.is_dir():
        raise InputError(f"{source}: {'is not a folder' if source.exists() else 'no such folder'}")
    folder = source / CHECKOUT if (source / CHECKOUT).is_dir() else source
    for name in DIGESTS:
        if (folder / f"{name}{SUFFIX}").is_file():
            yield name, folder / f"{name}{SUFFIX}"


def _check_digest(name: str, log: Path) -> None:
    try:
        digest = hashlib.sha256(read_bytes(log, LOG_BYTES)).hexdigest()
    except OSError as error:
        raise InputError(f"{log}: cannot be read ({error.strerror})") from error
    if digest != DIGESTS[name]:
        raise InputError(
            f"{log}: its SHA-256 is {digest}: must be {DIGESTS[name]}, that of the published file; "
            "for a log of your own: lme maps build"
        )


def _target(destination: Path, name: str) -> Path:
    return destination / f"{name}{ENDING}"
