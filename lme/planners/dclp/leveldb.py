"""Entries of a LevelDB table, the format of a TensorFlow checkpoint's index.

Source: LevelDB's doc/table_format.md. Every block has a checksum, so damage is found.
"""

from __future__ import annotations

from collections.abc import Iterator

from lme.errors import InputError
from lme.inputs.protobuf import varint
from lme.planners.dclp.kernels.crc32c import crc32c

_FOOTER, _HANDLES = 48, 40  # [bytes]
_MAGIC = 0xDB4775248B80FB57
_TRAILER = 5  # [bytes] type and checksum after each block
_PLAIN = 0  # type of a block that is not compressed
_MASK_DELTA = 0xA282EAD8


def entries(data: bytes, place: str) -> Iterator[tuple[bytes, bytes]]:
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
