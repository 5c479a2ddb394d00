"""Find learned parameters by name, by training run, or by file; and networks by name or by file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from lme.errors import InputError, nearest
from lme.policies.lme.parameter_file import read_parameters
from lme.policies.lme.score import CRITERIA, THRESHOLDS
from lme.resources import resource_dir
from lme.yaml_entry import read_yaml
from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten
from runners.config.hydra_errors import unknown_key
from runners.config.quoting import resume_command

PUBLISHED = "published"  # the paper's weight set
WEIGHTS = "weights.yaml"  # in the directory of a training run
NETWORK = "weights.npz"  # in the directory of a run of lme learn
REGISTERED = Path("outputs") / "weights"
IMPORT_NETWORK = "lme weights import NETWORK PATH NAME"
_OWN = re.compile(r"\$\{parameters:.*,\s*([\w./-]+)\s*\}")  # the fifth argument of the resolver
_TAKEN = re.compile(r"\$\{.*(?<!\w\.)\bweights\b")  # of the whole config; not ${planner.weights}
TIMES = "\u00d7"  # a typographic sign that is easily taken for a letter


def parameters(
    weights: str,
    ablation: Mapping[str, float],
    criteria: Iterable[str] = (),
    scale: Mapping[str, float] | None = None,
    own: str | None = None,
) -> dict[str, float]:
    """The parameters of a weight set, multiplied by `scale`, with those of the ablation in their place.

    weights: a name in `conf/weight_set/` or `outputs/weights/`, the directory of a training run, or the path of
    a YAML with a mapping `parameters`. criteria: names of criteria besides the paper's six. scale: factors by
    name; an ablation replaces what they give. own: the weight set of a guide with other criteria than the paper's; it
    names them, and is taken where `weights` is the paper's set.
    Raises InputError naming the file where it is missing or malformed, and for a scale of no parameter or a
    factor that is negative or not finite.
    """
    if own is None:
        learned = read_parameters(find(weights), (*CRITERIA, *criteria))
    else:
        names = [name for name in _own_names(own) if name not in THRESHOLDS]
        learned = read_parameters(find(own if weights == PUBLISHED else weights), names)
    return {**learned, **_scaled(learned, scale or {}), **ablation}


def own_weights(guide: Mapping[str, Any]) -> str | None:
    """The weight set that a guide's config, not resolved, names as its own; None where it has the paper's criteria."""
    found = _OWN.fullmatch(str(guide.get("parameters")))
    return found[1] if found and found[1] != "null" else None


@cache
def own_weights_of(guide: str, folders: tuple[Path, ...]) -> str | None:
    """The same of an option of the group `guide`, read once; None if the option no longer exists."""
    try:
        return own_weights(Catalogue(folders).values(f"guide/{guide}"))
    except (FileNotFoundError, InputError):
        return None


def parameter_names(guide: Mapping[str, Any]) -> list[str]:
    """The parameters that a guide's config, not resolved, takes from a weight set; none where it takes none."""
    own = own_weights(guide)
    if own is not None:
        return _own_names(own)
    return [*CRITERIA, *THRESHOLDS, *(guide.get("criteria") or {})] if takes_weights(guide) else []


def takes_weights(node: Mapping[str, Any]) -> bool:
    """Whether a config, not resolved, interpolates the key `weights`."""
    return any(isinstance(value, str) and _TAKEN.search(value) for _, value in flatten(node))


def _own_names(own: str) -> list[str]:
    """Names of the parameters in a weight set that ships."""
    content = read_yaml(find(own))
    assert isinstance(content, dict)
    return list(content["parameters"])


def check_scale(scale: Mapping[str, float], guide: Mapping[str, Any]) -> None:
    """Raise InputError for factors if the guide's config has no parameters to multiply."""
    if scale and "parameters" not in guide:
        raise InputError(
            f"scale is {dict(scale)}: {guide['_target_']} has no parameters to multiply; must be {{}}"
        )


def scale_in_words(scale: Mapping[str, float]) -> str:
    """A scale as a table shows it: "a_close × 0.5", several with commas between; empty where it changes nothing."""
    return ", ".join(f"{name} {TIMES} {float(factor):.12g}" for name, factor in scale.items() if factor != 1)


def scale_from_words(text: str) -> dict[str, float]:
    """The scale of a text that `scale_in_words` made."""
    pairs = [part.split(f" {TIMES} ") for part in text.split(", ") if part]
    return {name: float(factor) for name, factor in pairs}


def find(weights: str) -> Path:
    """The weight file that `weights` names. Raises InputError where there is none."""
    shipped = shipped_weights()
    if weights in shipped:
        return shipped[weights]
    path = Path(weights)
    if path.is_file():
        return path
    if path.is_dir():
        return _of_run(path)
    registered = {path.stem: path for path in sorted(REGISTERED.glob("*.yaml"))}
    if weights in registered:
        return registered[weights]
    known = [*shipped, *registered]
    raise InputError(
        f"weights is {weights!r}: {nearest(weights, known)}must be one of {', '.join(known)}, the directory of a "
        "training run, or the path of a weight file"
    )


def with_network(planner: Mapping[str, Any]) -> Mapping[str, Any]:
    """A planner's config in which `weights`, if it is given, is the path of the network that it names."""
    given = planner.get("weights")
    return {**planner, "weights": str(find_network(given))} if isinstance(given, str) else planner


def find_network(weights: str, key: str = "planner.weights") -> Path:
    """The network file that the value of `key` names: shipped or in `outputs/weights/`, of a run, or by path.

    Raises InputError.
    """
    registered = {path.stem: path for path in sorted(REGISTERED.glob("*.npz"))}
    known = {**registered, **shipped_networks()}
    path = Path(weights).expanduser()
    if path.is_dir():
        path = path / NETWORK
    if weights in known or path.is_file():
        return known.get(weights, path)
    raise InputError(
        f"{key} is {weights!r}: {nearest(weights, known)}must be one of {', '.join(known)}, the directory of a run of "
        f"lme learn, or the path of an .npz; `{IMPORT_NETWORK}` makes one"
    )


def shipped_weights() -> dict[str, Path]:
    """The weight sets that ship with lme, by name."""
    return _shipped("weight_set", "yaml")


def shipped_networks() -> dict[str, Path]:
    """The networks that ship with lme, by name."""
    return _shipped("network", "npz")


def _shipped(folder: str, ending: str) -> dict[str, Path]:
    return {path.stem: path for path in sorted((resource_dir("conf") / folder).glob(f"*.{ending}"))}


def _scaled(learned: Mapping[str, float], scale: Mapping[str, float]) -> dict[str, float]:
    """Those parameters that have a factor, times it."""
    for name, factor in scale.items():
        if name not in learned:
            raise unknown_key(f"scale.{name}", learned)
        if not (math.isfinite(factor) and factor >= 0):
            raise InputError(f"scale.{name} is {factor:g}: must be a number, at least 0 and finite")
    return {name: learned[name] * factor for name, factor in scale.items()}


def _of_run(directory: Path) -> Path:
    if not (directory / WEIGHTS).is_file():
        raise InputError(
            f"weights is {directory}: holds no {WEIGHTS}; must be the directory of a finished lme train "
            f"(finish it with {resume_command('train', directory)})"
        )
    return directory / WEIGHTS
