"""Pack arrays into short text: byte planes, gzip, base64; `assets/data.js` unpacks it.

Bytes of equal significance are stored together ("shuffled"), since neighbouring numbers share their high bytes.
Layout before gzip: length of the header [uint32], the header as JSON, the arrays one after another.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_WHOLE = ("<i1", "<i2", "<i4")


class Packer:
    """A collection of named arrays. `arrays` in the header gives type, first byte, count and differences of each."""

    def __init__(self) -> None:
        self._directory: dict[str, tuple[str, int, int, bool]] = {}
        self._planes: list[bytes] = []
        self._size = 0

    def add_doubles(self, name: str, values: Any) -> None:
        """Add numbers in double precision."""
        self._add(name, np.asarray(values, dtype="<f8"), False)

    def add_singles(self, name: str, values: Any) -> None:
        """Add numbers that are only drawn, in single precision."""
        self._add(name, np.asarray(values, dtype="<f4"), False)

    def add_integers(self, name: str, values: Any, differences: bool = False) -> None:
        """Add integers in the smallest type that holds them. differences: store differences of neighbours."""
        numbers = np.asarray(values, dtype=np.int64).ravel()
        if differences:
            numbers = np.diff(numbers, prepend=0)
        kind = next(kind for kind in _WHOLE if kind == _WHOLE[-1] or _fits(numbers, kind))
        self._add(name, numbers.astype(kind), differences)

    def add_bits(self, name: str, values: Any) -> None:
        """Add truth values, eight in a byte, the first in its lowest bit."""
        self._add(name, np.packbits(values, bitorder="little"), False)

    def add_counts(self, name: str, rows: Sequence[Sequence[Any] | NDArray[Any]]) -> None:
        """Add the number of entries that each step has in the array `name`."""
        self.add_integers(f"{name}.count", [len(row) for row in rows])

    def text(self, header: Mapping[str, Any]) -> str:
        """Return the header and all arrays, compressed and in base64; equal arrays give equal text."""
        return base64.b64encode(gzip.compress(self.raw(header), 6, mtime=0)).decode("ascii")

    def raw(self, header: Mapping[str, Any]) -> bytes:
        """Return the header and all arrays."""
        head = json.dumps({**header, "arrays": self._directory}, ensure_ascii=False, allow_nan=False).encode()
        return b"".join([len(head).to_bytes(4, "little"), head, *self._planes])

    def _add(self, name: str, values: NDArray[Any], differences: bool) -> None:
        flat = np.ascontiguousarray(values).ravel()
        planes = flat.view(np.uint8).reshape(len(flat), flat.itemsize).T.tobytes()
        self._directory[name] = (flat.dtype.str[-2:], self._size, len(flat), differences)
        self._planes.append(planes)
        self._size += len(planes)


def _fits(numbers: NDArray[np.int64], kind: str) -> bool:
    limits = np.iinfo(kind)
    return not len(numbers) or bool(limits.min <= numbers.min() and numbers.max() <= limits.max)
