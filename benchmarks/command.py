"""Runs a benchmark as a command: a mistake of the user's is one line, and the exit status 2."""

import sys
from collections.abc import Callable
from pathlib import Path

from lme.errors import InputError


def run_main(main: Callable[[], None]) -> None:
    """Run `main`; of an InputError print only its line, as `lme` does."""
    try:
        main()
    except InputError as error:
        print(error, file=sys.stderr)
        sys.exit(2)


def check_named(option: str, path: Path | None) -> None:
    """Raise InputError if there is no such path. option: the option that named it; None: it was not named."""
    if path is not None and not path.exists():
        raise InputError(f"{option} {path}: no such file or folder")
