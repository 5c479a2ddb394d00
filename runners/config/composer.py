"""Hydra's parser and composer for one command."""

from __future__ import annotations

import copy
import os.path
from collections.abc import Sequence
from pathlib import Path
from typing import Self

import yaml
from hydra import initialize_config_dir
from hydra.core.config_loader import ConfigLoader
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override, Sweep
from hydra.errors import HydraException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from lme.errors import InputError
from lme.inputs.resources import resource_dir
from runners.config import catalogue, schema
from runners.config.quoting import quoted

# Errors of Hydra and OmegaConf for a config that cannot be composed.
COMPOSING = (
    HydraException, OmegaConfBaseException, yaml.YAMLError, ValueError, TypeError, OverflowError, RecursionError,
    AttributeError, AssertionError, OSError,
)  # fmt: skip


class Composer(initialize_config_dir):
    """Composer of configs within a `with` block. Hydra's global state is restored at its end."""

    def __init__(self, config_name: str, config_dir: Path | None = None) -> None:
        """Set the config folders. config_dir: the user's own options. Raises InputError without a config."""
        self.config_name = config_name
        self.catalogue = catalogue.shipped(*([config_dir] if config_dir else []))
        self._config_dir = config_dir
        self.slots = self.catalogue.groups(config_name) if self.catalogue.has(config_name) else {}
        if not self.slots:
            places = ", ".join(str(folder) for folder in self.catalogue.folders)
            raise InputError(f"config {config_name}: no {config_name}.yaml with defaults in {places}")
        schema.register()
        super().__init__(str(resource_dir("conf")), config_name, version_base="1.3")

    def __enter__(self) -> Self:  # type: ignore[override]  # Hydra's own gives nothing
        return self

    @property
    def loader(self) -> ConfigLoader:
        """Hydra's config loader."""
        return GlobalHydra.instance().config_loader()

    def parse(self, overrides: Sequence[str]) -> list[Override]:
        """Parse overrides. Raises InputError for one that is not `key=value`."""
        parser = OverridesParser.create(config_loader=self.loader)
        return [_parse(parser, override) for override in overrides]

    def canonical(self, overrides: Sequence[str]) -> frozenset[tuple[str, str]]:
        """Return the overrides of a job, independent of order and spelling, without those of Hydra's own part."""
        own = [override for override in self.parse(overrides) if not override.is_hydra_override()]
        return frozenset((each.get_key_element(), each.get_value_element_as_str()) for each in own)

    def compose(self, overrides: Sequence[str], mode: RunMode = RunMode.RUN) -> DictConfig:
        """Compose the whole config, Hydra's own part included; in MULTIRUN without the swept overrides.

        Raises what Hydra and OmegaConf raise.
        """
        self._check_own_options(overrides)
        words = self._with_search_path(overrides)
        config = self.loader.load_configuration(self.config_name, words, mode, from_shell=False)
        self._complete_own_options(config)
        return config

    def _complete_own_options(self, config: DictConfig) -> None:
        """Add the keys that the user's files for shipped classes leave out, as `lme.config.composer` does."""
        if self._config_dir is None:
            return
        with read_write(config), open_dict(config):
            for choice, name in config.hydra.runtime.choices.items():
                group, _, package = str(choice).partition("@")
                file = self._config_dir / group / f"{name}.yaml"
                node = package or group.replace("/", ".")
                own = OmegaConf.select(config, node)
                if os.path.isfile(file) and OmegaConf.is_dict(own) and "_target_" in own:  # noqa: PTH113
                    complete = OmegaConf.merge(self.catalogue.values(f"{group}/{name}"), own)
                    OmegaConf.update(config, node, complete, merge=False)

    def _check_own_options(self, overrides: Sequence[str]) -> None:
        """Raise InputError for a user's file that Hydra would unfold without end."""
        if self._config_dir is None:
            return
        for override in self.parse(overrides):
            file = self._config_dir / override.key_or_group / f"{override.value()}.yaml"
            if os.path.isfile(file):  # noqa: PTH113  (Path.is_file raises for long names)
                catalogue.check_structure_of(file)

    def _with_search_path(self, overrides: Sequence[str]) -> list[str]:
        """Add the config directory to the search path, as Hydra's --config-dir does."""
        if self._config_dir is None:
            return list(overrides)
        given = [o for o in overrides if o.startswith("hydra.searchpath=")]
        others = [o for o in overrides if o not in given]
        lists = [override.value() for override in self.parse(given)]
        more = [str(place) for places in lists if isinstance(places, list) for place in places]
        places = ",".join(quoted(place) for place in (f"file://{self._config_dir}", *more))
        return [f"hydra.searchpath=[{places}]", *others]


def without_hydra(config: DictConfig) -> DictConfig:
    """Return a copy of a composed config without Hydra's own part."""
    own = copy.deepcopy(config)
    with read_write(own), open_dict(own):
        own.pop("hydra", None)
    return own


def _parse(parser: OverridesParser, override: str) -> Override:
    key, equals, value = override.partition("=")
    if not equals and not override.startswith("~"):
        raise InputError(f"{override}: must be key=value, e.g. {key or 'seed'}=...")
    if equals and not key.strip("+"):
        raise InputError(f"{override}: must be key=value; the key is missing")
    try:
        parsed = parser.parse_overrides([override])[0]
    except OverrideParseException as error:
        raise InputError(
            f"{override}: the value {value} cannot be read: close every bracket and quote, "
            f"and quote special characters, e.g. \"{key}='...'\""
        ) from error
    if not parsed.is_sweep_override() and _holds_sweep(parsed.value()):
        raise InputError(f"{override}: several values within a list or a mapping; must be single values")
    return parsed


def _holds_sweep(value: object) -> bool:
    """Return whether part of a value is a sweep such as range(5), which only a whole value may be."""
    if isinstance(value, dict):
        return any(map(_holds_sweep, value.values()))
    return any(map(_holds_sweep, value)) if isinstance(value, list) else isinstance(value, Sweep)
