"""Strict reading of hand-written YAML: each mistake is reported in one line that says where it is."""

from __future__ import annotations

import math
import re
import reprlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from lme.errors import InputError, nearest
from lme.types import Floats

_EXPONENT = re.compile(r"([-+]?\d+)(?:\.(\d*))?[eE]([-+]?)(\d+)")  # of a number with one


class Entry:
    """A mapping in a YAML file, read key by key.

    place: the file and the position in it, for messages. Raises InputError for unknown or missing keys.
    """

    def __init__(
        self, place: str, value: object, required: Sequence[str], optional: Sequence[str] = ()
    ) -> None:
        self.place = place
        keys = (*required, *optional)
        if value is None:
            raise InputError(f"{place} is empty: must be a mapping with {', '.join(keys)}")
        if not isinstance(value, dict):
            raise InputError(f"{place}: {_shorten(value)} must be a mapping with {', '.join(keys)}")
        for key in value:
            if key not in keys:
                raise InputError(
                    f"{place}: unknown key {_shorten(key)}: {nearest(str(key), keys)}must be one of {', '.join(keys)}"
                )
        missing = [key for key in required if key not in value]
        if missing:
            right = f"hold {', '.join(required)}" if len(required) > 1 else "be given"
            raise InputError(f"{place}: {missing[0]} is missing: must {right}")
        self._value = value

    @property
    def keys(self) -> list[str]:
        """The keys that are given."""
        return list(self._value)

    def value(self, key: str, default: object = None) -> Any:
        """The value of a key, unchecked."""
        return self._value.get(key, default)

    def entries(self, key: str) -> list[tuple[str, object]]:
        """The items of a list, each with its place; none if the key is absent or empty."""
        items = self._value.get(key) or []
        if not isinstance(items, list):
            raise self.mistake(key, "a list")
        return [(f"{self.place}, {key}[{i}]", item) for i, item in enumerate(items)]

    def number(self, key: str, default: float | None = None, above: float | None = None) -> float:
        """Return one finite number, greater than `above` if that is given."""
        number = _number(self._value.get(key, default))
        if number is None or (above is not None and number <= above):
            raise self.mistake(key, "a finite number" + ("" if above is None else f" greater than {above:g}"))
        return number

    def numbers(self, key: str, right: str, count: int, above: float | None = None) -> list[float]:
        """Return `count` finite numbers, each greater than `above` if that is given.

        right: their names, for messages.
        """
        numbers = _numbers(self._value.get(key), count)
        if numbers is None or (above is not None and min(numbers) <= above):
            suffix = "" if above is None else f", each greater than {above:g}"
            raise self.mistake(key, f"[{right}], {count} finite numbers{suffix}")
        return numbers

    def points(self, key: str, at_least: int) -> Floats:
        """(K, 2) points [x, y], K ≥ `at_least`, no two successive ones the same."""
        value = self._value.get(key)
        pairs = [_numbers(pair, 2) for pair in value] if isinstance(value, list) else []
        if len(pairs) < at_least or None in pairs:
            raise self.mistake(key, f"a list of at least {at_least} points [x, y] [m]")
        points = np.array(pairs, dtype=np.float64)
        if (points[1:] == points[:-1]).all(axis=1).any():
            raise self.mistake(key, "points, no two successive ones the same")
        return points

    def mistake(self, key: str, right: str) -> InputError:
        """The error for a wrong value. right: what it must be."""
        value = self._value.get(key)
        return InputError(f"{self.place}: {key} is {_shorten(value)}: must be {right}{_as_number(value)}")


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def _numbers(value: object, count: int) -> list[float] | None:
    if not isinstance(value, list) or len(value) != count:
        return None
    numbers = [number for item in value if (number := _number(item)) is not None]
    return numbers if len(numbers) == count else None


def _as_number(value: object) -> str:
    """Hint how to write a text that looks like a number, such as 1e9: YAML 1.1 wants point and sign.

    value: if it is a list, its first such text counts. Empty if there is none.
    """
    if isinstance(value, list):
        return next(filter(None, map(_as_number, value)), "")
    match = _EXPONENT.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        return ""
    integer, fraction, sign, exponent = match.groups(default="")
    number = f"{integer}.{fraction or '0'}e{sign or '+'}{exponent}"
    return "" if number == value else f"; YAML reads {value} as a text: write {number}"


def _shorten(value: object) -> str:
    """A value, shortened to fit on one line."""
    return "empty" if value is None else " ".join(reprlib.repr(value).split())
