"""Import of the network that DRL-DCLP's authors published: a TensorFlow checkpoint, checked and reduced.

A TensorFlow V2 checkpoint is read without TensorFlow. PREFIX.index is a LevelDB table of BundleEntryProto messages by
tensor name; PREFIX.data-00000-of-00001 holds the raw tensors. Every block and every tensor has a checksum, so damage is
found. Sources: tensorflow/core/protobuf/tensor_bundle.proto, LevelDB's doc/table_format.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import read_bytes
from lme.inputs.onnx_file import TRAINED, Shape
from lme.inputs.onnx_graph import check_finite
from lme.inputs.protobuf import fields, varint
from lme.planners.dclp.weights import LAYERS, REPORTED, SHAPES, SIGNATURE

_POLICY = "main/pi"  # the scope of the policy; the checkpoint also has critics and target networks
_CHECKPOINT_LAYERS = ("conv1d", "conv1d_1", "conv1d_2", "dense", "dense_1", "dense_2", "dense_3", "dense_4")
# What the network was trained for: the authors' training script. Half widths are at most (front + rear) / 2.
_PUBLISHED = {
    "v_max": (0.3, 2.0),
    "omega_max": (math.pi / 6, 2 * math.pi),
    "alpha_v": (0.5, 5.0),
    "alpha_omega": (math.pi / 6, 2 * math.pi),
    "front": (0.075, 0.6),
    "rear": (0.075, 0.6),
    "half_width": (0.075, 0.6),
}

# A checkpoint's files, and the bundle of tensors in them.
INDEX, SHARD = ".index", ".data-00000-of-00001"
_ENDINGS = (INDEX, SHARD, ".meta")
_SIZE_MAX = 64 * 2**20  # [bytes] of either file; the published checkpoint has 1.8 MB
_FLOAT = 1  # DT_FLOAT
_LITTLE = 0
# The index, a LevelDB table.
_FOOTER, _HANDLES = 48, 40  # [bytes]
_MAGIC = 0xDB4775248B80FB57
_TRAILER = 5  # [bytes] type and checksum after each block
_PLAIN = 0  # type of a block that is not compressed
_MASK_DELTA = 0xA282EAD8
_POLYNOMIAL = 0x82F63B78  # Castagnoli, bits reversed (RFC 3720, appendix B.4)


def tensor_names() -> dict[str, str]:
    """Return the checkpoint's name of every array of `SHAPES`."""
    names = {"alpha": f"{_POLICY}/Variable"}
    for ours, theirs in zip(LAYERS, _CHECKPOINT_LAYERS, strict=True):
        names |= {f"{ours}.{part}": f"{_POLICY}/{theirs}/{part}" for part in ("kernel", "bias")}
    return names


def import_checkpoint(path: Path) -> dict[str, NDArray[np.float32]]:
    """Return the policy's weights in a TensorFlow V2 checkpoint: the arrays of `SHAPES` and `TRAINED`.

    path: as for `read_policy`, whose errors are raised.
    """
    weights = read_policy(path, tensor_names(), SHAPES, SIGNATURE.what)
    return {**weights, TRAINED: np.array([_PUBLISHED[key] for key in REPORTED], np.float32)}


def read_policy(
    path: Path, names: Mapping[str, str], shapes: Mapping[str, Shape], what: str
) -> dict[str, NDArray[np.float32]]:
    """Return arrays of these shapes, by our names, from a TensorFlow V2 checkpoint.

    path: the common prefix of the checkpoint's files, or one of them. names: of the tensors, by our names. Every
    tensor's checksum is verified, also those of the critics. Raises InputError, naming file and tensor.
    """
    prefix = checkpoint_prefix(path)
    entries = read_entries(prefix)
    for name, tensor in names.items():
        # Kernels of convolutions have an axis of length 1 in the checkpoint.
        convolution = name.startswith("convolution") and name.endswith("kernel")
        wanted = (1, *shapes[name]) if convolution else shapes[name]
        found = entries[tensor].shape if tensor in entries else None
        if found != wanted:
            state = "is missing" if found is None else f"has the shape {found}"
            raise InputError(
                f"{prefix}{INDEX}: {tensor} {state}: {what} has one of {wanted}; is this its checkpoint?"
            )
    # Read and verify everything, but keep only the arrays of the policy.
    tensors = read_tensors(prefix, entries)
    check_finite({tensor: tensors[tensor] for tensor in names.values()}, f"{prefix}{SHARD}")
    return {name: tensors[tensor].reshape(shapes[name]) for name, tensor in names.items()}


