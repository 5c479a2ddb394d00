"""What can be wrong with overrides, found before anything runs or is written."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException, MissingConfigException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from lme.errors import InputError, nearest
from lme.resources import resource_dir
from runners.config.composer import Composer, without_hydra
from runners.config.flatten import dotted_keys
from runners.config.hydra_errors import (
    expected,
    full_key,
    keys_beside,
    one_line,
    translated,
    unknown_key,
)
from runners.config.job import Job

MAX_JOBS_CHECKED = 64  # of a sweep; of larger ones every value is checked once
CUSTOM = "custom"  # the option of a group that takes a class of the user's own
OPEN_MAPPINGS = ("ablation", "scale", "guide.criteria", "space", "held_out")  # may be given new keys

Validate = Callable[[Job[Any]], None]


@dataclass(slots=True)
class Plan:
    """A command line that composes.

    overrides: as Hydra wants them. configs: by the overrides of each checked job, Hydra's own part included.
    num_jobs: of the whole sweep.
    """

    overrides: list[str]
    multirun: bool
    num_jobs: int
    configs: dict[tuple[str, ...], DictConfig]


def plan(composer: Composer, overrides: Sequence[str], multirun: bool) -> Plan:
    """Compose every job of a command line. Raises InputError where Hydra could not."""
    given = composer.parse([*_implied(composer.parse(overrides), composer), *overrides])
    own = [o.key_or_group for o in given if o.value() == CUSTOM]
    parsed = composer.parse(
        [text for o in given if (text := _normalised(o, composer, (*OPEN_MAPPINGS, *own)))]
    )
    for override in parsed:
        _check_options(override, composer)
    job = next(_jobs(parsed))
    first = _composed(composer, job)
    multirun = multirun or str(first.hydra.mode or "").endswith("MULTIRUN")
    if not multirun:
        _refuse_sweep(parsed)
        return Plan([str(o.input_line) for o in parsed], False, 1, {job: first})
    swept = composer.parse(_sweeper_params(first)) + parsed
    configs = {job: _composed(composer, job) for job in _checked_jobs(swept)}
    return Plan([str(o.input_line) for o in parsed], True, math.prod(map(len, _choices(swept))), configs)


def compose_job(composer: Composer, words: Sequence[str]) -> Job[Any]:
    """The one job of a command line, without what its command checks. Raises InputError."""
    (job,) = validated(plan(composer, words, multirun=False), composer, lambda job: None)
    return job


def validated(plan: Plan, composer: Composer, validate: Validate) -> list[Job[Any]]:
    """The checked jobs, each looked at by its command; names the user's file where a bad value came from one."""
    return [_validated(config, words, composer, validate) for words, config in plan.configs.items()]


def _validated(config: DictConfig, words: Sequence[str], composer: Composer, validate: Validate) -> Job[Any]:
    try:
        job: Job[Any] = Job.composed(without_hydra(config), config.hydra, composer.catalogue)
        validate(job)
    except InputError as error:
        raise _located(error, config, words, composer) from error
    except OmegaConfBaseException as error:
        mistake = translated(error, OmegaConf.get_type(config))
        raise _located(mistake, config, words, composer) from error
    return job


def _implied(parsed: Sequence[Override], composer: Composer) -> list[str]:
    """The choice of "custom" for every group whose class is given and no option."""
    chosen = {override.key_or_group for override in parsed}
    groups = [key.removesuffix("._target_") for key in chosen if key.endswith("._target_")]
    return [
        f"{g}={CUSTOM}" for g in sorted(groups) if g not in chosen and CUSTOM in composer.catalogue.options(g)
    ]


def _normalised(override: Override, composer: Composer, open_mappings: Sequence[str]) -> str:
    """The override without a needless `+`, with the `++` that a new key needs; "" where it says nothing."""
    text, key = override.input_line, override.key_or_group
    if override.is_hydra_override() or key.startswith("hydra/"):
        return text
    is_open = any(key.startswith(f"{name}.") for name in open_mappings) or (
        key in open_mappings and all(isinstance(value, dict) for value in _values(override))
    )
    if override.is_delete():
        if is_open:
            return text
        raise InputError(f"{text}: keys cannot be removed; give another value, or null where null is allowed")
    if key in composer.slots and override.value() is None:
        if composer.slots[key] is None:
            return ""
        raise InputError(f"{text}: must be one of {', '.join(composer.catalogue.options(key))}")
    if key not in composer.slots and composer.catalogue.options(key):
        return text  # a group of the user's own, which does need its +
    if key == "experiment":
        file = composer.catalogue.choices(key, composer.config_name).get(str(override.value()))
        return text.lstrip("+") if file is None else f"{key}={file.partition('/')[2]}"
    if "/" in key:
        raise InputError(f"{text}: no such group; there are: {', '.join(composer.slots)}")
    return f"{'++' if is_open else ''}{text.lstrip('+')}"


