"""Ablations of another system than the one that is chosen: what to say where building the system fails on them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lme.errors import InputError
from lme.inputs.resources import resource_dir
from runners.config import ablations
from runners.config.catalogue import Catalogue
from runners.config.flatten import dotted_keys
from runners.config.weights import parameter_names

PAIR = ("guide", "planner")  # whose options differ in their keys


def explained(error: InputError, choices: Mapping[str, str], catalogue: Catalogue) -> InputError:
    """The error, or one that names the ablation whose key or parameter it is about."""
    for name in choices.get(ablations.GROUP, "").split(ablations.SEVERAL):
        settings = ablations.settings(name, catalogue)
        for group in PAIR:
            wanted = _wanted(settings, group)
            about = [key for key in sorted(wanted) if _is_about(error, key)]
            if about:
                return _misfit(error, name, about[0], group, choices, catalogue)
    return error


def _wanted(settings: Mapping[str, Any], group: str) -> set[str]:
    """The dotted keys of a group that an ablation sets; "parameters.a_reach" for a parameter, which the guide has."""
    own = settings.get(group)
    keys = {f"{group}.{key}" for key in dotted_keys(own)} if isinstance(own, dict) else set()
    if group == "guide":
        keys |= {f"guide.parameters.{name}" for name in settings.get(ablations.GROUP) or {}}
    return keys


def _is_about(error: InputError, key: str) -> bool:
    unknown = f"parameter {key.rpartition('.')[2]!r} is unknown"
    return str(error).startswith((f"{key}:", f"{key} ", unknown))


def _misfit(
    error: InputError, name: str, key: str, group: str, choices: Mapping[str, str], catalogue: Catalogue
) -> InputError:
    file = catalogue.file(f"{ablations.GROUP}/{name}")
    fitting = [option for option in catalogue.options(group) if key in _keys(group, option, catalogue)]
    if choices.get(group) in fitting or not fitting:  # a wrong value, or a key that nothing has
        return error if file.is_relative_to(resource_dir("conf")) else InputError(f"{error} (in {file})")
    title = catalogue.title(f"{ablations.GROUP}/{name}")
    return InputError(
        f"ablation={name} ({title}) sets {key}, which {group}={choices.get(group)} does not have; "
        f"must go with {' or '.join(f'{group}={option}' for option in fitting)}"
    )


def _keys(group: str, option: str, catalogue: Catalogue) -> set[str]:
    """The dotted keys of an option, with the parameters of a guide's weight set."""
    values = catalogue.values(f"{group}/{option}")
    names = parameter_names(values) if group == "guide" else []
    return {f"{group}.{key}" for key in dotted_keys(values)} | {f"guide.parameters.{name}" for name in names}
