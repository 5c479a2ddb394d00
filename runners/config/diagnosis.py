"""Diagnose a command line that does not compose: the override or file at fault, and what would be right."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import yaml
from hydra.core.override_parser.types import Override
from hydra.errors import MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import GrammarParseError, OmegaConfBaseException

from lme.errors import InputError, nearest
from lme.inputs.resources import resource_dir
from lme.requirements import install
from runners.config import catalogue, systems
from runners.config.changes import dotted_keys
from runners.config.composer import COMPOSING, Composer, places, text_of
from runners.config.instantiate import describe_expected, full_key, keys_beside, one_line, translate_error
from runners.config.job import chosen

# Options of Hydra's own plugins, each in a package such as hydra-joblib-launcher.
_PLUGIN = re.compile(r"hydra/(launcher|sweeper)/(ax|joblib|nevergrad|optuna|ray|rq|submitit)(_\w+)?")


def diagnose(error: Exception, composer: Composer, job: Sequence[str]) -> InputError:
    """Find the override or file that makes composing fail. The error says why."""
    # Mistakes that the error itself locates: broken YAML, a missing file or plugin, an error in a file.
    if isinstance(error, yaml.YAMLError):
        return _broken_yaml(error)
    if isinstance(error.__cause__, GrammarParseError) and not str(error):
        return _broken_interpolation(error.__cause__, composer)
    missing = error.missing_cfg_file if isinstance(error, MissingConfigException) else None
    if missing and not missing.startswith("hydra/"):
        return _no_file(missing, composer)
    plugin = _PLUGIN.fullmatch(missing or "")
    if missing and plugin:
        group, _, option = missing.rpartition("/")
        package = f"hydra-{plugin[2]}-{plugin[1]}"
        return InputError(f"{group}={option}: is not installed; {install(package)} installs it")
    file_error = re.match(r"In '([^']+)': \w+ raised while composing config:", str(error))
    if file_error:
        return _in_file(error, file_error.group(1), composer)
    # Otherwise compose the chosen options alone, and add the other overrides one by one until one fails.
    dotted = [o for o in composer.parse(job) if not _is_group(o, composer)]
    groups = [text for text in job if text not in {text_of(o) for o in dotted}]
    try:
        config = composer.compose(groups)
    except COMPOSING:
        is_in_file = isinstance(error, RecursionError) or "Invalid loaded object" in str(error)
        mistake = _in_option(groups, composer) if is_in_file else None
        return mistake or InputError(f"{' '.join(job)}: {one_line(str(error))}")
    for override in dotted:
        mistake = _find_mistake(override, config, composer)
        if mistake:
            return mistake
    return InputError(f"{' '.join(job)}: {one_line(str(error.__cause__ or error))}")


def _in_option(groups: Sequence[str], composer: Composer) -> InputError | None:
    """Return the error of a chosen option whose file is no mapping or inherits itself; None if there is none."""
    for override in composer.parse(groups):
        name = f"{override.key_or_group}/{override.value()}"
        if composer.catalogue.has(name):
            try:
                composer.catalogue.option(name)
            except InputError as mistake:
                return mistake
    return None


def _broken_yaml(error: yaml.YAMLError) -> InputError:
    mark = getattr(error, "problem_mark", None)  # none for a character that YAML does not allow
    position = f"{mark.name}, line {mark.line + 1}" if mark else "a config file"
    return InputError(
        f"{position}: not valid YAML ({one_line(getattr(error, 'problem', None) or str(error))})"
    )


def _broken_interpolation(error: GrammarParseError, composer: Composer) -> InputError:
    """Find the user's file with the interpolation that OmegaConf cannot read; Hydra does not name it."""
    folders = [folder / group for folder in composer.catalogue.folders[1:] for group in (*composer.slots, "")]
    for file in (file for folder in folders for file in sorted(folder.glob("*.yaml"))):
        try:
            catalogue.check_structure_of(file)
            OmegaConf.load(file)
        except GrammarParseError as same:
            if (full_key(same), same.value) == (full_key(error), error.value):
                return InputError(f"{translate_error(error)} (in {file})")
        except (InputError, *COMPOSING):
            continue  # another mistake, in a file that may not be used
    return translate_error(error)


def _no_file(name: str, composer: Composer) -> InputError:
    """Return the error of a missing file that the chosen options need, such as a planner's search space."""
    group, _, option = name.rpartition("/")
    known = composer.catalogue.options(group)
    hint = nearest(option, known) + f"{places(group, composer.catalogue)}: {', '.join(known)}"
    return InputError(f"no {name}.yaml, which the chosen options ask for; {hint}")


def _is_group(override: Override, composer: Composer) -> bool:
    key = override.key_or_group
    return "/" in key or (bool(composer.catalogue.options(key)) and not isinstance(override.value(), dict))


