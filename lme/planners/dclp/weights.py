"""The weights of a DCLP network in a file: an .npz with the arrays of `SHAPES`, float32."""

from __future__ import annotations

import math
import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError

Weights = Mapping[str, NDArray[np.float32]]

DIRECTION_INPUTS, STATE_INPUTS = 6, 8
COMPONENTS, MIXTURE = 4, 5  # of the mixture; logit, mean (2) and log deviation (2) of each
CONVOLUTIONS, HIDDEN = (32, 64, 128), (128, 128, 128, 128)
LAYERS = (*(f"convolution_{i}" for i in (1, 2, 3)), *(f"dense_{i}" for i in (1, 2, 3, 4)), "output")
_DAMAGE = (zipfile.BadZipFile, EOFError, ValueError, RuntimeError, SyntaxError, OverflowError, struct.error)
_BYTES_MAX = 2**20  # of an array with its header; the largest has 70 kB


def _shapes() -> dict[str, tuple[int, ...]]:
    inputs = (DIRECTION_INPUTS, *CONVOLUTIONS[:-1], CONVOLUTIONS[-1] + STATE_INPUTS, *HIDDEN)
    outputs = (*CONVOLUTIONS, *HIDDEN, COMPONENTS * MIXTURE)
    shapes: dict[str, tuple[int, ...]] = {"alpha": ()}
    for layer, rows, columns in zip(LAYERS, inputs, outputs, strict=True):
        shapes |= {f"{layer}.kernel": (rows, columns), f"{layer}.bias": (columns,)}
    return shapes


SHAPES = _shapes()  # of every array by its name; a kernel is (inputs, outputs)


def write_weights(weights: Weights, file: IO[bytes]) -> None:
    """Write the arrays of `SHAPES` as .npz. The same weights give the same bytes."""
    # savez takes names as keywords; mypy cannot tell them from its own `allow_pickle`.
    np.savez(file, **{name: np.asarray(weights[name], np.float32) for name in SHAPES})  # type: ignore[arg-type]


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """The arrays of `SHAPES` in a file that `write_weights` made.

    Raises InputError, naming file and array, for a file that cannot be read, arrays of other names, types or
    shapes, and values that are not finite. No array is made before its shape is known to be right.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            weights = {name: _array(archive, name, path) for name in SHAPES}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (
        zipfile.BadZipFile,
        zipfile.LargeZipFile,
        EOFError,
        ValueError,
        RuntimeError,
        SyntaxError,
    ) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is no weight file of a DCLP network, an .npz ({error})") from None
    for name, array in weights.items():
        if not np.isfinite(array).all():
            raise InputError(f"{path}: {name} holds values that are not finite")
    return weights


def _array(archive: zipfile.ZipFile, name: str, path: Path) -> NDArray[np.float32]:
    try:
        info = archive.getinfo(f"{name}.npy")
    except KeyError:
        raise InputError(
            f"{path}: {name} is missing: must hold the weights of a DCLP network; "
            "lme weights import writes such a file"
        ) from None
    if info.file_size > _BYTES_MAX or info.compress_type != zipfile.ZIP_STORED:
        raise InputError(f"{path}: {name} must have at most {_BYTES_MAX} bytes and not be compressed")
    with archive.open(info) as member:
        np.lib.format.read_magic(member)
        shape, by_columns, dtype = np.lib.format.read_array_header_1_0(member)
        if shape != SHAPES[name] or dtype != np.dtype("<f4") or by_columns:
            raise InputError(f"{path}: {name} is {dtype} {shape}: must be float32 {SHAPES[name]}")
        raw = member.read(4 * math.prod(shape) + 1)
    if len(raw) != 4 * math.prod(shape):
        raise InputError(f"{path}: {name} has another length than its shape {shape}")
    return np.frombuffer(raw, "<f4").reshape(shape).astype(np.float32)
