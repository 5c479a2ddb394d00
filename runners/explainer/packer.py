"""Arrays in as few characters as they allow: byte planes, gzip, base64; `assets/data.js` undoes it.

Bytes of equal weight stand together ("shuffled"), since those at the top of neighbouring numbers agree.
Layout before gzip: length of the header [uint32], the header as JSON, the arrays one after the other.
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
    """Collects named arrays. The header's `arrays` says of each: type, first byte, count, differences."""

    def __init__(self) -> None:
        self._directory: dict[str, tuple[str, int, int, bool]] = {}
        self._planes: list[bytes] = []
        self._size = 0

    def exact(self, name: str, values: Any) -> None:
        """Numbers to the last bit."""
        self._add(name, np.asarray(values, dtype="<f8"), False)

    def drawn(self, name: str, values: Any) -> None:
        """Numbers that are only looked at: single precision."""
        self._add(name, np.asarray(values, dtype="<f4"), False)

    def whole(self, name: str, values: Any, differences: bool = False) -> None:
        """Whole numbers in the smallest type that holds them; `differences` where neighbours are alike."""
        numbers = np.asarray(values, dtype=np.int64).ravel()
        if differences:
            numbers = np.diff(numbers, prepend=0)
        kind = next(kind for kind in _WHOLE if kind == _WHOLE[-1] or _fits(numbers, kind))
        self._add(name, numbers.astype(kind), differences)

    def counts(self, name: str, rows: Sequence[Sequence[Any] | NDArray[Any]]) -> None:
        """How many entries each step has of what is stored as `name`."""
        self.whole(f"{name}.count", [len(row) for row in rows])

    def text(self, header: Mapping[str, Any]) -> str:
        """All of it, in base64; the same characters for the same arrays."""
        head = json.dumps({**header, "arrays": self._directory}, ensure_ascii=False, allow_nan=False).encode()
        raw = b"".join([len(head).to_bytes(4, "little"), head, *self._planes])
        return base64.b64encode(gzip.compress(raw, 6, mtime=0)).decode("ascii")

    def _add(self, name: str, values: NDArray[Any], differences: bool) -> None:
        flat = np.ascontiguousarray(values).ravel()
        planes = flat.view(np.uint8).reshape(len(flat), flat.itemsize).T.tobytes()
        self._directory[name] = (flat.dtype.str[-2:], self._size, len(flat), differences)
        self._planes.append(planes)
        self._size += len(planes)


def _fits(numbers: NDArray[np.int64], kind: str) -> bool:
    limits = np.iinfo(kind)
    return not len(numbers) or bool(limits.min <= numbers.min() and numbers.max() <= limits.max)
