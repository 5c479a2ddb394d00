"""Fields of protocol buffers, the format inside ONNX files and TensorFlow checkpoints.

Source: protobuf.dev/programming-guides/encoding.
"""

from __future__ import annotations

from collections.abc import Iterator

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5  # wire types
_VARINT_MAX = 10  # [bytes] of 64 bits
_TAG_BITS = 0xFFFFFFFF  # of a tag; other readers drop those above


def varint(data: bytes | memoryview, at: int) -> tuple[int, int]:
    """Read the varint at `at`; return it and the position after it. Raises ValueError if it is cut off."""
    number = 0
    for i in range(_VARINT_MAX):
        if at + i >= len(data):
            break
        byte = data[at + i]
        number |= (byte & 0x7F) << (7 * i)
        if byte < 0x80:
            return number, at + i + 1
    raise ValueError("a number is cut off")


def fields(message: bytes | memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Yield the numbers and values of a message's fields. Raises ValueError if it is malformed or cut off."""
    message = memoryview(message)
    at = 0
    while at < len(message):
        tag, at = varint(message, at)
        number, kind = (tag & _TAG_BITS) >> 3, tag & 7
        if kind == _VARINT:
            value, at = varint(message, at)
            yield number, value
            continue
        if kind not in (_FIXED64, _BYTES, _FIXED32):
            raise ValueError("an entry is malformed")
        size = 8 if kind == _FIXED64 else 4
        if kind == _BYTES:
            size, at = varint(message, at)
        raw, at = message[at : at + size], at + size
        if at > len(message):
            raise ValueError("an entry is cut off")
        yield number, raw if kind == _BYTES else int.from_bytes(raw, "little")
