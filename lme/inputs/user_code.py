"""Tell an error of a user's own code, such as a planner or a criterion, from one of lme, and say where it occurred.

`check_call` finds a wrong signature before anything runs.
"""

from __future__ import annotations

import functools
import importlib
import inspect
import os
import sys
import sysconfig
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from lme.errors import InputError

TRACEBACK = "LME_TRACEBACK"  # the environment variable that asks for tracebacks
_PACKAGES = Path(__file__).resolve().parents[2]
_LIBRARY = (_PACKAGES / "lme", _PACKAGES / "runners")
_INSTALLED = {"site-packages", "dist-packages"}


def user_error(error: BaseException) -> str:
    """Return `my_module.py:12: ZeroDivisionError: division by zero` if a user's own code raised the error, else "".

    It did if lme called it: then the traceback, which begins where the error is caught, leads through the user's
    code. An InputError has its own message.
    """
    if isinstance(error, InputError):
        return ""
    text = " ".join(traceback.format_exception_only(error)[-1].split())
    if isinstance(error, SyntaxError) and error.filename and _is_users(error.filename):
        return f"{_short(error.filename)}:{error.lineno}: {text}"
    frames = traceback.extract_tb(error.__traceback__)
    inner = [i for i, frame in enumerate(frames) if _is_users(frame.filename)]
    if not inner:
        return ""
    user_frame = frames[inner[-1]]
    tail = [frame for frame in frames[inner[-1] :] if _is_library(frame.filename)]
    raised = f" (raised in {_short(tail[-1].filename)}:{tail[-1].lineno})" if tail else ""
    return f"{_short(user_frame.filename)}:{user_frame.lineno}: {text}{raised}"


def explained(error: BaseException) -> str:
    """Return the line of `user_error` with the way to see the traceback; "" if there is no such line."""
    line = user_error(error)
    return f"{line} ({TRACEBACK}=1 shows the traceback)" if line else ""


def show_traceback(error: BaseException) -> None:
    """Print the traceback of an error that was explained in one line, if the environment asks for it.

    An attribute `trace` of the error is the text to print, such as the traceback in another process.
    """
    if os.environ.get(TRACEBACK, "") not in ("", "0"):
        trace = getattr(error, "trace", "") or "".join(traceback.format_exception(error))
        print(trace, end="", file=sys.stderr)


def import_module(name: str) -> ModuleType:
    """Import a module that a config names.

    Raises InputError if there is no such module, or if the user's own code fails or ends the program meanwhile.
    """
    try:
        return importlib.import_module(name)
    except (Exception, SystemExit) as error:
        line = user_error(error)
        if not line and not isinstance(error, ImportError | SyntaxError):
            raise
        raise InputError(line or str(error)) from error


def dotted_name(thing: Any) -> str:
    """The dotted path of a function, or of the class of an object."""
    definition = thing if hasattr(thing, "__qualname__") else type(thing)
    return f"{definition.__module__}.{definition.__qualname__}"


def check_call(key: str, function: Callable[..., Any], *arguments: str) -> None:
    """Raise InputError unless a class, method or function takes these positional arguments.

    key: of the config, for the message. A callable whose own signature Python does not know is not checked.
    """
    plain = getattr(function, "__func__", function)  # of a method: with `self`, as it is written
    expected = arguments if plain is function else ("self", *arguments)
    try:
        signature = inspect.signature(plain, follow_wrapped=False)
    except (TypeError, ValueError):
        return
    if hasattr(plain, "__signature__"):  # declared, so the call may take others
        return
    try:
        signature.bind(*expected)
    except TypeError:
        names = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
        raise InputError(
            f"{key}: {dotted_name(plain)} takes {inspect.Signature(names)}: must take ({', '.join(expected)})"
        ) from None


@functools.cache
def _library_folders() -> tuple[Path, ...]:
    paths = sysconfig.get_paths()
    return tuple(Path(paths[name]).resolve() for name in ("stdlib", "platstdlib"))


@functools.cache
def _is_users(filename: str) -> bool:
    """Return whether a file exists, and belongs neither to lme, nor to Python, nor to an installed package.

    A compiled module names a source that is not there, such as numpy/random/_common.pyx.
    """
    path = Path(filename).resolve()
    if not os.path.isfile(path):  # noqa: PTH113  (Path.is_file raises for long names)
        return False
    if _is_library(filename) or _INSTALLED & {*path.parts}:
        return False
    return not any(path.is_relative_to(folder) for folder in _library_folders())


@functools.cache
def _is_library(filename: str) -> bool:
    path = Path(filename).resolve()
    return any(path.is_relative_to(folder) for folder in _LIBRARY)


def _short(filename: str) -> str:
    """The path relative to the working folder, if the file lies in it."""
    path = Path(filename).resolve()
    return str(path.relative_to(Path.cwd())) if path.is_relative_to(Path.cwd()) else str(path)