def _check_options(override: Override, composer: Composer) -> None:
    group = override.key_or_group
    if group not in composer.slots or override.is_delete():
        return
    known = composer.catalogue.choices(group, composer.config_name)
    for option in _values(override):
        if isinstance(option, dict):
            continue
        for name in option if isinstance(option, list) else [option]:
            if str(name) not in known and not _in_subfolder(group, str(name), composer):
                raise InputError(
                    f"{group}={name}: no such option; {nearest(str(name), known)}"
                    f"{_places(group, composer)}: {', '.join(known) or 'nothing yet'}"
                    f"{_how_to_add(group, str(name), known)}"
                )


def _values(override: Override) -> Iterator[object]:
    if override.is_discrete_sweep():
        yield from (value if isinstance(value, list | dict) else str(value).strip("'\"")
                    for value in override.sweep_iterator())  # fmt: skip
    elif not override.is_sweep_override():
        yield override.value()


def _in_subfolder(group: str, name: str, composer: Composer) -> bool:
    folders = composer.catalogue.folders
    return "/" in name and any((folder / group / f"{name}.yaml").is_file() for folder in folders)


def _how_to_add(group: str, name: str, known: Iterable[str]) -> str:
    """How a user's own option is given; empty where the name is near a known one, so probably mistyped."""
    if group == "map" and Path(name).suffix:
        return f"; a map file of your own is given by map=file map.path={name}"
    if nearest(name, known):
        return ""
    return f"; an option of your own needs --config-dir DIR, with the file DIR/{group}/{name}.yaml"


def _places(group: str, composer: Composer) -> str:
    own = [folder / group for folder in composer.catalogue.folders[1:] if (folder / group).is_dir()]
    places = " and ".join([f"conf/{group}/", *(f"{folder}/" for folder in own)])
    return f"{places} {'hold' if own else 'holds'}"


def _refuse_sweep(parsed: Sequence[Override]) -> None:
    for override in parsed:
        if override.is_sweep_override():
            key, _, value = override.input_line.partition("=")
            raise InputError(
                f"{override.input_line}: several values; add -m to run each of them, "
                f"or write {key}=[{value}] for a list"
            )


def _sweeper_params(config: DictConfig) -> list[str]:
    """Sweeps that an experiment file asks for; those on the command line come after them and win."""
    params = OmegaConf.select(config, "hydra.sweeper.params") or {}
    return [f"{key}={value}" for key, value in params.items()]


def _checked_jobs(parsed: Sequence[Override]) -> list[tuple[str, ...]]:
    """All jobs of the sweep in Hydra's order; of a very large one, each value once."""
    jobs = list(itertools.islice(_jobs(parsed), MAX_JOBS_CHECKED + 1))
    if len(jobs) <= MAX_JOBS_CHECKED:
        return jobs
    choices = _choices(parsed)
    firsts = [texts[0] for texts in choices]
    once = [(*firsts[:i], text, *firsts[i + 1 :]) for i, texts in enumerate(choices) for text in texts[1:]]
    return [tuple(firsts), *once]


def _jobs(parsed: Sequence[Override]) -> Iterator[tuple[str, ...]]:
    return itertools.product(*_choices(parsed))


def _choices(parsed: Sequence[Override]) -> list[list[str]]:
    """What each key may be; the last override of a key holds. Sweeps of no fixed values are left out."""
    choices = {}
    for override in parsed:
        key = override.get_key_element()
        if override.is_discrete_sweep():
            choices[key] = [f"{key}={value}" for value in override.sweep_string_iterator()]
        elif not override.is_sweep_override():
            choices[key] = [override.input_line]
    return [texts for texts in choices.values() if texts]


def _composed(composer: Composer, job: Sequence[str]) -> DictConfig:
    try:
        config = composer.compose(job)
    except yaml.MarkedYAMLError as error:
        raise _broken_yaml(error) from error
    except (HydraException, OmegaConfBaseException, ValueError) as error:
        raise _diagnosed(error, composer, job) from error
    known = keys_beside(OmegaConf.get_type(config), "")
    for key in sorted({str(key) for key in config} - {*known, "hydra"} if known else ()):
        raise unknown_key(key, known)  # the ++ of an open mapping makes keys that other commands have
    return config


