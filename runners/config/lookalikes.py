"""Check overrides for mistakes of typing and pasting: blanks around =, and characters that look like others."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from lme.errors import InputError

_DASHES = "\u2010\u2011\u2012\u2013\u2014\u2015\u2212\ufe58\ufe63\uff0d"
_DOUBLE, _SINGLE = "\u201c\u201d\u201e\u201f\u00ab\u00bb\u2033\uff02", "\u2018\u2019\u201a\u201b\u2032\uff07"
_INVISIBLE = "\u200b\u2060\ufeff\u00ad"
_AS_TYPED = str.maketrans(
    {**dict.fromkeys(_DASHES, "-"), **dict.fromkeys(_DOUBLE, '"'), **dict.fromkeys(_SINGLE, "'")}
    | dict.fromkeys(_INVISIBLE, "")
)
# The name of a file may hold any of these characters; a number, and the text around a value, may not.
_NUMBERS = re.compile(r"[\d.,:eE+\-*_\s\[\](){}]*\d[\d.,:eE+\-*_\s\[\](){}]*")
_NEGATIVE = re.compile(rf"(?:^|[\[({{,:=\s])[{_DASHES}]\s*(?=[\d.]|inf)")
_OUTSIDE = re.compile(rf"^[\s{_DOUBLE}{_SINGLE}{_INVISIBLE}]|[\s{_DOUBLE}{_SINGLE}{_INVISIBLE}]$")


def check_words(words: Sequence[str]) -> None:
    """Raise InputError for an override with a blank around its =, or with a lookalike of the right character."""
    for number, word in enumerate(words):
        _check_lookalikes(word)
        before, after = words[number - 1 : number], words[number + 1 : number + 2]
        if word.startswith("=") and before:
            raise _blank([*before, word, *(after if word == "=" else [])])
        if word.endswith("=") and after and "=" not in after[0]:
            raise _blank([word, *after])
        key, colon, value = word.partition(":")
        if colon and "=" not in word and re.fullmatch(r"\+*[\w./@]+", key):
            raise InputError(f"{word}: must be key=value: write {key}={value.strip()}")


def _blank(words: Sequence[str]) -> InputError:
    return InputError(f"{' '.join(words)}: there must be no blank beside =: write {''.join(words)}")


def _check_lookalikes(word: str) -> None:
    typed = _as_typed(word)
    if typed == word:
        return
    key, equals, value = word.partition("=")
    typed_value = typed.partition("=")[2]
    in_key = not equals or _as_typed(key) != key
    in_value = _OUTSIDE.search(value) or _NEGATIVE.search(value) or _NUMBERS.fullmatch(typed_value)
    if in_key or in_value:
        wrong = next(each for each in word if _as_typed(each) != each)
        name = unicodedata.name(wrong, "unnamed").lower()
        raise InputError(
            f"{word}: holds {name} (U+{ord(wrong):04X}), which only looks like what a keyboard types: write {typed}"
        )


def _as_typed(word: str) -> str:
    """Return the word with lookalikes replaced by the characters of a keyboard."""
    dashes = len(word) - len(word.lstrip(_DASHES + "-"))
    if dashes and "=" not in word and any(each in _DASHES for each in word[:dashes]):  # a flag
        flag = word[dashes:].translate(_AS_TYPED)
        return ("-" if len(flag) == 1 else "--") + flag
    return unicodedata.normalize("NFKC", word.translate(_AS_TYPED)).strip() if not word.isascii() else word
