"""Fields of a message from the page, read strictly, so that no other input passes from the socket."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from typing import Any

from lme.errors import InputError

LONGEST_MESSAGE = 200_000  # [bytes]
LONGEST_TEXT = 200


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
