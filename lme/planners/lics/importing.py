"""Import of the network that the authors of LiCS published: a file of PyTorch, checked."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import check_regular
from lme.inputs.onnx_graph import check_finite
from lme.planners.drl_vo.torch_file import DAMAGE, TorchFile
from lme.planners.lics.weights import SHAPES, SIGNATURE


def import_state(path: Path) -> dict[str, NDArray[np.float32]]:
    """Return the arrays of `SHAPES` in a `state_dict` that PyTorch saved, such as `transformer_99.pth`.

    Nothing in the file is executed, and PyTorch is not needed. The zip's own checksums are verified. Raises
    InputError, naming file and array.
    """
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as archive:
            saved = TorchFile(archive)
            found = {name: tensor.shape for name, tensor in saved.tensors.items()}
            # Compare all shapes before any array is read.
            for name, shape in SHAPES.items():
                if found.get(name) != shape:
                    raise InputError(
                        f"{path}: {name} is {found.get(name, 'missing')}: must be float32 {shape}"
                    )
            weights = {name: saved.read(name) for name in SHAPES}
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except DAMAGE as error:
        raise InputError(f"{path}: is not {SIGNATURE.what} that PyTorch saved ({error})") from None
    check_finite(weights, str(path))
    return weights
