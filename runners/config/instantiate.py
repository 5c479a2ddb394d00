"""Build the object that a config node with a `_target_` describes.

The class that `_target_` names has an attribute `Config`, a dataclass: the node's other keys are checked
against its fields, and the class is called with an instance of it. Errors of OmegaConf and Hydra are translated into
one line: key, value and what would be right.
"""

from __future__ import annotations

import dataclasses
import enum
import re
import types
import typing
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, cast

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import ConfigKeyError, GrammarParseError, OmegaConfBaseException

from lme import robots
from lme.errors import InputError, building, nearest
from lme.inputs.user_code import check_call, import_module

_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "text", type(None): "null"}
_FULL_KEY = re.compile(r"full_key: *(\S+)")
_VALUE = re.compile(r"(?:[Vv]alue) '(.*?)'(?: of type| is not|,| for)|(?:to string|value): (.*)")


def build(node: DictConfig | Mapping[str, Any], key: str, **others: Any) -> Any:
    """Build the object that `node` describes: its class called with its Config and then `others`, by position.

    key: key of the node in the config ("planner"), for messages. Raises InputError naming key, value
    and what would be right.
    """
    cls, config = configured(node, key)
    check_call(f"{key}._target_", cls, "config", *others)
    with building(key):
        return cls(config, *others.values())


def configured(node: DictConfig | Mapping[str, Any], key: str) -> tuple[Any, Any]:
    """Return the class and the checked Config instance of `node`, without making the object itself."""
    values = _plain(node, key)
    cls = _class(values.pop("_target_", None), key)
    return cls, fill_dataclass(cls.Config, values, key)


def config_class(target: Any, key: str) -> Any:
    """Return the dataclass that checks the keys next to `_target_: target`. Raises InputError if there is none."""
    return _class(target, key).Config


def fill_dataclass(schema: Any, values: DictConfig | Mapping[str, Any], key: str) -> Any:
    """Return an instance of the dataclass `schema` with these values.

    Raises InputError for a key that it lacks, a value of the wrong type, or a value that is missing.
    """
    node = OmegaConf.structured(schema)
    for name, value in _plain(values, key).items():
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
        plain: Any = node
    else:
        try:
            plain = OmegaConf.to_container(node, resolve=True)
        except OmegaConfBaseException as error:
            raise translate_error(error) from error
    if not isinstance(plain, Mapping):
        raise InputError(f"{key} is {plain!r}: must be a mapping")
    return {str(name): value for name, value in plain.items()}


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
        file = getattr(module, "__file__", None) or "built in"
        own = Path(f"{module_name.replace('.', '/')}.py")
        hides = own.is_file() and own.resolve() != Path(file).resolve()
        hidden = f"; it hides {own} in the working folder, which must be renamed" if hides else ""
        raise InputError(
            f"{key}._target_ is {target}: {nearest(name, vars(module))}{module_name} ({file}) has no {name}{hidden}"
        )
    if not dataclasses.is_dataclass(getattr(cls, "Config", None)):
        raise InputError(f"{key}._target_ is {target}: the class needs an attribute Config, a dataclass")
    return cls


def _at(key: str, error: InputError) -> InputError:
    message = str(error)
    return error if message.startswith(f"{key}.") else InputError(f"{key}.{message}")


def unknown_key(key: str, known: Iterable[str]) -> InputError:
    """Return the error that a dotted `key` is unknown. known: the last parts of the keys that its parent holds."""
    parent, _, name = key.rpartition(".")
    names = sorted(known)
    listing = f"{parent} holds: " if parent else "there are: "
    return InputError(f"{key}: no such key; {nearest(name, names)}{listing}{', '.join(names) or 'no keys'}")


