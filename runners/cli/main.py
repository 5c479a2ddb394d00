"""The `lme` command: finds the commands in `runners/commands/` and runs the one that is named.

A command is one file there: a docstring whose first line says what it does, `EXAMPLES`, and
`main(argv) -> int`. A command that Hydra configures has a `conf/<command>.yaml`, and its help is made from
that. Nothing heavy is imported, and no command either, before one is run.
"""

from __future__ import annotations

import ast
import importlib
import os
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import lme
from lme.errors import InputError, nearest
from lme.resources import resource_dir
from runners.cli import commands, help

_FORMAT = warnings.formatwarning


def main(argv: Sequence[str] | None = None) -> int:
    """Run `lme` with these words, or those of the process; returns the exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    known = command_files()
    if not words or words[0] in ("-h", "--help", "help"):
        print(help.overview({name: title(path) for name, path in known.items()}))
        return 0
    if words[0] in ("-V", "--version"):
        print(f"lme {lme.__version__}")
        return 0
    sys.path.append(str(Path.cwd()))  # where a user's own planner may lie
    before, warnings.formatwarning = warnings.formatwarning, _warning
    warnings.simplefilter("once", UserWarning)
    try:
        return _run(words[0], words[1:], known)
    except InputError as error:
        print(f"lme {words[0]}: {error}" if words[0] in known else f"lme: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # `lme … | head`: nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    finally:
        warnings.formatwarning = before


def command_files() -> dict[str, Path]:
    """Every command's file by its name."""
    files = [path for folder in commands.__path__ for path in Path(folder).glob("[!_]*.py")]
    first = {path.stem.replace("_", "-"): path for path in reversed(files)}  # as import finds them
    return dict(sorted(first.items()))


def title(path: Path) -> str:
    """The first line of a module's docstring, read without importing it."""
    return (ast.get_docstring(_parsed(path)) or "").partition("\n")[0]


def examples(path: Path) -> tuple[str, ...]:
    """A module's `EXAMPLES`, read without importing it."""
    for statement in _parsed(path).body:
        if isinstance(statement, ast.Assign) and getattr(statement.targets[0], "id", "") == "EXAMPLES":
            return tuple(ast.literal_eval(statement.value))
    return ()


def _parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _run(name: str, argv: list[str], known: dict[str, Path]) -> int:
    if name not in known:
        raise InputError(f"{name}: no such command; {nearest(name, known)}there are: {', '.join(known)}")
    if {"-h", "--help"} & set(argv) and (resource_dir("conf") / f"{name}.yaml").is_file():
        print(help.command(name, title(known[name]), examples(known[name]), argv))
        return 0
    module = importlib.import_module(f"{commands.__name__}.{known[name].stem}")
    return int(module.main(argv))


def _warning(message: Warning | str, category: type[Warning], *place: Any) -> str:
    """One line for what concerns the user; the rest as Python shows it."""
    return f"lme: warning: {message}\n" if category is UserWarning else _FORMAT(message, category, *place)


if __name__ == "__main__":
    sys.exit(main())
