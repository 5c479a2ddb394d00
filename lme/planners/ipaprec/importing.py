"""Import of the networks of MAER-Nav and DRL-NSUO: TensorFlow checkpoints, checked and reduced."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lme.planners.dclp.importing import read_policy
from lme.planners.ipaprec.weights import LAYERS, shapes, signature

_POLICY = "main/pi"  # the scope of the policy; the checkpoint also has critics and target networks
_LAYERS = ("dense", "dense_1", "dense_2", "dense_3", "dense_4")  # dense_5 has the deviations


def tensor_names() -> dict[str, str]:
    """Return the checkpoint's name of every array of `shapes`."""
    names = {"alpha": f"{_POLICY}/Variable"}
    for ours, theirs in zip(LAYERS, _LAYERS, strict=True):
        names |= {f"{ours}.{part}": f"{_POLICY}/{theirs}/{part}" for part in ("kernel", "bias")}
    return names


def import_checkpoint(path: Path, sectors: int) -> dict[str, NDArray[np.float32]]:
    """Return the arrays of `shapes` in a TensorFlow V2 checkpoint. path: as for `read_policy`; raises its errors."""
    return read_policy(path, tensor_names(), shapes(sectors), signature(sectors).what)
