"""Tensors of a TensorFlow V2 checkpoint, read without TensorFlow.

PREFIX.index is a LevelDB table of BundleEntryProto messages by tensor name; PREFIX.data-00000-of-00001 holds the
raw tensors. Source: tensorflow/core/protobuf/tensor_bundle.proto.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import read_bytes
from lme.inputs.protobuf import fields
from lme.planners.dclp import leveldb
from lme.planners.dclp.kernels.crc32c import crc32c

INDEX, SHARD = ".index", ".data-00000-of-00001"
_SIZE_MAX = 64 * 2**20  # [bytes] of either file; the published checkpoint has 1.8 MB
_FLOAT = 1  # DT_FLOAT
_LITTLE = 0


class BundleEntry(NamedTuple):
    """Position of a tensor in the shard. dtype: TensorFlow's number; offset, size [bytes]; crc: masked."""

    dtype: int
    shape: tuple[int, ...]
    shard: int
    offset: int
    size: int
    crc: int


def read_entries(prefix: Path) -> dict[str, BundleEntry]:
    """Return the entries of PREFIX.index by tensor name. Raises InputError, naming the file, if wrong or damaged."""
    path = Path(f"{prefix}{INDEX}")
    found: dict[str, BundleEntry] = {}
    try:
        for key, value in leveldb.entries(_read(path), str(path)):
            if key:
                found[key.decode()] = _entry(value)
            else:
                _check_header(value)
    except ValueError as error:
        raise (
            error if isinstance(error, InputError) else InputError(f"{path}: is damaged ({error})")
        ) from None
    return found


def read_tensors(prefix: Path, entries: dict[str, BundleEntry]) -> dict[str, NDArray[np.float32]]:
    """Return the values of the tensors in PREFIX's shard, flat, each with its checksum verified.

    Raises InputError, naming file and tensor, also for a tensor that is not float32.
    """
    path = Path(f"{prefix}{SHARD}")
    data = _read(path)
    return {name: _tensor(data, entry, f"{path}: {name}") for name, entry in entries.items()}


def _tensor(data: bytes, entry: BundleEntry, place: str) -> NDArray[np.float32]:
    if entry.dtype != _FLOAT or entry.shard != 0 or entry.size != 4 * math.prod(entry.shape):
        raise InputError(f"{place}: must be float32, in one shard, and as large as its shape {entry.shape}")
    if entry.offset + entry.size > len(data):
        raise InputError(f"{place}: lies beyond the end of the file, which has {len(data)} bytes")
    raw = data[entry.offset : entry.offset + entry.size]
    if leveldb.masked(crc32c(raw)) != entry.crc:
        raise InputError(f"{place}: its checksum is wrong: the file is damaged")
    return np.frombuffer(raw, "<f4").astype(np.float32)


def _read(path: Path) -> bytes:
    try:
        return read_bytes(path, _SIZE_MAX)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def _check_header(message: bytes) -> None:
    """Raise ValueError unless the bundle has one shard and is little-endian."""
    header = dict(fields(message))
    if header.get(1, 0) != 1 or header.get(2, _LITTLE) != _LITTLE:
        raise ValueError("a checkpoint must have one shard and be little-endian")


def _entry(message: bytes) -> BundleEntry:
    entry = dict(fields(message))
    if 7 in entry:
        raise ValueError("a tensor is cut into slices")
    numbers = [entry.get(field, 0) for field in (1, 3, 4, 5, 6)]
    shape = entry.get(2, memoryview(b""))
    if isinstance(shape, int) or not all(isinstance(number, int) for number in numbers):
        raise ValueError("an entry is malformed")
    dtype, shard, offset, size, crc = (int(number) for number in numbers)
    return BundleEntry(dtype, _shape(shape), shard, offset, size, crc)


def _shape(message: memoryview) -> tuple[int, ...]:
    """Sizes in a TensorShapeProto."""
    sizes = []
    for field, dimension in fields(message):
        if field == 2 and not isinstance(dimension, int):
            size = dict(fields(dimension)).get(1, 0)
            if not isinstance(size, int):
                raise ValueError("a shape is malformed")
            sizes.append(size)
    return tuple(sizes)
