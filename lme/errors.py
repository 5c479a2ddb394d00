"""The error that a user can fix, and the checks that raise it."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

_CONFIG_KEY = ContextVar("config key", default="")  # of the node that is being built from a config


class InputError(ValueError):
    """A mistake in the user's input: a config value, a file, a path.

    The message is one line that names the file or key, the value, and what would be right.
    Line breaks in a name or value become spaces. The command line prints only this line, without a traceback, and
    exits with status 2.
    """

    def __init__(self, message: str) -> None:
        super().__init__(" ".join(line.strip() for line in message.splitlines()))


@contextmanager
def building(key: str) -> Iterator[None]:
    """Let messages about arguments begin with the key of the config node that is built within this context.

    The library names its own arguments ("margin is -1"); within `building("planner")` the message says
    "planner.margin is -1".
    """
    token = _CONFIG_KEY.set(key)
    try:
        yield
    finally:
        _CONFIG_KEY.reset(token)


def config_key(argument: str) -> str:
    """Return the name of an argument for messages: within `building`, with the key of the node before it."""
    return f"{_CONFIG_KEY.get()}.{argument}".removeprefix(".")


def argument_error(message: str) -> InputError:
    """Return the error of a wrong argument. message: begins with the argument's name."""
    return InputError(config_key(message))


def require(
    argument: str,
    value: Any,
    *,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
) -> None:
    """Raise InputError, naming argument, value and bounds, unless `value` is finite and within the bounds."""
    try:
        finite = math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        raise argument_error(f"{argument} is too large: must be finite") from None
    except TypeError:
        raise argument_error(f"{argument} is {value!r}: must be a number") from None
    bounds = {
        f"greater than {above:g}" if above is not None else "": above is None or value > above,
        f"at least {at_least:g}" if at_least is not None else "": at_least is None or value >= at_least,
        f"at most {at_most:g}" if at_most is not None else "": at_most is None or value <= at_most,
        "finite": finite,
    }
    if not all(bounds.values()):
        raise argument_error(
            f"{argument} is {value:g}: must be {' and '.join(name for name in bounds if name)}"
        )


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a hint for an error message: "did you mean NAME? ", or "" if no known name is similar."""
    close = difflib.get_close_matches(name, sorted(names), n=1)
    return f"did you mean {close[0]}? " if close else ""