def checkpoint_prefix(path: Path) -> Path:
    """Return the common prefix of a checkpoint's files, given the prefix or the path of one of them."""
    for ending in _ENDINGS:
        if path.name.endswith(ending):
            return path.with_name(path.name.removesuffix(ending))
    return path


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
        for key, value in _table_entries(_read(path), str(path)):
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
    if masked(crc32c(raw)) != entry.crc:
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


def _table_entries(data: bytes, place: str) -> Iterator[tuple[bytes, bytes]]:
    """Keys and values of a table in its order. Raises InputError, which begins with `place`."""
    if len(data) < _FOOTER or int.from_bytes(data[-8:], "little") != _MAGIC:
        raise InputError(
            f"{place}: is not a LevelDB table, as the index of a TensorFlow V2 checkpoint must be"
        )
    footer = data[-_FOOTER : -_FOOTER + _HANDLES]
    try:
        _, at = _handle(footer, 0)
        index, _ = _handle(footer, at)
        for _, value in _block(data, index):
            yield from _block(data, _handle(value, 0)[0])
    except ValueError as error:
        raise InputError(f"{place}: is damaged ({error})") from None


def masked(crc: int) -> int:
    """Return a checksum in its stored form, which keeps checksums of data with checksums from being trivial."""
    return (((crc >> 15) | (crc << 17)) + _MASK_DELTA) & 0xFFFFFFFF


def _handle(data: bytes, at: int) -> tuple[tuple[int, int], int]:
    """Offset and size of a block, and the position after them."""
    offset, at = varint(data, at)
    size, at = varint(data, at)
    return (offset, size), at


def _block(data: bytes, handle: tuple[int, int]) -> Iterator[tuple[bytes, bytes]]:
    """Keys and values of one block. A key repeats the beginning of the key before it."""
    block = _checked(data, *handle)
    restarts = int.from_bytes(block[-4:], "little")
    end = len(block) - 4 * (restarts + 1)
    if len(block) < 4 or end < 0:
        raise ValueError("a block has no end")
    key, at = b"", 0
    while at < end:
        shared, at = varint(block, at)
        fresh, at = varint(block, at)
        length, at = varint(block, at)
        stop = at + fresh + length
        if shared > len(key) or stop > end:
            raise ValueError("an entry is longer than its block")
        key = key[:shared] + block[at : at + fresh]
        yield key, block[at + fresh : stop]
        at = stop


def _checked(data: bytes, offset: int, size: int) -> bytes:
    """Return the content of a block, with its checksum verified."""
    end = offset + size
    trailer = data[end : end + _TRAILER]
    if len(trailer) < _TRAILER:
        raise ValueError("a block is cut off")
    if masked(crc32c(data[offset : end + 1])) != int.from_bytes(trailer[1:], "little"):
        raise ValueError("the checksum of a block is wrong")
    if trailer[0] != _PLAIN:
        raise ValueError("its blocks are compressed, which TensorFlow's checkpoints are not")
    return data[offset:end]


def _table() -> NDArray[np.uint32]:
    """Return the effect of each byte on the checksum: (256,)."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(_POLYNOMIAL), table >> 1).astype(np.uint32)
    return table


_TABLE = _table()


def crc32c(data: bytes) -> int:
    """Checksum of `data`, as in RFC 3720."""
    return int(_crc32c(np.frombuffer(data, np.uint8)))


@njit(cache=True)
def _crc32c(data: NDArray[np.uint8]) -> np.uint32:
    crc = np.uint32(0xFFFFFFFF)
    for byte in data:
        crc = _TABLE[(crc ^ byte) & np.uint32(0xFF)] ^ (crc >> np.uint32(8))
    return crc ^ np.uint32(0xFFFFFFFF)
