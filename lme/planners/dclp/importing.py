"""Import of the network that DRL-DCLP's authors published: a TensorFlow checkpoint, checked and reduced."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.onnx_file import TRAINED, Shape
from lme.inputs.onnx_graph import check_finite
from lme.planners.dclp.bundle import INDEX, SHARD, read_entries, read_tensors
from lme.planners.dclp.weights import LAYERS, REPORTED, SHAPES, SIGNATURE

_POLICY = "main/pi"  # the scope of the policy; the checkpoint also has critics and target networks
_LAYERS = ("conv1d", "conv1d_1", "conv1d_2", "dense", "dense_1", "dense_2", "dense_3", "dense_4")
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
_ENDINGS = (INDEX, SHARD, ".meta")


def tensor_names() -> dict[str, str]:
    """Return the checkpoint's name of every array of `SHAPES`."""
    names = {"alpha": f"{_POLICY}/Variable"}
    for ours, theirs in zip(LAYERS, _LAYERS, strict=True):
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
