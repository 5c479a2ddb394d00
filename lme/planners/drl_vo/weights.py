"""Weights of a DRL-VO network in a file: an .npz with the arrays of `architecture` and `TRAINED`, float32.

The network may have any size. The names and shapes are those of the policy's `state_dict` in Stable-Baselines3.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.inputs.array_file import Arrays, read_arrays, read_shapes, write_arrays
from lme.planners.drl_vo.architecture import Shape, Sizes, checked_sizes, shapes

WHAT = "a DRL-VO network"
TOLD = ("v_max", "omega_max")  # of the planner: the greatest commands that it gives
TRAINED = "trained"  # the greatest values of TOLD in the training: (2,)


def file_shapes(sizes: Sizes) -> dict[str, Shape]:
    """Return the shape of every array in the file of a network of these sizes."""
    return {**shapes(sizes), TRAINED: (len(TOLD),)}


def write_weights(weights: Arrays, file: IO[bytes]) -> None:
    """Write only a network's arrays and `TRAINED`, as .npz. The same weights give the same bytes.

    Raises InputError, naming the array, if one is missing or has another shape.
    """
    sizes = checked_sizes({name: array.shape for name, array in weights.items()}, "weights")
    write_arrays({name: weights[name] for name in file_shapes(sizes)}, file)


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """Read a network's arrays and `TRAINED` from a file that `write_weights` made.

    Raises InputError, naming file and array, for a file that cannot be read, arrays of other names, types or
    shapes, and values that are not finite. No array is created before all shapes are known to agree.
    """
    return read_arrays(path, file_shapes(checked_sizes(read_shapes(path, WHAT), str(path))), WHAT)
