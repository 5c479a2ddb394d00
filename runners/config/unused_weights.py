"""A weight set that was typed and that no job drives with."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError
from lme.guides.lme.weight_files import PUBLISHED, find_weights
from runners.config.catalogue import Catalogue
from runners.config.weights import own_weights, takes_weights


def check_weights(text: str, configs: Collection[DictConfig], catalogue: Catalogue) -> None:
    """Raise InputError for a set that does not exist, and unless a job uses those that were typed.

    In a sweep the others may do without: DWA among LME's variants has no parameters.

    text: "weights=NAME", as it was typed. configs: of the jobs.
    """
    plain = [_plain(config) for config in configs]
    if not any(_uses(config, catalogue) for config in plain):
        raise InputError(f"{text}: {_why(plain[0], catalogue)}")
    for name in dict.fromkeys(str(config["weights"]) for config in plain):
        if "${" not in name:
            find_weights(name)


def _plain(config: DictConfig) -> dict[str, Any]:
    """The config as its files write it, with interpolations and without Hydra's own part."""
    found = cast(dict[str, Any], OmegaConf.to_container(config, resolve=False))
    found.pop("hydra", None)
    return found


def _uses(config: Mapping[str, Any], catalogue: Catalogue) -> bool:
    """Whether a job drives with the set that its key `weights` names; a guide with its own set leaves the paper's."""
    if any(takes_weights(guide) for guide in _other_guides(config, catalogue)):
        return True
    return takes_weights(config) and not (_own(config) and config["weights"] == PUBLISHED)


def _own(config: Mapping[str, Any]) -> str | None:
    own = own_weights(config["guide"])
    return None if own == PUBLISHED else own


def _other_guides(config: Mapping[str, Any], catalogue: Catalogue) -> Iterator[Mapping[str, Any]]:
    """The guides that `lme learn` names beside its own: in shares, and of its expert."""
    expert = (config.get("learner") or {}).get("expert") or {}
    for name in (*(config.get("guides") or {}), expert.get("guide")):
        if catalogue.has(f"guide/{name}"):
            yield catalogue.values(f"guide/{name}")


def _why(config: Mapping[str, Any], catalogue: Catalogue) -> str:
    own = _own(config)
    if own:
        return f"the guide has weights of its own, {own}, in place of the paper's; omit it, or give weights={own}"
    takers = [name for name in catalogue.options("guide") if takes_weights(catalogue.values(f"guide/{name}"))]
    network = " (the planner's network is planner.weights)" if "weights" in config["planner"] else ""
    return (
        "neither the guide nor the planner takes a weight set; "
        f"omit it{network}, or choose {' or '.join(f'guide={name}' for name in takers)}"
    )
