"""What a command line says twice and differently, or in vain. A file's values and a resumed run's may be overridden."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError
from lme.guides.lme.weight_files import PUBLISHED, find_weights
from lme.worlds.barn.map_set import FRESH_KEYS, OFFICIAL, TARGET, check_given, is_idle
from runners.config.composer import without_hydra
from runners.config.overrides import text_of
from runners.config.weights import own_weights, takes_weights


def refuse_contradictions(given: Sequence[Override], configs: Collection[DictConfig]) -> None:
    """Raise InputError for a key with two values, worlds outside the subset given with them, and what no job uses.

    given: the overrides as they were typed. configs: of the jobs that they make.
    """
    texts: dict[str, str] = {}
    for override in given:
        key, text = override.get_key_element().lstrip("+"), text_of(override).lstrip("+")
        if texts.setdefault(key, text) != text:
            raise InputError(f"{texts[key]} and {text}: {key} has two values; give one of them")
    if {"map.subset", "map.worlds"} <= set(texts):
        for config in configs:
            _check_worlds(config.map)
    for key in texts:
        _check_fresh(key, configs)
    if "weights" in texts:
        _check_weights(texts["weights"], configs)


def _check_fresh(key: str, configs: Collection[DictConfig]) -> None:
    """A key of fresh worlds is in vain if no job drives any; in a sweep of subsets some jobs may have no use for it."""
    node, _, name = key.rpartition(".")
    if name not in FRESH_KEYS:
        return
    found = [OmegaConf.select(config, node) for config in configs]
    if found and all(OmegaConf.is_dict(each) and is_idle(name, each) for each in found):
        check_given([name], found[0], node)


def _check_worlds(barn: Mapping[str, Any]) -> None:
    """Fresh worlds have no end, and a number needs its subset to say which kind of them is meant."""
    subset, worlds = barn.get("subset"), barn.get("worlds")
    if barn.get("_target_") != TARGET or not worlds or subset == "all" or subset not in OFFICIAL:
        return
    outside = [str(number) for number in worlds if number not in set(OFFICIAL[subset]())]
    if outside:
        some = ", ".join(outside[:5]) + (f" and {len(outside) - 5} more" if len(outside) > 5 else "")
        raise InputError(
            f"map.worlds asks for {some}, which map.subset={subset} does not hold: give one of the two keys"
        )


def _check_weights(text: str, configs: Collection[DictConfig]) -> None:
    """A weight set must exist, and a job must drive with it: in a sweep DWA among LME's variants may do without.

    `lme learn` names further guides, which may take it.
    """
    plain: list[Any] = [OmegaConf.to_container(without_hydra(config), resolve=False) for config in configs]
    if not any("learner" in config or _drives_with_weights(config) for config in plain):
        raise InputError(
            f"{text}: nothing here drives with this weight set; omit it, or choose a guide such as guide=lme "
            "(a network is planner.weights or guide.weights)"
        )
    for name in dict.fromkeys(str(config["weights"]) for config in plain):
        if "${" not in name:
            find_weights(name)


def _drives_with_weights(config: Mapping[str, Any]) -> bool:
    """Return whether an unresolved config follows its key `weights`; a guide with its own set ignores the paper's."""
    replaced = config["weights"] == PUBLISHED and own_weights(config["guide"]) not in (None, PUBLISHED)
    return takes_weights(config) and not replaced
