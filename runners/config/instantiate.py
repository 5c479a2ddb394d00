"""Build the object that a config node with a `_target_` describes.

The class that `_target_` names has an attribute `Config`, a dataclass: the node's other keys are checked
against its fields, and the class is called with an instance of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, cast

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import ConfigKeyError, OmegaConfBaseException

from lme.errors import InputError, building, nearest
from lme.inputs.user_code import import_module
from runners.config.hydra_errors import describe_expected, full_key, translate_error


def build(node: DictConfig | Mapping[str, Any], key: str, *args: Any) -> Any:
    """Build the object that `node` describes: its class called with its Config and `args`.

    key: key of the node in the config ("planner"), for messages. Raises InputError naming key, value
    and what would be right.
    """
    cls, config = configured(node, key)
    with building(key):
        return cls(config, *args)


def configured(node: DictConfig | Mapping[str, Any], key: str) -> tuple[Any, Any]:
    """Return the class and the checked Config instance of `node`, without making the object itself."""
    given = _plain(node, key)
    cls = _class(given.pop("_target_", None), key)
    return cls, fill_dataclass(cls.Config, given, key)


def config_class(target: Any, key: str) -> Any:
    """Return the dataclass that checks the keys next to `_target_: target`. Raises InputError if there is none."""
    return _class(target, key).Config


def fill_dataclass(schema: Any, given: DictConfig | Mapping[str, Any], key: str) -> Any:
    """Return an instance of the dataclass `schema` with the values `given`.

    Raises InputError for a key that it lacks, a value of the wrong type, or a value that is missing.
    """
    node = OmegaConf.structured(schema)
    for name, value in _plain(given, key).items():
        try:
            node.merge_with({name: value})
        except (OmegaConfBaseException, OverflowError) as error:
            raise _mistake(error, schema, name, value, key) from error
    try:
        return typed(node, key)
    except OmegaConfBaseException as error:
        raise _at(key, translate_error(error, schema)) from error


def typed(node: Any, key: str = "") -> Any:
    """Return the dataclasses, mappings, lists and values of a config, as `OmegaConf.to_object` does.

    key: key of the node in the config, with which the messages of the dataclasses' own checks begin. Raises what
    OmegaConf raises, and InputError.
    """
    if isinstance(node, ListConfig):
        return [typed(item, f"{key}[{number}]") for number, item in enumerate(node)]
    if not isinstance(node, DictConfig):
        return node
    values: dict[Any, Any] = {name: typed(node[name], f"{key}.{name!s}".removeprefix(".")) for name in node}
    cls: Any = OmegaConf.get_type(node)
    if not dataclasses.is_dataclass(cls):
        return values
    with building(key):
        return cast(Any, cls)(**values)


def _mistake(error: Exception, schema: Any, name: str, value: Any, key: str) -> InputError:
    """Return the error of a wrong value of the field `name`, or of a part of it."""
    if isinstance(error, ConfigKeyError):
        return _at(key, translate_error(error, schema))
    at = full_key(error).partition("[")[0] or name  # of an item, the key of its list
    for part in at.split(".")[1:]:
        value = value[part]
    return InputError(f"{key}.{at} is {value!r:.80}: must be {describe_expected(schema, at)}")


def _plain(node: DictConfig | Mapping[str, Any], key: str) -> dict[str, Any]:
    if not OmegaConf.is_config(node):
        given: Any = node
    else:
        try:
            given = OmegaConf.to_container(node, resolve=True)
        except OmegaConfBaseException as error:
            raise translate_error(error) from error
    if not isinstance(given, Mapping):
        raise InputError(f"{key} is {given!r}: must be a mapping")
    return {str(name): value for name, value in given.items()}


def _class(target: Any, key: str) -> Any:
    names = target.split(".") if isinstance(target, str) else []
    if len(names) < 2 or not all(map(str.isidentifier, names)):
        raise InputError(
            f"{key}._target_ is {target!r}: must be the dotted path of a class, package.module.Name"
        )
    module_name, _, name = target.rpartition(".")
    try:
        module = import_module(module_name)
    except InputError as error:
        raise InputError(f"{key}._target_ is {target}: cannot be imported ({error})") from error
    cls = getattr(module, name, None)
    if cls is None:
        raise InputError(
            f"{key}._target_ is {target}: {nearest(name, vars(module))}{module_name} has no {name}"
        )
    if not dataclasses.is_dataclass(getattr(cls, "Config", None)):
        raise InputError(f"{key}._target_ is {target}: the class needs an attribute Config, a dataclass")
    return cls


def _at(key: str, error: InputError) -> InputError:
    message = str(error)
    return error if message.startswith(f"{key}.") else InputError(f"{key}.{message}")
