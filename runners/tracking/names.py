"""Names and texts that MLflow accepts."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterable, Sequence

from runners.config.urls import masked_text

KEY_LENGTH = 250
_REFUSED = re.compile(r"[^\w\-. /]" if os.name == "nt" else r"[^\w\-. /:]")


def fitting_names(names: Sequence[str]) -> list[str]:
    """Return for each name one that MLflow accepts; all differ, and accepted names stay as they are."""
    used = {name for name in names if _fits(name)}
    seen: set[str] = set()
    fitting = []
    for name in names:
        if name in used and name not in seen:
            seen.add(name)
            fitting.append(name)
            continue
        new = _unused(_cleaned(name), used | seen)
        seen.add(new)
        fitting.append(new)
    return fitting


def fitting_text(value: object, length: int) -> str:
    """Return a value as text that every store can hold: not too long, without passwords or lone surrogates."""
    text = masked_text(str(value)).replace("\0", "�")
    return text.encode(errors="replace").decode()[:length]


def renamed(names: Iterable[str], fitting: Iterable[str]) -> list[str]:
    """Return "a as b" for every name that was changed."""
    return [f"{name!r:.80} as {new!r:.80}" for name, new in zip(names, fitting, strict=True) if name != new]


def _fits(name: str) -> bool:
    """Return whether MLflow accepts the name: it may become the path of a file, which must not be another's."""
    is_path = posixpath.normpath(name) == name and not name.startswith(("..", "/")) and name != "."
    return bool(name) and len(name) <= KEY_LENGTH and not _REFUSED.search(name) and is_path


def _cleaned(name: str) -> str:
    parts = _REFUSED.sub("_", name).split("/")
    clean = "/".join("_" if part in ("", ".", "..") else part for part in parts)[:KEY_LENGTH]
    return clean if _fits(clean) else re.sub(r"^\.+|/", "_", clean)


def _unused(name: str, used: set[str]) -> str:
    """Return the name, with a number if another has it already."""
    number, new = 1, name
    while new in used:
        number += 1
        end = f"_{number}"
        new = name[: KEY_LENGTH - len(end)] + end
    return new
