"""Import of the network that DRL-VO's authors published: a Stable-Baselines3 archive, checked and reduced.

Its tensors are in a file that PyTorch saved (`torch.save` of a `state_dict`, PyTorch 1.6 or newer), which is read
without PyTorch: a zip of a pickle that describes the tensors, and of their numbers. The pickle is read as data, with
the few operations of a `state_dict`; it cannot name any other function, and none of it is executed.
"""

from __future__ import annotations

import io
import math
import pickletools
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import check_regular
from lme.inputs.onnx_file import TRAINED, Shape
from lme.inputs.onnx_graph import check_finite
from lme.planners.drl_vo.weights import REPORTED, checked_sizes, shapes

POLICY = "policy.pth"
_PUBLISHED = {"v_max": 0.5, "omega_max": 2.0}  # [m/s, rad/s] the authors' training environment
_POLICY_MAX = 2**30  # [bytes]; the published one has about 20 MB
DAMAGE = (  # errors of zipfile and `TorchFile` for a damaged file, besides OSError
    zipfile.BadZipFile, zipfile.LargeZipFile, zlib.error, struct.error, EOFError, RuntimeError, ValueError,
    OverflowError, NotImplementedError, MemoryError,
)  # fmt: skip
PICKLE_MAX = 2**20  # [bytes] of the description; the published one has 20 kB
_NUMBERS_MAX = 2**28  # [bytes] of one tensor
_DICTIONARY, _TENSOR = "collections OrderedDict", "torch._utils _rebuild_tensor_v2"
_STORAGES = tuple(f"torch {kind}Storage" for kind in ("Float", "Double", "Half", "Long", "Int", "Bool"))
_FLOAT = _STORAGES[0]


def import_archive(path: Path) -> dict[str, NDArray[np.float32]]:
    """Return the actor's weights in an archive of Stable-Baselines3's PPO, as `weights.write_weights` takes them.

    Critic, optimiser and pickled settings are ignored, and nothing in the archive is executed. The zips' own
    checksums are verified. Raises InputError, naming file and array.
    """
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as archive, _policy(archive) as policy:
            return _weights(TorchFile(policy), path)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except DAMAGE as error:
        raise InputError(
            f"{path}: is not an archive of a DRL-VO network by Stable-Baselines3 ({error})"
        ) from None


def _policy(archive: zipfile.ZipFile) -> zipfile.ZipFile:
    """Return the zip within the zip."""
    if POLICY not in archive.namelist():
        raise DamagedError(f"holds no {POLICY}")
    info = archive.getinfo(POLICY)
    if info.file_size > _POLICY_MAX:
        raise DamagedError(f"{POLICY} has {info.file_size} bytes: must have at most {_POLICY_MAX}")
    return zipfile.ZipFile(io.BytesIO(archive.read(info)))


def _weights(saved: TorchFile, path: Path) -> dict[str, NDArray[np.float32]]:
    found: Mapping[str, Shape] = {name: tensor.shape for name, tensor in saved.tensors.items()}
    weights = {name: saved.read(name) for name in shapes(checked_sizes(found, f"{path}: {POLICY}"))}
    check_finite(weights, f"{path}: {POLICY}")
    weights[TRAINED] = np.array([_PUBLISHED[key] for key in REPORTED], np.float32)
    return weights


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
        state = _run(data)
    except (ValueError, IndexError, KeyError, TypeError) as error:
        raise DamagedError(f"data.pkl describes no state_dict ({error})") from None
    if not isinstance(state, dict):
        raise DamagedError("data.pkl describes no state_dict")
    return {name: tensor for name, tensor in state.items() if isinstance(tensor, Tensor)}


def _run(data: bytes) -> Any:
    """Return the object that a pickle describes, by the operations of protocol 2 that a `state_dict` needs."""
    stack: list[Any] = []
    outer: list[list[Any]] = []  # the stacks below the marks
    memo: dict[Any, Any] = {}
    for operation, argument, _ in pickletools.genops(data):
        match operation.name:
            case "STOP":
                break
            case "PROTO":
                pass
            case "BINUNICODE" | "BININT" | "BININT1" | "BININT2" | "LONG1":
                stack.append(argument)
            case "NEWTRUE" | "NEWFALSE":
                stack.append(operation.name == "NEWTRUE")
            case "EMPTY_DICT":
                stack.append({})
            case "MARK":
                outer.append(stack)
                stack = []
            case "TUPLE":
                items, stack = tuple(stack), outer.pop()
                stack.append(items)
            case "EMPTY_TUPLE":
                stack.append(())
            case "TUPLE1" | "TUPLE2" | "TUPLE3":
                start = len(stack) - int(operation.name[-1])
                if start < 0:
                    raise IndexError("a tuple has too few items")
                stack[start:] = [tuple(stack[start:])]
            case "BINPUT" | "LONG_BINPUT":
                memo[argument] = stack[-1]
            case "BINGET" | "LONG_BINGET":
                stack.append(memo[argument])
            case "GLOBAL":
                if argument not in (_DICTIONARY, _TENSOR, *_STORAGES):
                    raise ValueError(f"it names {argument!r}")
                stack.append(argument)
            case "BINPERSID":
                _, kind, key, _, _ = stack.pop()
                if kind not in _STORAGES or not isinstance(key, str):
                    raise ValueError("a storage is malformed")
                stack.append(Storage(kind, key))
            case "REDUCE":
                arguments, function = stack.pop(), stack.pop()
                if function == _DICTIONARY and arguments == ():
                    stack.append({})
                elif function == _TENSOR:
                    stack.append(_tensor(*arguments[:4]))
                else:
                    raise ValueError("it calls an unknown function")
            case "SETITEM":
                value, key = stack.pop(), stack.pop()
                _set(stack[-1], [key, value])
            case "SETITEMS":
                pairs, stack = stack, outer.pop()
                _set(stack[-1], pairs)
            case "BUILD":
                stack.pop()  # the versions of the modules
            case other:
                raise ValueError(f"it has the operation {other}")
    return stack.pop()


def _set(state: Any, pairs: list[Any]) -> None:
    """Put keys and values, which follow each other, into a dictionary."""
    keys = pairs[::2]
    if not all(isinstance(key, str) for key in keys) or not isinstance(state, dict):
        raise ValueError("a name is not text")
    state.update(zip(keys, pairs[1::2], strict=True))


def _tensor(storage: Any, offset: Any, shape: Any, stride: Any) -> Tensor:
    numbers = [offset, *shape, *stride]
    if not isinstance(storage, Storage) or not all(
        isinstance(number, int) and number >= 0 for number in numbers
    ):
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
