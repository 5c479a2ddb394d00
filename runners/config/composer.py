"""Hydra's parser and composer for one command, and checks of the overrides that are given to it.

`normalised` prepares overrides for Hydra and refuses options that do not exist; `refuse_conflicts` refuses overrides
that contradict each other.
"""

from __future__ import annotations

import copy
import os.path
import threading
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self, cast

import yaml
from hydra import initialize_config_dir
from hydra.core.config_loader import ConfigLoader
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, Override, Sweep
from hydra.errors import HydraException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from lme.config.composer import CUSTOM
from lme.errors import InputError, nearest
from lme.guides.lme.weight_files import PUBLISHED, find_weights
from lme.inputs.resources import resource_dir
from lme.worlds.barn.map_set import FRESH_KEYS, OFFICIAL, TARGET, check_given, is_idle
from runners.config import catalogue, schema, systems
from runners.config.catalogue import Catalogue
from runners.config.job import chosen as chosen_options
from runners.config.job import own_weights, takes_weights
from runners.config.quoting import quoted

# Errors of Hydra and OmegaConf for a config that cannot be composed.
COMPOSING = (
    HydraException, OmegaConfBaseException, yaml.YAMLError, ValueError, TypeError, OverflowError, RecursionError,
    AttributeError, AssertionError, OSError,
)  # fmt: skip
_LONGEST = 255  # [characters] of a key: a group is a folder, whose name cannot be longer
SEVERAL_OPTIONS = (systems.ABLATION,)  # groups of which a list of options may be chosen
OPEN_MAPPINGS = (  # may be given new keys
    "ablation", "scale", "guide.criteria", "space", "held_out", "training", "training_robots", "training_radius",
    "guides", "learner.expert.settings",
)  # fmt: skip
_TYPED_MAPPINGS = ("training_robots",)  # of these, the items have known keys: only their names are new
_HYDRA = threading.RLock()  # held by a composer, since Hydra has one global state for all threads


class Composer(initialize_config_dir):
    """Composer of configs within a `with` block. Hydra's global state is restored at its end.

    Other threads wait for it. A program that uses Hydra itself may use it too.
    """

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
        _HYDRA.acquire()
        self._former_hydra = GlobalHydra.instance().hydra
        GlobalHydra.instance().clear()
        try:
            super().__init__(str(resource_dir("conf")), config_name, version_base="1.3")
        except BaseException:
            self._give_back()
            raise

    def __exit__(self, *exception: Any) -> None:
        super().__exit__(*exception)
        self._give_back()

    def _give_back(self) -> None:
        GlobalHydra.instance().hydra = self._former_hydra
        _HYDRA.release()

    def __enter__(self) -> Self:  # type: ignore[override]  # Hydra's own gives nothing
        return self

    @property
    def loader(self) -> ConfigLoader:
        """Hydra's config loader."""
        return GlobalHydra.instance().config_loader()

    def parse(self, overrides: Sequence[str]) -> list[Override]:
        """Parse overrides. Raises InputError for one that is not `key=value`."""
        parser = OverridesParser.create(config_loader=cast(ConfigLoader, self))
        return [_parse(parser, override) for override in overrides]

    def get_group_options(self, group_name: str, **_: object) -> list[str]:
        """Return the options among which a glob chooses, as Hydra's parser asks for them: without files named _…."""
        return list(self.catalogue.choices(group_name, self.config_name))

    def canonical(self, overrides: Sequence[str]) -> frozenset[tuple[str, str]]:
        """Return the overrides of a job, independent of order and spelling, without those of Hydra's own part."""
        return frozenset(
            (override.get_key_element(), override.get_value_element_as_str())
            for override in self.parse(overrides)
            if not override.is_hydra_override()
        )

    def compose(self, overrides: Sequence[str], mode: RunMode = RunMode.RUN) -> DictConfig:
        """Compose the whole config, Hydra's own part included; in MULTIRUN without the swept overrides.

        Raises what Hydra and OmegaConf raise, and InputError for a user's file that Hydra would unfold without end.
        """
        if self._config_dir is not None:
            for override in self.parse(overrides):
                file = self._config_dir / override.key_or_group / f"{override.value()}.yaml"
                if os.path.isfile(file):  # noqa: PTH113  (Path.is_file raises for long names)
                    catalogue.check_structure_of(file)
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

    def _with_search_path(self, overrides: Sequence[str]) -> list[str]:
        """Add the config directory to the search path, as Hydra's --config-dir does."""
        if self._config_dir is None:
            return list(overrides)
        search_paths = [o for o in overrides if o.startswith("hydra.searchpath=")]
        others = [o for o in overrides if o not in search_paths]
        lists = [override.value() for override in self.parse(search_paths)]
        other_folders = [str(folder) for places in lists if isinstance(places, list) for folder in places]
        places = ",".join(quoted(folder) for folder in (f"file://{self._config_dir}", *other_folders))
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


