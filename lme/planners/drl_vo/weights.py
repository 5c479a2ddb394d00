"""The weights of a DRL-VO network in a file: an .npz with the arrays that `architecture` lists, float32.

A network of any size does. The names and shapes are those of the policy's `state_dict` in Stable-Baselines3, so a
trainer that builds the same modules writes the arrays of its `state_dict`.
"""

from __future__ import annotations

from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from lme.planners.array_file import Arrays, read_arrays, read_shapes, write_arrays
from lme.planners.drl_vo.architecture import checked_shapes

WHAT = "a DRL-VO network"


def write_weights(weights: Arrays, file: IO[bytes]) -> None:
    """Write a network's arrays as .npz, and no others. The same weights give the same bytes.

    Raises InputError, naming the array, if one is missing or has another shape.
    """
    shapes = checked_shapes({name: array.shape for name, array in weights.items()}, "weights")
    write_arrays({name: weights[name] for name in shapes}, file)


def read_weights(path: Path) -> dict[str, NDArray[np.float32]]:
    """A network's arrays in a file that `write_weights` made.

    Raises InputError, naming file and array, for a file that cannot be read, arrays of other names, types or
    shapes, and values that are not finite. No array is made before all shapes are known to agree.
    """
    return read_arrays(path, checked_shapes(read_shapes(path, WHAT), str(path)), WHAT)
