"""Fields of a dataclass for the Python reference: type, value and meaning, from `conf/` or from the class itself."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple, get_type_hints

from lme.config import composer
from runners.config import catalogue, instantiate
from runners.config.hydra_errors import dataclass_of
from runners.config.wording import without_markup

MARKS = "*|_"  # markup of reStructuredText, which comments do not mean
HEADER = ("Name", "Type", "Default", "Meaning")


class ConfigField(NamedTuple):
    """One field. name: dotted for a field of a part. default: empty if there is none. meaning: includes the unit."""

    name: str
    type: str
    default: str
    meaning: str


def fields(schema: type) -> list[ConfigField]:
    """Return the fields of a dataclass in order; a part that is never absent is replaced by its own fields.

    Values and meanings of the Config of a shipped class are those of the YAML that names the class.
    """
    written = {key.name: key for key in _written(schema)}
    return [
        field._replace(default=written[field.name].value, meaning=written[field.name].comment)
        if field.name in written
        else field
        for field in _fields(schema, "")
    ]


def _written(schema: type) -> list[catalogue.Key]:
    """Return the keys of the shipped YAML of the class whose Config is `schema`; none if there is none."""
    configs = catalogue.shipped()
    for file in sorted(configs.folders[0].glob("*/*.yaml")):
        name = f"{file.parent.name}/{file.stem}"
        target = composer.own_target(file) or ""
        is_near = "." in target and schema.__module__.startswith(target.rpartition(".")[0])
        if is_near and instantiate.config_class(target, name) is schema:
            return configs.keys(name)
    return []


def as_rst(found: list[ConfigField]) -> list[str]:
    """Return the lines of a table in reStructuredText."""
    lines = [".. list-table::", "   :header-rows: 1", "   :class: fields", ""]
    rows = [
        (_code(name), _code(kind), _code(default), without_markup(text, MARKS))
        for name, kind, default, text in found
    ]
    for row in (HEADER, *rows):
        lines += [f"   {'  -' if at else '* -'} {cell}" for at, cell in enumerate(row)]
    return [*lines, ""]


def _fields(schema: type, prefix: str) -> Iterator[ConfigField]:
    comments = _comments(schema)
    for field in dataclasses.fields(schema):
        default = _default(field)
        part: Any = type(default) if dataclasses.is_dataclass(default) else None
        if default is dataclasses.MISSING:
            part = dataclass_of(get_type_hints(schema)[field.name])
        if part:
            yield from _fields(part, f"{prefix}{field.name}.")
            continue
        text = "" if default is dataclasses.MISSING else repr(default)
        yield ConfigField(f"{prefix}{field.name}", str(field.type), text, comments.get(field.name, ""))


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _comments(schema: type) -> dict[str, str]:
    """Return the comments after the fields, inherited ones included, by name."""
    bases = [each for each in reversed(inspect.getmro(schema)) if dataclasses.is_dataclass(each)]
    lines = "".join(map(inspect.getsource, bases))
    return dict(re.findall(r"^    (\w+): .*?  # (.*)$", lines, re.MULTILINE))


def _code(text: str) -> str:
    return f"``{text}``" if text else ""
