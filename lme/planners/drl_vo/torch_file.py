"""Tensors in a file that PyTorch saved (`torch.save` of a `state_dict`, PyTorch 1.6 or newer), without PyTorch.

Such a file is a zip: a pickle that describes the tensors, and their numbers. The pickle is read as data, with the
few operations of a `state_dict`; it cannot name any other function, and none of it is executed.
"""

from __future__ import annotations

import math
import pickletools
import struct
import zipfile
import zlib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

DAMAGE = (  # errors of zipfile and `TorchFile` for a damaged file, besides OSError
    zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, struct.error, EOFError, RuntimeError, ValueError,
    OverflowError, NotImplementedError, MemoryError,
)  # fmt: skip
PICKLE_MAX = 2**20  # [bytes] of the description; the published one has 20 kB
_NUMBERS_MAX = 2**28  # [bytes] of one tensor
_DICTIONARY, _TENSOR = "collections OrderedDict", "torch._utils _rebuild_tensor_v2"
_STORAGES = tuple(f"torch {kind}Storage" for kind in ("Float", "Double", "Half", "Long", "Int", "Bool"))
_FLOAT = _STORAGES[0]
_ITSELF = ("BINUNICODE", "BININT", "BININT1", "BININT2", "LONG1")  # opcodes that push their argument


class DamagedError(ValueError):
    """The file is not one that `torch.save` writes for a `state_dict`."""


class Storage(NamedTuple):
    """Numbers in the file. kind: their type, such as "torch FloatStorage"."""

    kind: str
    key: str


class Tensor(NamedTuple):
    """Part of a storage. offset, stride: in numbers."""

    storage: Storage
    offset: int
    shape: tuple[int, ...]
    stride: tuple[int, ...]


class TorchFile:
    """Saved `state_dict`. tensors: by name; `read` reads their numbers."""

    def __init__(self, archive: zipfile.ZipFile) -> None:
        """Open the file. Raises DamagedError or the errors of zipfile."""
        self._archive = archive
        pickles = [name for name in archive.namelist() if name.endswith("/data.pkl")]
        if len(pickles) != 1:
            raise DamagedError("holds no data.pkl: must be saved by PyTorch 1.6 or newer")
        self._folder = pickles[0].removesuffix("data.pkl")
        self.tensors = read_state(_member(archive, pickles[0], PICKLE_MAX))

    def read(self, name: str) -> NDArray[np.float32]:
        """Return a tensor's numbers. Raises DamagedError unless it is float32, complete and in order."""
        storage, offset, shape, stride = self.tensors[name]
        if storage.kind != _FLOAT:
            raise DamagedError(f"{name} is a {storage.kind}: must be float32")
        if not _in_order(shape, stride):
            raise DamagedError(f"{name} has the strides {stride}: must be contiguous")
        raw = _member(self._archive, f"{self._folder}data/{storage.key}", _NUMBERS_MAX)
        count = math.prod(shape)
        if len(raw) % 4 or offset + count > len(raw) // 4:
            raise DamagedError(f"{name} is longer than its numbers")
        return np.frombuffer(raw, "<f4", count, 4 * offset).reshape(shape).astype(np.float32)


def read_state(data: bytes) -> dict[str, Tensor]:
    """Return the tensors that the pickle of a `state_dict` describes. Raises DamagedError."""
    try:
        state = _Machine().run(data)
    except (ValueError, IndexError, KeyError, TypeError, AttributeError) as error:
        raise DamagedError(f"data.pkl describes no state_dict ({error})") from None
    if not isinstance(state, dict):
        raise DamagedError("data.pkl describes no state_dict")
    return {name: tensor for name, tensor in state.items() if isinstance(tensor, Tensor)}


