"""Fields of a dataclass for the Python reference: type, default, and the comment after each."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

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
    """Return the fields of a dataclass in order; a part with a default is replaced by its own fields."""
    return list(_fields(schema, ""))


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
        if dataclasses.is_dataclass(default):
            yield from _fields(type(default), f"{prefix}{field.name}.")
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
