"""Reader of the published BARN files: `world_N.world` (SDF) and `path_files/path_N.npy`.

Files are not trusted: XML entities are rejected, pickles are never loaded, sizes are limited.
"""

from __future__ import annotations

import math
import re
import warnings
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring
from numpy.lib import format as npy

from lme.errors import InputError
from lme.inputs.guarded_file import expanded, read_bytes
from lme.types import Floats, Ints
from lme.worlds.barn.generator import GRID_CELLS, start_wall

WORLD_FILES = re.compile(r"world_(0|[1-9]\d*)\.world")

_LAYOUTS = ("", "BARN", "worlds/BARN", "jackal_helper/worlds/BARN")
_GROUND = {"model://ground_plane", "model://sun"}
_WORLD_BYTES = 16 * 2**20  # a published world has at most 0.8 MB
_SAME_PLACE_M = 1e-3
_PATH_BYTES = 2**16  # a published path has at most 1.1 kB


def find_worlds(source: str | Path) -> dict[int, Path]:
    """The world files by number, in order. source: an official checkout, its `worlds/` or its `BARN/` folder."""
    root = expanded(source)
    try:
        state = "" if root.is_dir() else "is a file" if root.exists() else "does not exist"
    except OSError as error:
        raise InputError(f"map.source {root!s:.80}: cannot be read ({error.strerror})") from error
    if state:
        raise InputError(f"map.source {root} {state}: must be a folder with the BARN files world_N.world")
    for layout in _LAYOUTS:
        files = {
            int(match[1]): path
            for path in _entries(root / layout)
            if (match := WORLD_FILES.fullmatch(path.name)) is not None
        }
        if files:
            return dict(sorted(files.items()))
    raise InputError(
        f"map.source {root} holds no world_N.world: must be a checkout of the BARN benchmark, "
        "its worlds/ or its BARN/ folder"
    )


def path_file(world_file: Path) -> Path:
    """The file in which the benchmark keeps the path of a world."""
    return world_file.parent / "path_files" / f"path_{world_file.stem.removeprefix('world_')}.npy"


def read_world(file: Path) -> Floats:
    """(C, 3) cylinders [x, y, radius] [m] of a published world, in the order of the file.

    Raises InputError that names the file unless it is a BARN world: vertical cylinders, including the wall of
    the start area.
    """
    root = _parsed(file)
    world = root.find("world") if root.tag == "sdf" else None
    if world is None:
        raise InputError(f"{file} is not a BARN world: <sdf><world> is missing")
    for uri in world.iterfind("include/uri"):
        if (uri.text or "").strip() not in _GROUND:
            raise InputError(f"{file} is not a BARN world: it includes {(uri.text or '').strip()!r}")
    discs = [disc for model in world.iterfind("model") for disc in _model_discs(file, model)]
    cylinders = np.array(discs, dtype=np.float64).reshape(-1, 3)
    _check_is_barn(file, cylinders)
    return cylinders


def read_path(file: Path) -> Ints:
    """(K, 2) cells [row, column] of a published path. Raises InputError that names the file if it is not one."""
    _read_limited(file, _PATH_BYTES)
    try:
        # Mapping compares the shape in the header with the size of the file before memory is allocated.
        with warnings.catch_warnings(action="ignore"):
            array = np.array(npy.open_memmap(file, mode="r"))
    except Exception as error:  # a damaged header raises many kinds of errors, also those of Python's parser
        raise InputError(f"{file} is not a readable .npy array of integers: {_one_line(error)}") from None
    if array.dtype.kind not in "iu" or array.ndim != 2 or array.shape[1] != 2 or len(array) < 2:
        raise InputError(
            f"{file} holds {array.dtype} of shape {array.shape}: must be integer cells, shape (K, 2)"
        )
    if array.min() < 0 or array.max() >= GRID_CELLS:
        raise InputError(
            f"{file} has cells from {array.min()} to {array.max()}: must lie in 0…{GRID_CELLS - 1}"
        )
    cells = array.astype(np.int64)
    if np.abs(np.diff(cells, axis=0)).max() > 1 or (cells[0] == cells[-1]).all():
        raise InputError(
            f"{file} is not a path: each cell must be next to the one before, and the ends must differ"
        )
    return cells


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir()) if folder.is_dir() else []
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror}") from None


def _read_limited(file: Path, max_bytes: int) -> bytes:
    """The content of a regular file of at most `max_bytes`. Raises InputError."""
    try:
        return read_bytes(file, max_bytes)
    except FileNotFoundError:
        raise InputError(f"{file} does not exist") from None
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None


def _parsed(file: Path) -> Element:
    content = _read_limited(file, _WORLD_BYTES)
    try:
        root: Element = fromstring(content, forbid_dtd=True)
    except DefusedXmlException as error:
        raise InputError(
            f"{file} is rejected because it defines entities or a DTD: {_one_line(error)}"
        ) from None
    except (ParseError, ValueError, LookupError, RecursionError) as error:
        raise InputError(f"{file} is not XML or is truncated: {_one_line(error)}") from None
    return root


def _model_discs(file: Path, model: Element) -> list[tuple[float, float, float]]:
    """(x, y, radius) [m] of a model's collision bodies, without visual bodies and the ground."""
    name = model.get("name", "")
    bodies = [body for body in model.iter("collision") if body.find("geometry/plane") is None]
    x, y = _planar_pose(file, name, model) if bodies else (0.0, 0.0)
    for part in (*model.iter("link"), *bodies):
        if part.find("pose") is not None and any(_numbers(file, name, part)):
            raise InputError(f"{file} is not a BARN world: a part of model {name!r} has its own pose")
    return [(x, y, _radius(file, name, body)) for body in bodies]


def _planar_pose(file: Path, name: str, model: Element) -> tuple[float, float]:
    x, y, _, roll, pitch, _ = _numbers(file, name, model)
    if roll or pitch:
        raise InputError(f"{file} is not a BARN world: model {name!r} does not stand upright")
    return x, y


def _numbers(file: Path, name: str, part: Element) -> list[float]:
    """The six numbers of the first pose [m, rad]; all zero if there is none, as in SDF."""
    text = part.findtext("pose", "0 0 0 0 0 0")
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != 6 or not all(math.isfinite(value) for value in values):
        raise InputError(
            f"{file}: pose of model {name!r} is {text.strip()!r:.80}: must be six finite numbers"
        )
    return values


def _radius(file: Path, name: str, body: Element) -> float:
    text = body.findtext("geometry/cylinder/radius")
    if text is None:
        raise InputError(
            f"{file} is not a BARN world: model {name!r} has a collision body that is not a cylinder"
        )
    try:
        radius = float(text)
    except ValueError:
        radius = math.nan
    if not 0 < radius < math.inf:
        raise InputError(
            f"{file}: radius of model {name!r} is {text.strip()!r:.80}: must be positive, in metres"
        )
    return radius


def _check_is_barn(file: Path, cylinders: Floats) -> None:
    """Raise InputError unless at least half of the wall of the start area exists: start and goal rely on it."""
    if len(cylinders) == 0:
        raise InputError(f"{file} is not a BARN world: it has no cylinders")
    from scipy.spatial import cKDTree  # slow to import, and not needed for worlds made from recipes

    wall = start_wall()
    gaps, _ = cKDTree(cylinders[:, :2]).query(wall[:, :2])
    standing = int(np.count_nonzero(gaps < _SAME_PLACE_M))
    if standing < len(wall) / 2:
        raise InputError(
            f"{file} is not a BARN world: of the {len(wall)} cylinders around the start it has only {standing}"
        )


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200]