def _broken_yaml(error: yaml.MarkedYAMLError) -> InputError:
    mark = error.problem_mark
    place = f"{mark.name}, line {mark.line + 1}" if mark else "a config file"
    return InputError(f"{place}: no valid YAML ({error.problem})")


def _diagnosed(error: Exception, composer: Composer, job: Sequence[str]) -> InputError:
    """The one override or file that makes composing fail, and why."""
    missing = error.missing_cfg_file if isinstance(error, MissingConfigException) else None
    if missing and not missing.startswith("hydra/"):
        return _no_file(missing, composer)
    file_error = re.match(r"In '([^']+)': \w+ raised while composing config:", str(error))
    if file_error:
        return _in_file(error, file_error.group(1), composer)
    dotted = [o for o in composer.parse(job) if not _is_group(o, composer)]
    groups = [text for text in job if text not in {o.input_line for o in dotted}]
    try:
        config = composer.compose(groups)
    except (HydraException, OmegaConfBaseException, ValueError):
        return InputError(f"{' '.join(job)}: {one_line(str(error))}")
    for override in dotted:
        mistake = _mistaken(override, config, composer)
        if mistake:
            return mistake
    return InputError(f"{' '.join(job)}: {one_line(str(error.__cause__ or error))}")


def _no_file(name: str, composer: Composer) -> InputError:
    """A file that the chosen options ask for, such as the search space of a planner."""
    group, _, option = name.rpartition("/")
    known = composer.catalogue.options(group)
    hint = nearest(option, known) + f"{_places(group, composer)}: {', '.join(known)}"
    return InputError(f"no {name}.yaml, which the chosen options ask for; {hint}")


def _is_group(override: Override, composer: Composer) -> bool:
    key = override.key_or_group
    return "/" in key or (bool(composer.catalogue.options(key)) and not isinstance(override.value(), dict))


def _mistaken(override: Override, config: DictConfig, composer: Composer) -> InputError | None:
    """Why this override alone does not fit the config."""
    key = override.key_or_group
    if override.is_delete():
        return None
    known = dotted_keys(OmegaConf.to_container(config, resolve=False))
    if key not in known and not override.is_force_add():
        return _unknown(key, known, config, composer)
    try:
        OmegaConf.update(config, key, override.value(), merge=True, force_add=override.is_force_add())
    except OmegaConfBaseException as error:
        schema = OmegaConf.get_type(config)
        wanted = expected(schema, key)
        shown = override.input_line.partition("=")[2] or "empty"
        whole = full_key(error) in ("", key)
        if wanted and whole:
            return InputError(f"{key} is {shown}: must be {wanted}")
        return translated(error, schema)
    return None


def _unknown(key: str, known: set[str], config: DictConfig, composer: Composer) -> InputError:
    parent = key
    while parent and parent not in known:
        parent = parent.rpartition(".")[0]
    holder = OmegaConf.select(config, parent) if parent else config
    if parent and not OmegaConf.is_dict(holder):
        return InputError(f"{key}: no such key; {parent} is a single value")
    names = sorted(str(name) for name in holder if name != "hydra")
    if not parent:
        names = sorted({*names, *composer.slots})
    hint = nearest(key, {name for name in known if not name.startswith("hydra")} | set(composer.slots))
    return InputError(f"{key}: no such key; {hint}{parent or composer.config_name} holds: {', '.join(names)}")


def _in_file(error: Exception, name: str, composer: Composer) -> InputError:
    schema = None
    if name.partition("/")[0] in composer.slots:
        schema = OmegaConf.get_type(composer.compose([]))
    message = re.sub(r"^In '[^']+': \w+ raised while composing config:\s*", "", str(error))
    mistake = translated(type(error)(message), schema)
    return InputError(f"{mistake} (in {composer.catalogue.file(name)})")


def _located(error: InputError, config: DictConfig, job: Sequence[str], composer: Composer) -> InputError:
    """Name the file, where the key that the message begins with was set by one of the user's own."""
    key = (re.match(r"[\w.]+", str(error)) or [""])[0].rstrip(".")
    group = key.partition(".")[0]
    option = config.hydra.runtime.choices.get(group)
    given = {o.key_or_group for o in composer.parse(job)} - {group}
    if not isinstance(option, str) or any(key == name or key.startswith(f"{name}.") for name in given):
        return error
    file = composer.catalogue.file(f"{group}/{option}")
    return error if file.is_relative_to(resource_dir("conf")) else InputError(f"{error} (in {file})")