def translate_error(error: BaseException, schema: Any = None) -> InputError:
    """Translate an error of OmegaConf about a config of type `schema`."""
    message, key = str(error), full_key(error)
    if isinstance(error, GrammarParseError) and error.value is not None:
        right = "an interpolation with its closing brace, such as ${robot.v_max}"
        return InputError(f"{key} is {error.value!s:.80}: must be {right}")
    inner = re.match(r"InputError raised while resolving interpolation: (.+)", message)
    if inner:
        return InputError(inner.group(1))
    if "issing mandatory value" in message:
        return InputError(f"{key} has no value: give one")
    if re.search(r"Key '.*' (?:is )?not in", message):
        return unknown_key(key, keys_beside(schema, key))
    merged = re.search(r"Merge error: \w+ is not a subclass of (\w+)\. value: (.+)", message)
    if merged:
        name, value_text = merged.groups()
        part = getattr(robots, name, None)
        keys = f" of {', '.join(field.name for field in dataclasses.fields(part))}" if part else ""
        return InputError(f"{name.lower()} is {value_text:.80}: must be a mapping{keys}")
    value, expected = _VALUE.search(message), describe_expected(schema, key) if key else ""
    if value and expected:
        return InputError(f"{key} is {value.group(1) or value.group(2)}: must be {expected}")
    reason = re.sub(r"^\w+ raised while composing config:\s*", "", one_line(message))
    return InputError(f"{key}: {reason}" if key else reason)


def full_key(error: BaseException) -> str:
    """Return the dotted key in an error of OmegaConf; empty if there is none."""
    match = _FULL_KEY.search(str(error))
    return match.group(1) if match else ""


def describe_expected(schema: Any, key: str) -> str:
    """Return in words what the value at the dotted `key` of a dataclass must be; empty if unknown."""
    return describe(_annotation(schema, key))


def keys_beside(schema: Any, key: str) -> list[str]:
    """Return the names of the fields of the dotted `key`'s parent."""
    parent = key.rpartition(".")[0]
    holder = dataclass_of(_annotation(schema, parent) if parent else schema)
    return [field.name for field in dataclasses.fields(holder)] if holder else []


def dataclass_of(annotation: Any) -> Any:
    """Return the dataclass of `Part` or of `Part | None`; None for any other type."""
    members = () if typing.get_origin(annotation) is dict else typing.get_args(annotation)
    return next((member for member in (annotation, *members) if dataclasses.is_dataclass(member)), None)


def check_parts(config: Any, key: str = "") -> None:
    """Raise InputError for a single value that must be a mapping, or the reverse, which OmegaConf lets through."""
    annotations = typing.get_type_hints(type(config))
    for field in dataclasses.fields(config):
        value, name = getattr(config, field.name), f"{key}.{field.name}".removeprefix(".")
        if dataclasses.is_dataclass(value):
            check_parts(value, name)
        elif value is not None and dataclass_of(annotations[field.name]):
            raise InputError(f"{name} is {value!r:.80}: must be a mapping")
        elif typing.get_origin(annotations[field.name]) is dict and isinstance(value, dict):
            item_type = typing.get_args(annotations[field.name])[1]
            for part, item in value.items():
                if item_type in _WORDS and isinstance(item, dict | list):
                    raise InputError(f"{name}.{part} is {item!r:.80}: must be {describe(item_type)}")


def describe(annotation: Any) -> str:
    """Return a type in the words of somebody who writes YAML."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(describe(argument) for argument in arguments)
    if origin in (list, tuple):
        return f"a list, each {describe(arguments[0])}" if arguments else "a list"
    if origin is dict:
        return f"a mapping of names, each to {describe(arguments[1])}".removesuffix(", each to ")
    if isinstance(annotation, type) and issubclass(annotation, enum.Enum):
        return " or ".join(annotation.__members__)
    if dataclasses.is_dataclass(annotation):
        return f"a mapping of {', '.join(field.name for field in dataclasses.fields(annotation))}"
    return _WORDS.get(annotation, "")


def one_line(message: str) -> str:
    """Return a message of OmegaConf or Hydra as one line, without internal names or advice for programmers."""
    lines = [line.strip() for line in message.splitlines() if line.strip()]
    text = " ".join(line for line in lines if not re.match(r"(full_key|object_type|reference_type)", line))
    return re.split(r" (?:To append to|Config search path)", text)[0]


def _annotation(schema: Any, key: str) -> Any:
    holder = schema
    for name in re.sub(r"\[\d+\]", "", key).split("."):
        if typing.get_origin(holder) is dict:
            holder = typing.get_args(holder)[1]
        else:
            holder = typing.get_type_hints(dataclass_of(holder)).get(name) if dataclass_of(holder) else None
    return holder
