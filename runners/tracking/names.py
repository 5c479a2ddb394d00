"""Parameters of a tracked run, and names and texts that MLflow accepts."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from runners.config.changes import flatten
from runners.config.escaping import masked_text

if TYPE_CHECKING:
    from runners.records.episode_record import RunLabels

KEY_LENGTH = 250
LABELS = ("system", "robot", "map", "ablation")  # what users search for
_REFUSED = re.compile(r"[^\w\-. /]" if os.name == "nt" else r"[^\w\-. /:]")


def fitting_names(names: Sequence[str]) -> list[str]:
    """Return for each name one that MLflow accepts; all differ, and accepted names stay as they are."""
    unchanged = {name for name in names if _fits(name)}
    assigned: set[str] = set()
    names_out = []
    for name in names:
        if name in unchanged and name not in assigned:
            assigned.add(name)
            names_out.append(name)
            continue
        new_name = _unused(_cleaned(name), unchanged | assigned)
        assigned.add(new_name)
        names_out.append(new_name)
    return names_out


def fitting_text(value: object, length: int) -> str:
    """Return a value as text that every store can hold: not too long, without passwords or lone surrogates."""
    text = masked_text(str(value)).replace("\0", "�")
    return text.encode(errors="replace").decode()[:length]


def renamed(names: Iterable[str], new_names: Iterable[str]) -> list[str]:
    """Return "a as b" for every name that was changed."""
    return [
        f"{name!r:.80} as {new_name!r:.80}"
        for name, new_name in zip(names, new_names, strict=True)
        if name != new_name
    ]


def _fits(name: str) -> bool:
    """Return whether MLflow accepts the name: it may become the path of a file, which must not be another's."""
    is_path = posixpath.normpath(name) == name and not name.startswith(("..", "/")) and name != "."
    return bool(name) and len(name) <= KEY_LENGTH and not _REFUSED.search(name) and is_path


def _cleaned(name: str) -> str:
    segments = _REFUSED.sub("_", name).split("/")
    clean = "/".join("_" if segment in ("", ".", "..") else segment for segment in segments)[:KEY_LENGTH]
    return clean if _fits(clean) else re.sub(r"^\.+|/", "_", clean)


def _unused(name: str, taken_names: set[str]) -> str:
    """Return the name, with a number if another has it already."""
    number, candidate = 1, name
    while candidate in taken_names:
        number += 1
        suffix = f"_{number}"
        candidate = name[: KEY_LENGTH - len(suffix)] + suffix
    return candidate


def parameters(config: Mapping[str, Any], labels: RunLabels | None = None) -> dict[str, Any]:
    """Return the parameters by dotted key, with labels such as system=LME, robot=jackal, map=barn, ablation=none."""
    return dict(flatten(config)) | {key: getattr(labels, key) for key in LABELS if labels is not None}
