"""Input from the page, read strictly: the fields of a message, and the words of the command line that it may change."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from lme.errors import InputError
from runners.config.quoting import key_of

LONGEST_MESSAGE = 200_000  # [bytes]
LONGEST_TEXT = 200
GROUPS = ("system", "guide", "planner", "filter", "ablation", "robot", "map", "sim", "crowd")
KEYS = (*GROUPS, "weights", "people", "seed", "run", "scale")
LONGEST = 300  # most characters of a value
MOST_FILES = 200  # most files that are offered

_KEY = re.compile(r"[a-z_]+(\.[a-z0-9_]+)*")
_VALUE = re.compile(r"[\w.,:+\- \[\]]*")  # no interpolation, no quotes, no functions, no paths, no mappings
_FACTORS = re.compile(r"{[\w.,: +\-]*}")  # of scale
_DOTTED = re.compile(r"[A-Za-z_]\w*\.[A-Za-z_]")  # may name a module
_PATH = re.compile(r"[\w.,+\- /]+")
_MAP = re.compile(rb"^(bounds|image):", re.MULTILINE)
_HEAD = 4000  # [bytes] a map is recognised by its beginning
_PATH_KEYS = ("weights", "map.path", "map.source", "planner.weights", "guide.weights", "planner.path")
_SYSTEM = ("system", "guide", "planner", "ablation", "weights", "scale")  # keys that a new system removes


class Fields:
    """A message: a JSON object. Every reader raises an InputError that names the field and what would be right."""

    def __init__(self, text: str) -> None:
        if len(text) > LONGEST_MESSAGE:
            raise InputError(f"a message of {len(text)} characters: must be at most {LONGEST_MESSAGE}")
        try:
            values = json.loads(text, parse_constant=_refuse)
        except (ValueError, RecursionError) as error:
            raise InputError(f"a message is not JSON ({error})") from error
        if not isinstance(values, dict):
            raise InputError("a message is not a JSON object")
        self._values: Mapping[str, Any] = values

    def value(self, key: str) -> Any:
        """Return the value as received; None if it is absent."""
        return self._values.get(key)

    def text(self, key: str, default: str | None = None) -> str:
        """Return a short text."""
        value = self._values.get(key, default)
        if not isinstance(value, str) or len(value) > LONGEST_TEXT:
            raise self._mistake(key, f"text of at most {LONGEST_TEXT} characters")
        return value

    def one_of(self, key: str, names: Collection[str]) -> str:
        """Return one of the names."""
        value = self._values.get(key)
        if not isinstance(value, str) or value not in names:
            raise self._mistake(key, f"one of {', '.join(names)}")
        return value

    def some_of(self, key: str, names: Collection[str]) -> list[str]:
        """Return those of the names that are in a list; an empty list if the field is absent."""
        value = self._values.get(key, [])
        if not isinstance(value, list):
            raise self._mistake(key, f"a list of {', '.join(names)}")
        return [name for name in names if name in value]

    def integer(self, key: str, maximum: int) -> int:
        """Return a whole number from 0 to `maximum`."""
        value = self._values.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= maximum:
            raise self._mistake(key, f"a whole number from 0 to {maximum}")
        return value

    def numbers(self, key: str, count: int, max_abs: float) -> list[float]:
        """Return `count` finite numbers between −`max_abs` and `max_abs`."""
        value = self._values.get(key)
        numbers = [_number(entry) for entry in value] if isinstance(value, list) else []
        if len(numbers) != count or not all(abs(number) <= max_abs for number in numbers):
            raise self._mistake(key, f"{count} numbers between -{max_abs:g} and {max_abs:g}")
        return numbers

    def mapping(self, key: str) -> dict[str, Any]:
        """Return a JSON object."""
        value = self._values.get(key)
        if not isinstance(value, dict):
            raise self._mistake(key, "an object")
        return value

    def _mistake(self, key: str, requirement: str) -> InputError:
        return InputError(f"{key} is {self._values.get(key)!r:.60}: must be {requirement}")


def _number(value: Any) -> float:
    """Return the value as a float; NaN for anything that is not a number."""
    try:
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    except OverflowError:
        return math.inf


def _refuse(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def changed(words: Iterable[str], changes: Mapping[str, object], root: Path) -> list[str]:
    """Return the words with changes by key; None removes a word. root: the folder whose files may be named.

    A new option of a group removes the keys of the former one. Raises InputError.
    """
    words_by_key = {key_of(word): word for word in words}
    for key, value in changes.items():
        _check_key(key)
        removed_keys = _SYSTEM if key == "system" else (key,)
        # Remove the keys of the former option, and for a new system also what belongs to it.
        if key in GROUPS:
            words_by_key = {
                previous_key: word
                for previous_key, word in words_by_key.items()
                if previous_key not in removed_keys and previous_key.partition(".")[0] not in removed_keys
            }
        words_by_key.pop(key, None)
        if value is not None and value != "":
            words_by_key[key] = f"{key}={_check_value(key, value, root)}"
    return list(words_by_key.values())


def within(name: str, root: Path) -> Path:
    """Return a path below the folder `root`. Raises InputError for a path that leads elsewhere."""
    path = (root / name).resolve()
    if not path.is_relative_to(root.resolve()):
        raise InputError(f"{name:.80}: must be in {root}, the folder in which lme play was started")
    return path


def map_files(root: Path) -> list[str]:
    """Return files below the folder that may hold a map, at most two folders deep."""
    files: list[str] = []
    for pattern in ("*", "[!.]*/*", "[!.]*/[!.]*/*"):
        for path in root.glob(f"{pattern}.yaml"):
            if len(files) == MOST_FILES:
                return sorted(files)
            if path.is_file() and _is_map(path):
                files.append(str(path.relative_to(root)))
    return sorted(files)


def _is_map(path: Path) -> bool:
    """Return whether a file begins like a shape file or a ROS map."""
    try:
        with path.open("rb") as file:
            return _MAP.search(file.read(_HEAD)) is not None
    except OSError:
        return False


def _check_key(key: str) -> None:
    if not _KEY.fullmatch(key) or key.partition(".")[0] not in KEYS or "_target_" in key:
        raise InputError(
            f"{key:.60}: cannot be changed from the page; must be one of {', '.join(KEYS)}, or below it"
        )


def _check_value(key: str, value: object, root: Path) -> str:
    """Return the value as it is written in a word."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise InputError(f"{key} is {value!r:.60}: must be text or a number")
    text = str(value).strip()
    is_path = "/" in text or ".." in text or key == "map.path"
    if len(text) <= LONGEST and not is_path and _is_plain(key, text):
        return text
    if len(text) <= LONGEST and key in _PATH_KEYS and _PATH.fullmatch(text):
        path = str(within(text, root)).replace("'", "\\'")
        return f"'{path}'"
    raise InputError(f"{key} is {text:.60}: must be names and numbers" + ", or a path" * (key in _PATH_KEYS))


def _is_plain(key: str, text: str) -> bool:
    """Return whether a value consists of names and numbers only, and cannot name a class or function to import."""
    if key == "scale":
        return bool(_FACTORS.fullmatch(text))
    return bool(_VALUE.fullmatch(text)) and (key in _PATH_KEYS or not _DOTTED.search(text))