def _find_mistake(override: Override, config: DictConfig, composer: Composer) -> InputError | None:
    """Return the reason why this override alone does not fit the config; None if it fits."""
    key = override.key_or_group
    if override.is_delete():
        return None
    plain: Any = OmegaConf.to_container(config, resolve=False)
    known = dotted_keys(plain)
    if key not in known and not override.is_force_add():
        return _unknown(key, known, config, composer)
    # The key exists or may be added, so apply the override; the config keeps it for the next ones.
    try:
        OmegaConf.update(config, key, override.value(), merge=True, force_add=override.is_force_add())
    except GrammarParseError as error:
        return translate_error(error)
    except (OmegaConfBaseException, TypeError, OverflowError, AttributeError) as error:
        schema = OmegaConf.get_type(config)
        expected = describe_expected(schema, key)
        value = text_of(override).partition("=")[2] or "empty"
        whole = full_key(error) in ("", key)
        if expected and whole:
            return InputError(f"{key} is {value}: must be {expected}")
        return translate_error(error, schema)
    except (ValueError, AssertionError):  # a word as index of a list, or a key below a null
        return _unknown(key, known, config, composer)
    return None


def _unknown(key: str, known: set[str], config: DictConfig, composer: Composer) -> InputError:
    parent = key
    while parent and parent not in known:
        parent = parent.rpartition(".")[0]
    try:
        holder = OmegaConf.select(config, parent) if parent else config
    except OmegaConfBaseException as error:  # an interpolation set by another override
        return translate_error(error)
    if parent and holder is None:
        keys = ", ".join(keys_beside(OmegaConf.get_type(config), key))
        return InputError(f"{key}: {parent} is null: set all of it, {parent}={{…}}; it has the keys {keys}")
    if parent and not OmegaConf.is_dict(holder):
        return InputError(f"{key}: no such key; {parent} is a single value")
    names = sorted(str(name) for name in holder if name != "hydra")
    if not parent:
        names = sorted({*names, *composer.slots})
    others = {name for name in known if not name.startswith("hydra")} | set(composer.slots)
    hint = nearest(key, {name for name in others if nearest(_last(key), [_last(name)])})
    if parent and not names:
        return InputError(f"{key}: no such key; {hint}{_empty(parent, config, composer)}")
    return InputError(f"{key}: no such key; {hint}{parent or composer.config_name} holds: {', '.join(names)}")


def _empty(group: str, config: DictConfig, composer: Composer) -> str:
    """Explain why a part of the config has no keys, with advice if other options of the group have some."""
    option = chosen(config.hydra).get(group, "")
    filled = [
        name for name in composer.catalogue.options(group) if composer.catalogue.keys(f"{group}/{name}")
    ]
    if not option or not filled:
        return f"{group} is empty"
    return f"{group}={option} has no keys: choose {group}={' or '.join(filled)} first"


def _last(key: str) -> str:
    """Return the last part of a dotted key, to compare: keys with a long common parent always look alike."""
    return key.rpartition(".")[2]


def _in_file(error: Exception, name: str, composer: Composer) -> InputError:
    schema = None
    if name.partition("/")[0] in composer.slots:
        schema = OmegaConf.get_type(composer.compose([]))
    try:
        composer.catalogue.option(name)
    except InputError as wrong_file:  # not a mapping, for example
        return wrong_file
    message = re.sub(r"^In '[^']+': \w+ raised while composing config:\s*", "", str(error))
    mistake = translate_error(type(error)(message), schema)
    return InputError(f"{mistake} (in {composer.catalogue.file(name)})")


def add_location(error: InputError, config: DictConfig, job: Sequence[str], composer: Composer) -> InputError:
    """Add the file that sets the key with which a message begins: an ablation's, or one of the user's own options."""
    key = (re.match(r"[\w.]+", str(error)) or [""])[0].rstrip(".")
    group = key.partition(".")[0]
    typed = {override.key_or_group for override in composer.parse(job)} - {group}
    if any(key == name or key.startswith(f"{name}.") for name in typed):
        return error
    # The value may be wrong only beside another that was typed: range_max is 12: must be greater than range_min 20.
    bounds = {f"{key.rpartition('.')[0]}.{name}" for name in re.findall(r" than (\w+)", str(error))}
    if bounds & typed:
        return error
    for name in chosen(config.hydra).get(systems.ABLATION, "").split(systems.SEVERAL):
        settings = systems.ablation_settings(name, composer.catalogue)
        unknown = tuple(f"parameter {name!r} is unknown" for name in settings.get(systems.ABLATION) or {})
        if key in dotted_keys(settings) or str(error).startswith(unknown):
            return InputError(f"{error} (in {composer.catalogue.file(f'{systems.ABLATION}/{name}')})")
    option = config.hydra.runtime.choices.get(group)
    if not isinstance(option, str):
        return error
    file = composer.catalogue.file(f"{group}/{option}")
    return error if file.is_relative_to(resource_dir("conf")) else InputError(f"{error} (in {file})")