def normalised(overrides: Sequence[str], composer: Composer) -> list[Override]:
    """Return the overrides without a needless `+`, with the `++` that a new key needs, and with implied choices.

    Raises InputError for one that cannot be read, and for an option or a group that does not exist.
    """
    parsed_all = composer.parse([*_implied(composer.parse(overrides), composer), *overrides])
    for override in parsed_all:
        if len(override.key_or_group) > _LONGEST:
            raise InputError(f"{override.key_or_group:.40}…: no such key or group")
    custom = [override.key_or_group for override in parsed_all if override.value() == CUSTOM]
    texts = (_normalised(override, composer, (*OPEN_MAPPINGS, *custom)) for override in parsed_all)
    parsed = composer.parse([text for text in texts if text])
    for override in parsed:
        _check_options(override, composer)
    return parsed


def text_of(override: Override) -> str:
    """Return an override as it was written."""
    return str(override.input_line)


def places(group: str, catalogue: Catalogue) -> str:
    """Return the folders that hold the options of a group, with a verb: "conf/robot/ holds"."""
    own = [folder / group for folder in catalogue.folders[1:] if (folder / group).is_dir()]
    names = " and ".join([f"conf/{group}/", *(f"{folder}/" for folder in own)])
    return f"{names} {'hold' if own else 'holds'}"


def _implied(parsed: Sequence[Override], composer: Composer) -> list[str]:
    """Return the choice of "custom" for every group that is given a class and no option."""
    chosen = {override.key_or_group for override in parsed}
    groups = [key.removesuffix("._target_") for key in chosen if key.endswith("._target_")]
    return [
        f"{g}={CUSTOM}" for g in sorted(groups) if g not in chosen and CUSTOM in composer.catalogue.options(g)
    ]


def _normalised(override: Override, composer: Composer, open_mappings: Sequence[str]) -> str:
    """Return the override without a needless `+` and with the `++` of a new key; "" if it has no effect."""
    text, key = text_of(override), override.key_or_group
    if override.is_hydra_override() or key.startswith("hydra/"):
        return text
    # Is the key in a mapping that takes new keys, or all of such a mapping?
    is_typed = any(key.startswith(f"{name}.") and key.count(".") > 1 for name in _TYPED_MAPPINGS)
    is_open = (not is_typed and any(key.startswith(f"{name}.") for name in open_mappings)) or (
        key in open_mappings and all(isinstance(value, dict) for value in _values(override))
    )
    # Removing a key, or choosing no option.
    if override.is_delete():
        if is_open:
            return text
        raise InputError(f"{text}: keys cannot be removed; give another value, or null where null is allowed")
    if key in composer.slots and override.value() is None:
        if composer.slots[key] is None:
            return ""
        raise InputError(f"{text}: must be one of {', '.join(composer.catalogue.options(key))}")
    # Groups: under a new name, of the user's own, and experiments, which may lie in the command's folder.
    if override.package and f"{key}@{override.package}" not in composer.slots:
        return f"+{text.lstrip('+')}"  # for example another map set under a name
    if key not in composer.slots and composer.catalogue.options(key):
        if not isinstance(override.value(), dict):  # otherwise a key with the name of a group
            _check_own_group(text, key, composer)
        return text  # a group of the user's own, which needs its +
    if key == "experiment":
        file = composer.catalogue.choices(key, composer.config_name).get(str(override.value()))
        return text.lstrip("+") if file is None else f"{key}={file.partition('/')[2]}"
    # Any other name with a slash is an unknown group; keys and chosen options need no +, new keys need ++.
    if "/" in key:
        raise InputError(f"{text}: no such group; there are: {', '.join(composer.slots)}")
    return f"{'++' if is_open else ''}{text.lstrip('+')}"


def _check_own_group(text: str, group: str, composer: Composer) -> None:
    """Raise InputError for a group of other commands, and for a group of the user's own without the +."""
    shipped = Catalogue(composer.catalogue.folders[:1])
    if shipped.options(group):
        others = [f"lme {name}" for name in schema.COMMANDS if group in shipped.groups(name)]
        theirs = f"{group} is a group of {', '.join(others)}; " if others else ""
        raise InputError(f"{text}: no such group; {theirs}there are: {', '.join(composer.slots)}")
    if not text.startswith("+"):
        raise InputError(
            f"{text}: {group} is not in the defaults of {composer.config_name}: add it with +{text}"
        )


