"""Import of the network that DRL-VO's authors published: a Stable-Baselines3 archive, checked and reduced."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.inputs.guarded_file import check_regular
from lme.inputs.onnx_file import TRAINED
from lme.inputs.onnx_graph import check_finite
from lme.planners.drl_vo.architecture import Shape, checked_sizes, shapes
from lme.planners.drl_vo.graph import REPORTED
from lme.planners.drl_vo.torch_file import DAMAGE, DamagedError, TorchFile

POLICY = "policy.pth"
_PUBLISHED = {"v_max": 0.5, "omega_max": 2.0}  # [m/s, rad/s] the authors' training environment
_POLICY_MAX = 2**30  # [bytes]; the published one has about 20 MB


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
