"""Code that a run may execute: lme's own classes and nothing else, unless the user trusts whoever made the run.

A run directory and a recording hold a config, which can name any class. Its values are data until `check_config` has
seen them: every reader that builds something from a run goes through `launch_record.recorded_config`, which calls it.
"""

from __future__ import annotations

import contextlib
import hashlib
import hmac
import os
import re
import secrets
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lme.errors import InputError

FLAG = "--trust"  # of every command
_TARGETS, _CRITERIA = (
    ("lme", "runners"),
    ("lme",),
)  # the packages from which a run may take classes and criteria
_CRITERION = re.compile(r"(?:^|\.)criteria\.[^.]+$")
_OUTSIDE = re.compile(
    r"(?:^|[=\[,'\"])[/~]|\.\."
)  # in an override: a path that is not below the working directory
_WRITTEN_OUT = re.compile(r"_target_|criteria\W")  # in an override whose value is a mapping
_KEY_BYTES = 32

_trusted: list[Path | None] = []  # directories of runs that may execute their code; None: all runs


class UntrustedError(InputError):
    """A run names code or a file that is not used without --trust."""


@contextlib.contextmanager
def trusting(directory: Path | None) -> Iterator[None]:
    """Within the block, execute the code that runs in or below a directory name; None: that of any run."""
    _trusted.append(directory if directory is None else directory.resolve())
    try:
        yield
    finally:
        _trusted.pop()


def is_trusted(directory: Path | None) -> bool:
    """Return whether code that a run in this directory names may be executed.

    It may if this process started the run, or was called with --trust.
    """
    if directory is None:
        return None in _trusted
    resolved = directory.resolve()
    return any(folder is None or resolved.is_relative_to(folder) for folder in _trusted)


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield ("a.b", value) for every leaf of nested mappings and lists; the items of a list have its key."""
    if isinstance(value, Mapping):
        for name, child in value.items():
            yield from leaves(child, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list | tuple):
        for child in value:
            yield from leaves(child, key)
    else:
        yield key, value


def check_config(values: Mapping[str, Any], directory: Path | None) -> None:
    """Check the config that a run has recorded, or a part of it, before anything is built from it.

    directory: that of the run or the recording. Raises UntrustedError for a class or function that is not lme's, and
    InputError for an interpolation: a command records values only.
    """
    for key, value in leaves(values):
        if isinstance(value, str) and "${" in value:
            raise InputError(
                f"{_name(directory)}: {key} is {value!r:.80}: a recorded config holds values alone"
            )
    check_code(values, directory)


def check_code(values: Mapping[str, Any], directory: Path | None) -> None:
    """Raise UntrustedError if a config names a class or function that is not lme's."""
    for key, value in [] if is_trusted(directory) else foreign(values):
        raise UntrustedError(
            f"{_name(directory)}: its {key} is {value}, which is not lme's own code: "
            f"add {FLAG} to run it, if you trust whoever made the run"
        )


def foreign(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield every key of a config that names a class or function that is not lme's, with its value."""
    for key, value in leaves(values):
        if isinstance(value, str) and "${" not in value and _is_foreign(key, value):
            yield key, value


def check_words(words: Sequence[str], directory: Path) -> None:
    """Check the overrides of a run likewise. Those of Hydra's own part can name callbacks, launchers and sweepers."""
    if is_trusted(directory):
        return
    for word in words:
        key, _, value = word.lstrip("+~").partition("=")  # not `key_of`: its module imports Hydra
        hydra = re.match(r"hydra\b", key) and key != "hydra.mode"
        outside = _OUTSIDE.search(f"={value}") or ".." in key
        if hydra or "${" in word or outside or _is_foreign(key, value) or _WRITTEN_OUT.search(value):
            raise UntrustedError(
                f"{directory}: it was started with {word}, which can run code or read files that are not the run's: "
                f"add {FLAG} to use it, if you trust whoever made the run"
            )


def sign(text: str) -> str:
    """Return a seal by which this user's runs are recognised; empty where the user's key cannot be stored."""
    key = _key()
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest() if key else ""


def is_signed(text: str, seal: str) -> bool:
    """Return whether this user's key made the seal of a text."""
    return bool(seal) and hmac.compare_digest(sign(text), seal)


def _is_foreign(key: str, value: str) -> bool:
    package = value.strip("'\"").partition(".")[0]
    if key.rpartition(".")[2] == "_target_":
        return package not in _TARGETS
    return bool(_CRITERION.search(key)) and package not in _CRITERIA


def _name(directory: Path | None) -> str:
    return "the run" if directory is None else str(directory)


def _key() -> bytes:
    """Return the user's key, which is made when it is first needed; empty if it cannot be stored."""
    with contextlib.suppress(OSError, RuntimeError):
        base = os.environ.get("XDG_STATE_HOME", "")
        folder = (Path(base) if Path(base).is_absolute() else Path.home() / ".local" / "state") / "lme-nav"
        path = folder / "runs.key"
        with contextlib.suppress(FileExistsError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            draft = folder / f".runs.key.{os.getpid()}"
            draft.touch(mode=0o600)
            draft.write_bytes(secrets.token_bytes(_KEY_BYTES))
            try:
                os.link(draft, path)  # atomic: several processes may make the key at the same time
            finally:
                draft.unlink()
        key = path.read_bytes()
        return key if len(key) == _KEY_BYTES else b""
    return b""
