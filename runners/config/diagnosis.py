"""Why a command line does not compose: the override or file at fault, and what would be right."""

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
from runners.config import catalogue
from runners.config.composer import COMPOSING, Composer
from runners.config.flatten import dotted_keys
from runners.config.hydra_errors import describe_expected, full_key, keys_beside, one_line, translate_error
from runners.config.job import chosen
from runners.config.misfits import explained
from runners.config.overrides import places, text_of

_PLUGINS = {  # the packages of Hydra's own plugins
    "hydra/launcher/joblib": "hydra-joblib-launcher",
    "hydra/launcher/ray": "hydra-ray-launcher",
    "hydra/launcher/rq": "hydra-rq-launcher",
    "hydra/launcher/submitit_local": "hydra-submitit-launcher",
    "hydra/launcher/submitit_slurm": "hydra-submitit-launcher",
    "hydra/sweeper/ax": "hydra-ax-sweeper",
    "hydra/sweeper/nevergrad": "hydra-nevergrad-sweeper",
    "hydra/sweeper/optuna": "hydra-optuna-sweeper",
}


def diagnose(error: Exception, composer: Composer, job: Sequence[str]) -> InputError:
    """Find the override or file that makes composing fail. The error says why."""
    if isinstance(error, yaml.YAMLError):
        return _broken_yaml(error)
    if isinstance(error.__cause__, GrammarParseError) and not str(error):
        return _broken_interpolation(error.__cause__, composer)
    missing = error.missing_cfg_file if isinstance(error, MissingConfigException) else None
    if missing and not missing.startswith("hydra/"):
        return _no_file(missing, composer)
    if missing in _PLUGINS:
        group, _, option = missing.rpartition("/")
        return InputError(f"{group}={option}: is not installed; {install(_PLUGINS[missing])} installs it")
    file_error = re.match(r"In '([^']+)': \w+ raised while composing config:", str(error))
    if file_error:
        return _in_file(error, file_error.group(1), composer)
    dotted = [o for o in composer.parse(job) if not _is_group(o, composer)]
    groups = [text for text in job if text not in {text_of(o) for o in dotted}]
    try:
        config = composer.compose(groups)
    except COMPOSING:
        return InputError(f"{' '.join(job)}: {one_line(str(error))}")
    for override in dotted:
        mistake = _find_mistake(override, config, composer)
        if mistake:
            return mistake
    return InputError(f"{' '.join(job)}: {one_line(str(error.__cause__ or error))}")


def _broken_yaml(error: yaml.YAMLError) -> InputError:
    mark = getattr(error, "problem_mark", None)  # none for a character that YAML does not allow
    place = f"{mark.name}, line {mark.line + 1}" if mark else "a config file"
    return InputError(f"{place}: not valid YAML ({one_line(getattr(error, 'problem', None) or str(error))})")


def _broken_interpolation(error: GrammarParseError, composer: Composer) -> InputError:
    """Hydra does not say which of the user's files holds the interpolation that OmegaConf cannot read."""
    folders = [folder / group for folder in composer.catalogue.folders[1:] for group in (*composer.slots, "")]
    for file in (file for folder in folders for file in sorted(folder.glob("*.yaml"))):
        try:
            catalogue.check_structure_of(file)
            OmegaConf.load(file)
        except GrammarParseError as same:
            if (full_key(same), same.value) == (full_key(error), error.value):
                return InputError(f"{translate_error(error)} (in {file})")
        except (InputError, *COMPOSING):
            continue  # nothing has asked for this file
    return translate_error(error)


def _no_file(name: str, composer: Composer) -> InputError:
    """A file is missing that the chosen options need, such as the search space of a planner."""
    group, _, option = name.rpartition("/")
    known = composer.catalogue.options(group)
    hint = nearest(option, known) + f"{places(group, composer.catalogue)}: {', '.join(known)}"
    return InputError(f"no {name}.yaml, which the chosen options ask for; {hint}")


def _is_group(override: Override, composer: Composer) -> bool:
    key = override.key_or_group
    return "/" in key or (bool(composer.catalogue.options(key)) and not isinstance(override.value(), dict))


def _find_mistake(override: Override, config: DictConfig, composer: Composer) -> InputError | None:
    """Why this override alone does not fit the config."""
    key = override.key_or_group
    if override.is_delete():
        return None
    plain: Any = OmegaConf.to_container(config, resolve=False)
    known = dotted_keys(plain)
    if key not in known and not override.is_force_add():
        return _unknown(key, known, config, composer)
    try:
        OmegaConf.update(config, key, override.value(), merge=True, force_add=override.is_force_add())
    except GrammarParseError as error:
        return translate_error(error)
    except (OmegaConfBaseException, TypeError, OverflowError, AttributeError) as error:
        schema = OmegaConf.get_type(config)
        wanted = describe_expected(schema, key)
        shown = text_of(override).partition("=")[2] or "empty"
        whole = full_key(error) in ("", key)
        if wanted and whole:
            return InputError(f"{key} is {shown}: must be {wanted}")
        return translate_error(error, schema)
    except (ValueError, AssertionError):  # a word as the index of a list, or a key in a part that is null
        return _unknown(key, known, config, composer)
    return None


def _unknown(key: str, known: set[str], config: DictConfig, composer: Composer) -> InputError:
    parent = key
    while parent and parent not in known:
        parent = parent.rpartition(".")[0]
    try:
        holder = OmegaConf.select(config, parent) if parent else config
    except OmegaConfBaseException as error:  # an interpolation that another override has put there
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
    """Why a part of the config has no keys, and what to do if it is a group that has others."""
    option = chosen(config.hydra).get(group, "")
    filled = [
        name for name in composer.catalogue.options(group) if composer.catalogue.keys(f"{group}/{name}")
    ]
    if not option or not filled:
        return f"{group} is empty"
    return f"{group}={option} has no keys: choose {group}={' or '.join(filled)} first"


def _last(key: str) -> str:
    """The last part of a dotted key: two keys of one parent look alike by their parent alone."""
    return key.rpartition(".")[2]


def _in_file(error: Exception, name: str, composer: Composer) -> InputError:
    schema = None
    if name.partition("/")[0] in composer.slots:
        schema = OmegaConf.get_type(composer.compose([]))
    message = re.sub(r"^In '[^']+': \w+ raised while composing config:\s*", "", str(error))
    mistake = translate_error(type(error)(message), schema)
    return InputError(f"{mistake} (in {composer.catalogue.file(name)})")


def add_location(error: InputError, config: DictConfig, job: Sequence[str], composer: Composer) -> InputError:
    """Add the user's file to a message, if that file sets the key that the message begins with; or the ablation."""
    ablated = explained(error, chosen(config.hydra), composer.catalogue)
    if ablated is not error:
        return ablated
    key = (re.match(r"[\w.]+", str(error)) or [""])[0].rstrip(".")
    group = key.partition(".")[0]
    option = config.hydra.runtime.choices.get(group)
    given = {o.key_or_group for o in composer.parse(job)} - {group}
    if not isinstance(option, str) or any(key == name or key.startswith(f"{name}.") for name in given):
        return error
    file = composer.catalogue.file(f"{group}/{option}")
    return error if file.is_relative_to(resource_dir("conf")) else InputError(f"{error} (in {file})")
