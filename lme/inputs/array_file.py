"""Untrusted .npz files of named float32 arrays."""

from __future__ import annotations

import lzma
import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import check_regular

Arrays = Mapping[str, NDArray[np.float32]]
Shape = tuple[int, ...]

_ENDING = ".npy"
_HEADER_MAX = 10_000  # [bytes] numpy's own limit
_DAMAGE = (
    zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, lzma.LZMAError, struct.error, tokenize.TokenError, EOFError,
    ValueError, RuntimeError, SyntaxError, OverflowError,
)  # fmt: skip


def write_arrays(arrays: Arrays, file: IO[bytes]) -> None:
    """Write the arrays as .npz. The same arrays give the same bytes."""
    # savez takes names as keywords; mypy cannot tell them from its own `allow_pickle`.
    np.savez(file, **{name: np.asarray(array, np.float32, order="C") for name, array in arrays.items()})  # type: ignore[arg-type]


def read_shapes(path: Path, what: str) -> dict[str, Shape]:
    """The shapes of all arrays in a file by their names; no array is created.

    what: whose weights the file should hold, for messages. Raises InputError, naming the file, if it is not an .npz.
    """
    with _opened(path, what) as archive:
        names = [name for name in archive.namelist() if name.endswith(_ENDING)]
        return {name.removesuffix(_ENDING): _shape(archive, name) for name in names}


def read_arrays(path: Path, shapes: Mapping[str, Shape], what: str) -> dict[str, NDArray[np.float32]]:
    """The arrays of these names and shapes in a file that `write_arrays` made; the file may hold others too.

    Raises InputError, naming file and array, for a file that cannot be read, arrays of other names, types or
    shapes, and values that are not finite. No array is created before its shape is known to be right.
    """
    with _opened(path, what) as archive:
        arrays = {name: _array(archive, name, shape, path, what) for name, shape in shapes.items()}
    check_finite(arrays, str(path))
    return arrays


def check_finite(arrays: Arrays, source: str) -> None:
    """Raise InputError, naming the array, for values that are not finite. source: the file, for messages."""
    for name, array in arrays.items():
        if not np.isfinite(array).all():
            raise InputError(f"{source}: {name} holds values that are not finite")


@contextmanager
def _opened(path: Path, what: str) -> Iterator[zipfile.ZipFile]:
    """Open the archive; any damage found while it is read raises InputError."""
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as archive:
            yield archive
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except _DAMAGE as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is not a weight file of {what}, an .npz ({error})") from None


def _shape(archive: zipfile.ZipFile, name: str) -> Shape:
    with archive.open(name) as member:
        return _header(member)[0]


def _header(member: IO[bytes]) -> tuple[Shape, bool, np.dtype[Any]]:
    """Read an array's shape, whether it is stored by columns, and its type."""
    np.lib.format.read_magic(member)
    return np.lib.format.read_array_header_1_0(member, max_header_size=_HEADER_MAX)


def _array(archive: zipfile.ZipFile, name: str, wanted: Shape, path: Path, what: str) -> NDArray[np.float32]:
    try:
        info = archive.getinfo(f"{name}{_ENDING}")
    except KeyError:
        raise InputError(
            f"{path}: {name} is missing: must hold the weights of {what}; lme weights import writes such a file"
        ) from None
    size = 4 * math.prod(wanted)
    if info.file_size > size + _HEADER_MAX or info.compress_type != zipfile.ZIP_STORED:
        raise InputError(
            f"{path}: {name} must be float32 {wanted}, not compressed, {size} bytes and a header"
        )
    with archive.open(info) as member:
        shape, by_columns, dtype = _header(member)
        if shape != wanted or dtype != np.dtype("<f4") or by_columns:
            raise InputError(f"{path}: {name} is {dtype} {shape}: must be float32 {wanted}")
        raw = member.read(size + 1)
    if len(raw) != size:
        raise InputError(f"{path}: {name} does not have the length of its shape {shape}")
    return np.frombuffer(raw, "<f4").reshape(shape).astype(np.float32)