def _check_options(override: Override, composer: Composer) -> None:
    group = override.key_or_group
    if group not in composer.slots or override.is_delete():
        return
    known = composer.catalogue.choices(group, composer.config_name)
    if isinstance(override.value(), Glob) and not any(_values(override)):
        raise InputError(
            f"{text_of(override)}: matches no option; {places(group, composer.catalogue)}: {', '.join(known)}"
        )
    for option in _values(override):
        if isinstance(option, dict):
            continue
        if isinstance(option, list) and group not in SEVERAL_OPTIONS:
            # Hydra would merge the files of several options, and keep what the last of them does not set.
            several = ",".join(map(str, option))
            raise InputError(
                f"{group}=[{several}]: {group} takes one option; several are a sweep: -m {group}={several}"
            )
        names = option if isinstance(option, list) else [option]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise InputError(f"{text_of(override)}: names {twice} twice; omit one")
        for name in names:
            in_subfolder = "/" in str(name) and composer.catalogue.has(f"{group}/{name}")
            if str(name) not in known and not in_subfolder:
                likely = [option for option in known if (group, option) != (systems.ABLATION, "none")]
                raise InputError(
                    f"{group}={name}: no such option; {nearest(str(name), likely)}"
                    f"{places(group, composer.catalogue)}: {', '.join(known) or 'nothing yet'}"
                    f"{_how_to_add(group, str(name), known)}"
                )


def _values(override: Override) -> Iterator[object]:
    if override.is_discrete_sweep():
        yield from (value if isinstance(value, list | dict) else str(value).strip("'\"")
                    for value in override.sweep_iterator())  # fmt: skip
    elif not override.is_sweep_override():
        yield override.value()


def _how_to_add(group: str, name: str, known: Iterable[str]) -> str:
    """Return advice on giving an option of one's own; empty if the name is probably a mistyped known one."""
    if group == "map" and Path(name).suffix:
        return f"; a map file of your own is given by map=file map.path={name}"
    if nearest(name, known):
        return ""
    option = Path(name).stem if Path(name).suffix.lower() in (".yaml", ".yml") else name
    return f"; {group}={option}, an option of your own, needs --config-dir DIR, with the file DIR/{group}/{option}.yaml"


def refuse_conflicts(
    overrides: Sequence[Override], configs: Collection[DictConfig], catalogue: Catalogue
) -> None:
    """Raise InputError for a key with two values, worlds outside their given subset, and values that no job uses.

    overrides: as they were typed; they may replace the values of a file or of a resumed run. configs: those of
    the jobs that they give. catalogue: of the options.
    """
    texts: dict[str, str] = {}
    for override in overrides:
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
    setting = (
        text for key, text in texts.items() if key.partition(".")[0] in (systems.ABLATION, "experiment")
    )
    if text := next(setting, ""):
        _check_ablation(text, configs)
    if "system" in texts:
        groups = ("system", "experiment", *systems.PAIR)
        choices = (chosen_options(config.hydra) for config in configs)
        # Jobs of a sweep share their choices: check each once.
        for options in dict.fromkeys(tuple(each.get(group, "") for group in groups) for each in choices):
            _check_system(dict(zip(groups, options, strict=True)), set(texts), catalogue)


def _check_fresh(key: str, configs: Collection[DictConfig]) -> None:
    """Raise InputError for a key of fresh worlds if no job drives any; in a sweep some jobs may drive none."""
    node, _, name = key.rpartition(".")
    if name not in FRESH_KEYS:
        return
    nodes = [OmegaConf.select(config, node) for config in configs]
    if nodes and all(OmegaConf.is_dict(values) and is_idle(name, values) for values in nodes):
        check_given([name], nodes[0], node)


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


def _check_ablation(text: str, configs: Collection[DictConfig]) -> None:
    """Raise InputError for an ablation of parameters if no guide here has any; in a sweep some may have none."""
    plain: list[Any] = [OmegaConf.to_container(without_hydra(config), resolve=False) for config in configs]
    if any(config["ablation"] for config in plain) and not any(
        "learner" in config or takes_weights(config) for config in plain
    ):
        raise InputError(
            f"{text}: this ablation sets parameters of a guide, and no guide here has any; omit it, or choose a guide "
            "such as guide=lme"
        )


def _check_system(choices: Mapping[str, str], typed: Collection[str], catalogue: Catalogue) -> None:
    """Raise InputError if an experiment replaces the guide or the planner of the system that was typed."""
    name = choices["system"]
    if not catalogue.has(f"system/{name}"):
        return
    pair = catalogue.option(f"system/{name}").choices
    for group in systems.PAIR:
        if group not in typed and choices[group] != pair.get(group):
            raise InputError(
                f"system={name}: experiment={choices['experiment']} chooses {group}={choices[group]} instead; "
                "give guide= and planner=, or let the experiment choose by `override /system`"
            )


def _drives_with_weights(config: Mapping[str, Any]) -> bool:
    """Return whether an unresolved config follows its key `weights`; a guide with its own set ignores the paper's."""
    replaced = config["weights"] == PUBLISHED and own_weights(config["guide"]) not in (None, PUBLISHED)
    return takes_weights(config) and not replaced