class _Machine:
    """Operations of pickle protocol 2 that a `state_dict` needs, on a stack of stacks."""

    def __init__(self) -> None:
        self._stack: list[Any] = []
        self._outer: list[list[Any]] = []
        self._memo: dict[int, Any] = {}

    def run(self, data: bytes) -> Any:
        """Return the object that the pickle describes. Raises AttributeError for an operation not defined below."""
        for operation, argument, _ in pickletools.genops(data):
            if operation.name == "STOP":
                break
            if operation.name in _ITSELF:
                self._stack.append(argument)
            else:
                do: Callable[[Any], None] = getattr(self, f"_{operation.name.lower()}")
                do(argument)
        return self._stack.pop()

    def _proto(self, _: Any) -> None:
        pass

    def _global(self, name: str) -> None:
        if name not in (_DICTIONARY, _TENSOR, *_STORAGES):
            raise ValueError(f"it names {name!r}")
        self._stack.append(name)

    def _newtrue(self, _: Any) -> None:
        self._stack.append(True)

    def _newfalse(self, _: Any) -> None:
        self._stack.append(False)

    def _empty_dict(self, _: Any) -> None:
        self._stack.append({})

    def _mark(self, _: Any) -> None:
        self._outer.append(self._stack)
        self._stack = []

    def _to_mark(self) -> list[Any]:
        items, self._stack = self._stack, self._outer.pop()
        return items

    def _tuple(self, _: Any) -> None:
        items = tuple(self._to_mark())
        self._stack.append(items)

    def _tuple_of(self, count: int) -> None:
        start = len(self._stack) - count
        if start < 0:
            raise IndexError("a tuple has too few items")
        self._stack[start:] = [tuple(self._stack[start:])]

    def _empty_tuple(self, _: Any) -> None:
        self._tuple_of(0)

    def _tuple1(self, _: Any) -> None:
        self._tuple_of(1)

    def _tuple2(self, _: Any) -> None:
        self._tuple_of(2)

    def _tuple3(self, _: Any) -> None:
        self._tuple_of(3)

    def _binput(self, index: int) -> None:
        self._memo[index] = self._stack[-1]

    def _binget(self, index: int) -> None:
        self._stack.append(self._memo[index])

    _long_binput, _long_binget = _binput, _binget

    def _binpersid(self, _: Any) -> None:
        _, kind, key, _, _ = self._stack.pop()
        if kind not in _STORAGES or not isinstance(key, str):
            raise ValueError("a storage is malformed")
        self._stack.append(Storage(kind, key))

    def _reduce(self, _: Any) -> None:
        arguments, function = self._stack.pop(), self._stack.pop()
        if function == _DICTIONARY and arguments == ():
            self._stack.append({})
        elif function == _TENSOR:
            self._stack.append(_tensor(*arguments[:4]))
        else:
            raise ValueError("it calls an unknown function")

    def _setitem(self, _: Any) -> None:
        value, key = self._stack.pop(), self._stack.pop()
        self._set([key, value])

    def _setitems(self, _: Any) -> None:
        self._set(self._to_mark())

    def _set(self, pairs: list[Any]) -> None:
        keys = pairs[::2]
        if not all(isinstance(key, str) for key in keys) or not isinstance(self._stack[-1], dict):
            raise ValueError("a name is not text")
        self._stack[-1].update(zip(keys, pairs[1::2], strict=True))

    def _build(self, _: Any) -> None:
        self._stack.pop()  # the versions of the modules


def _tensor(storage: Any, offset: Any, shape: Any, stride: Any) -> Tensor:
    numbers = [offset, *shape, *stride]
    if not isinstance(storage, Storage) or not all(isinstance(each, int) and each >= 0 for each in numbers):
        raise ValueError("a tensor is malformed")
    return Tensor(storage, offset, tuple(shape), tuple(stride))


def _in_order(shape: tuple[int, ...], stride: tuple[int, ...]) -> bool:
    """Return whether the numbers of a tensor follow each other row by row."""
    if len(shape) != len(stride):
        return False
    below = [math.prod(shape[i + 1 :]) for i in range(len(shape))]
    return all(n == 1 or step == least for n, step, least in zip(shape, stride, below, strict=True))


def _member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """Return the content of a member. Raises DamagedError if it is missing or has more than `most` bytes."""
    try:
        info = archive.getinfo(name)
    except KeyError:
        raise DamagedError(f"holds no {name}") from None
    if info.file_size > most:
        raise DamagedError(f"{name} has {info.file_size} bytes: must have at most {most}")
    return archive.read(info)
