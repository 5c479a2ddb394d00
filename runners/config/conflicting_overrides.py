"""Check for overrides that contradict each other or have no effect.

Only typed overrides are checked: they may replace the values of a file or of a resumed run.
"""

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


def refuse(given: Sequence[Override], configs: Collection[DictConfig]) -> None:
    """Raise InputError for a key with two values, worlds outside their given subset, and values that no job uses.

    given: overrides as they were typed. configs: those of the jobs that they give.
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
    """Raise InputError for a key of fresh worlds if no job drives any; in a sweep some jobs may drive none."""
    node, _, name = key.rpartition(".")
    if name not in FRESH_KEYS:
        return
    found = [OmegaConf.select(config, node) for config in configs]
    if found and all(OmegaConf.is_dict(each) and is_idle(name, each) for each in found):
        check_given([name], found[0], node)


def _check_worlds(barn: Mapping[str, Any]) -> None:
    """Raise InputError for worlds outside their official subset.

    Fresh worlds are not checked: they are unlimited, and a number needs its subset to say which kind is meant.
    """
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
    """Raise InputError for a weight set that does not exist or that no job uses.

    In a sweep, DWA among LME's variants may ignore it. `lme learn` names further guides, which may use it.
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
