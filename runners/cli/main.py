"""The `lme` command: finds the commands in `runners/cli/commands/` and runs the one given.

Each command is one file there: a docstring whose first line says what it does, `EXAMPLES`, and `main(argv) -> int`. A
command that Hydra configures has a `conf/<command>.yaml`, from which its help is made. Neither a heavy package nor a
command is imported before a command runs.
"""

from __future__ import annotations

import sys

if __name__ == "__main__" and not sys.flags.safe_path:
    sys.path.append(sys.path.pop(0))  # the working folder, which `python -m` puts first

import ast
import atexit
import contextlib
import gc
import importlib
import os
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

import lme
from lme.errors import InputError, nearest
from lme.inputs.resources import resource_dir
from lme.inputs.user_code import explained, show_traceback
from runners.cli import commands
from runners.cli.guards import (
    explain_missing,
    explain_os_error,
    plain_output,
    starting,
    status_of,
    terminable,
)
from runners.config.escaping import masked_text
from runners.records import trust
from runners.workers.environment import SAFE_PATH, environment, search_working_folder_last


@plain_output()
def main(argv: Sequence[str] | None = None) -> int:
    """Run `lme` with these words, or those of the process; return the exit status."""
    # Collect garbage less often, and not at exit: libraries create a million objects that all stay alive.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    stdout_lost = open_streams()
    words = list(sys.argv[1:] if argv is None else argv)
    name = words[0] if words else "--help"
    command_paths = command_files()
    search_working_folder_last()
    # Run the command with the guards that all commands share; each takes --trust, which allows a run's own code.
    trusting = trust.trusting(None) if trust.FLAG in words else contextlib.nullcontext()
    try:
        with plain_warnings(), terminable(), environment(SAFE_PATH), trusting:
            status = _run(name, [word for word in words[1:] if word != trust.FLAG], command_paths)
            sys.stdout.flush()
            if stdout_lost:
                print(f"lme {name}: standard output is closed, so nothing could be shown", file=sys.stderr)
            return status or int(stdout_lost)
    # Translate what ended it into a message and an exit status.
    except InputError as error:
        message = masked_text(str(error))
        print(f"lme {name}: {message}" if name in command_paths else f"lme: {message}", file=sys.stderr)
        show_traceback(error)
        return 2
    except KeyboardInterrupt as interrupt:
        return status_of(interrupt)
    except BrokenPipeError:  # `lme … | head`: the reader has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (Exception, SystemExit) as error:
        message = _explain(error, name) or explained(error)
        if not message:
            raise
        print(f"lme {name}: {message}", file=sys.stderr)
        show_traceback(error)
        return 1


def _explain(error: BaseException, command: str) -> str:
    """Return the message for a failed episode or a reason outside the program; empty for an error of lme."""
    from runners.workers.executor import EpisodeError

    if isinstance(error, EpisodeError):
        return str(error)
    if isinstance(error, ModuleNotFoundError):
        return explain_missing(error, command)
    return explain_os_error(error) if isinstance(error, OSError) else ""


def open_streams() -> bool:
    """Make the three standard streams usable; return whether printed output is lost, as after `lme … >&-`.

    A closed stream is redirected to the null device: otherwise the next opened file would get its number, and printed
    text would be written into that file. A character that the terminal's encoding lacks becomes a question mark.
    """
    stdout_lost = sys.stdout is None
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number and not _is_open(number):
                os.dup2(null, number)
            setattr(sys, name, open(null, "w" if number else "r", encoding="utf-8", closefd=False))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if getattr(stream, "errors", "") in ("strict", "surrogateescape") and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    return stdout_lost


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def command_files() -> dict[str, Path]:
    """Return every command's file by the command's name."""
    files = [path for folder in commands.__path__ for path in Path(folder).glob("[!_]*.py")]
    files_by_command = {path.stem.replace("_", "-"): path for path in reversed(files)}  # as import finds them
    return dict(sorted(files_by_command.items()))


def title(path: Path) -> str:
    """Return the first line of a module's docstring, read without importing it."""
    return (ast.get_docstring(_parsed(path)) or "").partition("\n")[0]


def examples(path: Path) -> tuple[str, ...]:
    """Return a module's `EXAMPLES`, read without importing it."""
    for statement in _parsed(path).body:
        if isinstance(statement, ast.Assign) and getattr(statement.targets[0], "id", "") == "EXAMPLES":
            return tuple(ast.literal_eval(statement.value))
    return ()


def _parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _run(name: str, argv: list[str], command_paths: dict[str, Path]) -> int:
    if name in ("-h", "--help", "help"):
        from runners.cli import help

        print(help.overview({name: title(path) for name, path in command_paths.items()}))
        return 0
    if name in ("-V", "--version"):
        print(f"lme {lme.__version__}")
        return 0
    if name not in command_paths:
        raise InputError(
            f"{name}: no such command; {nearest(name, command_paths)}there are: {', '.join(command_paths)}"
        )
    if {"-h", "--help"} & set(argv) and (resource_dir("conf") / f"{name}.yaml").is_file():
        from runners.cli import help

        print(help.command(name, title(command_paths[name]), examples(command_paths[name]), argv))
        return 0
    if (resource_dir("conf") / f"{name}.yaml").is_file():
        with starting(name):
            importlib.import_module("runners.cli.launch")
    module = importlib.import_module(f"{commands.__name__}.{command_paths[name].stem}")
    return int(module.main(argv))


@contextlib.contextmanager
def plain_warnings() -> Iterator[None]:
    """Show each warning that concerns the user once, in one line; show other warnings as Python does.

    Python's own "once" forgets what it has shown whenever a library changes the filters.
    """
    shown_texts: set[str] = set()
    original_format = warnings.formatwarning

    def plain(
        message: Warning | str, category: type[Warning], filename: str, lineno: int, line: str | None = None
    ) -> str:
        if category is not UserWarning:
            return original_format(message, category, filename, lineno, line)
        text = f"lme: warning: {masked_text(str(message))}\n"
        is_new = text not in shown_texts
        shown_texts.add(text)
        return text if is_new else ""

    # Python prints what the formatter returns: nothing for a warning that was shown before.
    warnings.formatwarning = plain
    warnings.simplefilter("always", UserWarning)
    try:
        yield
    finally:
        warnings.formatwarning = original_format


if __name__ == "__main__":
    sys.exit(main())
