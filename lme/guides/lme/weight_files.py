"""Find learned parameters and networks by name, by training run, or by file; and read the parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from lme.errors import InputError, nearest
from lme.guides.lme.score import THRESHOLDS, read_parameters
from lme.inputs.guarded_file import expanded, read_yaml
from lme.inputs.resources import resource_dir

PUBLISHED = "published"  # the paper's weight set
WEIGHTS = "weights.yaml"  # in the directory of a training run
NETWORK = "weights.onnx"  # in the directory of a run of lme learn
REGISTERED = Path("outputs") / "weights"
IMPORT_NETWORK = "lme weights import NETWORK PATH NAME"


def learned_parameters(
    weights: str, weight_set: str = PUBLISHED, criteria: Iterable[str] = ()
) -> dict[str, float]:
    """Return the parameters of a weight set: a weight for each criterion, d1 [m] and d2.

    weights: as for `find_weights`; the paper's set stands for the guide's own. weight_set: the guide's own, which names
    its criteria. criteria: names of further ones. Raises InputError naming the file where it is missing or malformed.
    """
    names = [name for name in set_names(weight_set) if name not in THRESHOLDS]
    needed = [*names, *criteria, *THRESHOLDS]
    if weights != PUBLISHED and weights in shipped_weights() and not {*set_names(weights)} <= {*needed}:
        raise InputError(
            f"weights is {weights!r}: this set is for another guide; must hold the parameters {', '.join(needed)}"
        )
    return read_parameters(find_weights(weight_set if weights == PUBLISHED else weights), [*names, *criteria])


def set_names(weight_set: str) -> list[str]:
    """Names of the parameters in a weight set that ships."""
    content = read_yaml(find_weights(weight_set))
    assert isinstance(content, dict)
    return list(content["parameters"])


def find_weights(weights: str) -> Path:
    """Return the weight file that `weights` names. Raises InputError if there is none."""
    shipped = shipped_weights()
    if weights in shipped:
        return shipped[weights]
    path = expanded(weights)
    if path.is_file():
        return path
    if path.is_dir():
        if not (path / WEIGHTS).is_file():
            raise InputError(
                f"weights is {path}: holds no {WEIGHTS}; must be the directory of a finished lme train; "
                "resume that training to finish it"
            )
        return path / WEIGHTS
    registered = {path.stem: path for path in sorted(REGISTERED.glob("*.yaml"))}
    if weights in registered:
        return registered[weights]
    names = [*shipped, *registered]
    raise InputError(
        f"weights is {weights!r}: {nearest(weights, names)}must be one of {', '.join(names)}, the directory of a "
        "training run, or the path of a weight file"
    )


def with_network(node: Mapping[str, Any], part: str = "planner") -> Mapping[str, Any]:
    """Return the config of a part with `weights`, if given, replaced by the path of the network that it names."""
    name = node.get("weights")
    return {**node, "weights": str(find_network(name, f"{part}.weights"))} if isinstance(name, str) else node


def find_network(weights: str, key: str = "planner.weights") -> Path:
    """Return the network file that `weights` names: shipped or in `outputs/weights/`, of a run, or by path.

    key: the config key of `weights`, for the error. Raises InputError if there is none.
    """
    registered = {path.stem: path for path in sorted(REGISTERED.glob("*.onnx"))}
    networks = {**registered, **shipped_networks()}
    path = expanded(weights)
    if path.is_dir():
        path = path / NETWORK
    if weights in networks or (path.is_file() and path.suffix != ".npz"):
        return networks.get(weights, path)
    for former in (path.with_suffix(".npz"), REGISTERED / f"{weights}.npz"):
        if former.is_file():
            raise InputError(
                f"{key} is {weights!r}: {former} is of an earlier lme; networks are ONNX files now: import or learn it "
                "again"
            )
    raise InputError(
        f"{key} is {weights!r}: {nearest(weights, networks)}must be one of {', '.join(networks)}, the directory of a "
        f"run of lme learn, or the path of an ONNX file; `{IMPORT_NETWORK}` makes one"
    )


def shipped_weights() -> dict[str, Path]:
    """Weight sets that ship with lme, by name."""
    return _shipped("weight_set", "yaml")


def shipped_networks() -> dict[str, Path]:
    """Networks that ship with lme, by name."""
    return _shipped("network", "onnx")


def _shipped(folder: str, ending: str) -> dict[str, Path]:
    return {path.stem: path for path in sorted((resource_dir("conf") / folder).glob(f"*.{ending}"))}
