"""Guarded reading of the user's files: regular files of a bounded size, YAML and JSON of a bounded depth,
and a ~ in a path."""

from __future__ import annotations

import copy
import json
import os
import re
import stat
from collections.abc import Hashable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import yaml

from lme.errors import InputError

TEXT_BYTES = 64 * 2**20  # of a text that is read as a whole
LOG_BYTES = 2**30  # of a log of JSON lines that is read as a whole
YAML_BYTES = 8 * 2**20  # parsing takes about 3 s for each MiB

_KEPT_CHARACTERS = 16_384  # of a YAML text, at most, whose content is kept

SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)

_KINDS = {"d": "a directory", "p": "a pipe", "c": "a device", "b": "a device", "s": "a socket"}
_DEEPEST = 100  # of nested values; libyaml ends the process at some 50,000, Python has a limit at some 1,000
_MOST_REPEATED = 100_000  # values that the aliases of a YAML file repeat


def expanded(path: str | Path) -> Path:
    """Replace a ~ at the beginning of a path by the home folder. Raises InputError if that folder is not known."""
    try:
        return Path(path).expanduser()
    except RuntimeError:
        home = Path(path).parts[0]
        raise InputError(f"{path}: the home folder {home} is not known: write the whole path") from None


def check_regular(path: Path, max_bytes: int | None = None) -> None:
    """Raise InputError unless `path` is a regular file, or a link to one, of at most `max_bytes` bytes.

    For libraries that open the file themselves: reading a pipe would block, and reading a device may never end.
    Raises OSError if there is no such file.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.filemode(status.st_mode)[0], "something else")
        raise InputError(f"{path}: is {kind}, not a regular file")
    if max_bytes is not None and status.st_size > max_bytes:
        raise InputError(f"{path}: has {status.st_size} bytes: must have at most {max_bytes}")


def open_bytes(path: Path, max_bytes: int | None = None) -> BinaryIO:
    """Open a regular file of at most `max_bytes` bytes. Raises as `check_regular` does."""
    check_regular(path, max_bytes)
    return path.open("rb")


def read_bytes(path: Path, max_bytes: int = TEXT_BYTES) -> bytes:
    """The content of a regular file of at most `max_bytes` bytes. Raises as `check_regular` does."""
    with open_bytes(path, max_bytes) as file:
        # Without what is appended meanwhile.
        return file.read(min(os.fstat(file.fileno()).st_size, max_bytes))


def read_text(path: Path, max_bytes: int = TEXT_BYTES) -> str:
    """The content of a text file in UTF-8, with or without a byte order mark. Also raises UnicodeDecodeError."""
    text = read_bytes(path, max_bytes).decode("utf-8-sig")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_json(path: Path) -> Any:
    """The value in a JSON file. Raises as `read_bytes` and `decode_json` do."""
    return decode_json(read_bytes(path))


def decode_json(text: str | bytes) -> Any:
    """The value of a JSON text. Raises ValueError if it is not JSON, or if more than 100 values are nested."""
    too_deep = ValueError(f"more than {_DEEPEST} nested values")
    try:
        value = json.loads(text)
    except RecursionError:
        raise too_deep from None
    level, depth = [value], 0
    while level := [parent for parent in level if isinstance(parent, dict | list)]:
        depth += 1
        if depth > _DEEPEST:
            raise too_deep
        level = [
            child for parent in level for child in (parent.values() if isinstance(parent, dict) else parent)
        ]
    return value


def read_yaml(path: Path) -> object:
    """The content of a YAML file.

    Raises InputError if it cannot be read, is not valid, repeats a key, or is not a regular file of a bounded size.
    """
    try:
        text = read_text(path, YAML_BYTES)
        # The small files of conf/ are read again and again, so their content is kept.
        return copy.deepcopy(_kept(text)) if len(text) <= _KEPT_CHARACTERS else _parsed(text)
    except yaml.MarkedYAMLError as error:
        line = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise InputError(f"{path}{line}: not valid YAML ({error.problem})") from error
    except InputError:
        raise
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError, ValueError) as error:
        raise InputError(f"{path}: not valid YAML in UTF-8 ({' '.join(str(error).split())[:200]})") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def _parsed(text: str) -> object:
    check_structure(text)
    return yaml.load(text, Loader=_StrictLoader)


_kept = lru_cache(maxsize=256)(_parsed)


class UnfoldingError(yaml.MarkedYAMLError):
    """YAML that is nested too deeply, or whose aliases contain themselves or repeat very many values.

    Code that walks through such values would not come to an end.
    """


def _events(text: str) -> Iterator[Any]:
    """The events of a YAML text. libyaml has a nesting limit of its own, which may stop it before the first event."""
    try:
        yield from yaml.parse(text, SafeLoader)
    except yaml.MarkedYAMLError as error:
        if "nesting depth" not in str(error.problem):
            raise
        problem = f"more than {_DEEPEST} nested values"
        raise UnfoldingError(problem=problem, problem_mark=error.problem_mark) from None


def check_structure(text: str) -> None:
    """Raise UnfoldingError for YAML that nests or repeats too much, another yaml.YAMLError for an invalid text."""
    # Follow the events, and count the values of every collection with its aliases unfolded.
    sizes: dict[str, int] = {}  # of the values with an anchor, unfolded
    nested: list[tuple[str | None, int]] = []  # anchor and size so far of the values around this one
    repeated = 0
    for event in _events(text):
        mark: Any = event.start_mark  # its type depends on the loader
        if isinstance(event, yaml.CollectionStartEvent):
            nested.append((event.anchor, 1))
            if len(nested) > _DEEPEST:
                raise UnfoldingError(problem=f"more than {_DEEPEST} nested values", problem_mark=mark)
            continue
        if isinstance(event, yaml.AliasEvent):
            # An alias counts as all values that it repeats; in the value of its own anchor it has no end.
            if any(anchor == event.anchor for anchor, _ in nested):
                raise UnfoldingError(problem=f"alias *{event.anchor} contains itself", problem_mark=mark)
            anchor, size = None, sizes.get(str(event.anchor), 1)
            repeated += size
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, size = nested.pop()
        elif isinstance(event, yaml.ScalarEvent):
            anchor, size = event.anchor, 1
        else:
            continue
        if repeated > _MOST_REPEATED:
            raise UnfoldingError(
                problem=f"its aliases repeat more than {_MOST_REPEATED} values", problem_mark=mark
            )
        if anchor is not None:
            sizes[anchor] = size
        if nested:
            nested[-1] = nested[-1][0], nested[-1][1] + size


class _StrictLoader(SafeLoader):  # type: ignore[misc]
    """Loader that refuses what PyYAML would read as something else without a word.

    Of a repeated key it keeps the last one, which would lose part of a drawing, and by YAML 1.1 it reads 010 as 8 and
    12:30 as 750.
    """

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        keys = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                if key.value in keys:
                    raise yaml.MarkedYAMLError(
                        problem=f"key {key.value!r} is repeated", problem_mark=key.start_mark
                    )
                keys.add(key.value)
        mapping: dict[Hashable, Any] = super().construct_mapping(node, deep)
        return mapping

    def construct_decimal(self, node: yaml.ScalarNode) -> int | float:
        """Return a whole or floating-point number."""
        is_whole = node.tag == _WHOLE
        is_octal = is_whole and re.match(r"[-+]?0_*[0-9]", node.value)  # 00.5 is read as people mean it
        if ":" in node.value or is_octal:
            raise yaml.MarkedYAMLError(
                problem=f"{node.value} would be read in base {8 if is_octal else 60}: write a decimal number, or text "
                "in quotes",
                problem_mark=node.start_mark,
            )
        number: int | float = self.construct_yaml_int(node) if is_whole else self.construct_yaml_float(node)
        return number


_WHOLE, _REAL = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
for _tag in (_WHOLE, _REAL):
    _StrictLoader.add_constructor(_tag, _StrictLoader.construct_decimal)
