"""Help texts: of `lme` itself, and of commands with a config or with options of their own.

They must appear at once: nothing heavy is imported.
"""

from __future__ import annotations

import argparse
import shutil
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from runners.config import catalogue
from runners.records import trust

_COLUMN = 24  # where descriptions start

_EXAMPLES = (
    "lme eval map=barn",
    "lme eval --help",
)

_WORLDS = (
    "map.worlds=0-49",
    "drive these worlds of the map set; or a number, or a list of both: [0-9,20,30-39]",
)
_HOW_TO = (
    ("-m, --multirun", "sweep: run every combination of comma-separated values, e.g. -m seed=0,1,2"),
    ("resume=true", "finish the newest run with this config: records that exist are kept"),
    ("resume=DIR", "finish the run in that directory, with the overrides that it was started with"),
    ("hydra.run.dir=DIR", "write to that directory instead of outputs/{command}/… (hydra.sweep.dir with -m)"),
    ("--config-dir DIR", "add your own options: DIR/robot/mine.yaml makes robot=mine"),
    (
        "--trust",
        "run the code that a run or recording named here has used; without it, only lme's own is run",
    ),
    ("--cfg job", "print the composed config with every key that can be set, and run nothing"),
    ("--info defaults", "print which files the config is composed from"),
    ("--hydra-help", "print Hydra's own help"),
)


def overview(commands: Mapping[str, str]) -> str:
    """Return the help of `lme` itself. commands: one line about each, by name."""
    return "\n".join(
        [
            "Local-Minimum Escaper: mapless robot navigation, from a config to the paper's table.",
            "",
            "usage: lme COMMAND [ARGUMENTS]",
            "",
            "commands:",
            *_table(commands.items()),
            "",
            "examples:",
            *(f"  {example}" for example in _EXAMPLES),
            "",
            "Every command explains itself: lme COMMAND --help.",
            "LME_TRACEBACK=1 lme COMMAND shows the traceback of an error in your own planner, criterion, …",
            'Completion by tab: eval "$(lme completion bash)", or zsh.',
        ]
    )


def command(name: str, title: str, examples: Sequence[str], words: Sequence[str] = ()) -> str:
    """Return the help of a command that is configured by `conf/NAME.yaml`.

    words: the command line's. For a command with kinds (`lme NAME KIND`), they choose the kind whose keys are shown.
    """
    configs = catalogue.shipped()
    # Find the kind that the words choose, or the default one.
    kinds = configs.options(name)
    usage = "[KIND] [GROUP=OPTION ...]" if kinds else "[GROUP=OPTION ...]"
    kind = next((word for word in words if word in kinds), configs.groups(name).get(name))
    return "\n".join(
        [
            title,
            "",
            f"usage: lme {name} {usage} [KEY=VALUE ...] [-m] [--config-dir DIR] [--cfg job]",
            "",
            "examples:",
            *(f"  {example}" for example in examples),
            "",
            "groups, each with its options (* is the default):",
            *_groups(configs, name),
            "",
            "keys:",
            *_keys(configs, name),
            *(_keys(configs, f"{name}/{kind}", f"{name}.") if kinds else ()),
            *_table([("robot.v_max=1.0, ...", "any key of the options chosen; --cfg job prints them all")]),
            "",
            "how to:",
            *_table((_WORLDS,) if "map" in configs.groups(name) else ()),
            *_table((how, template.format(command=name)) for how, template in _HOW_TO),
        ]
    )


def _keys(configs: catalogue.Catalogue, name: str, prefix: str = "") -> list[str]:
    """Return the keys of a YAML file, each with its value and its comment."""
    return _table((f"{prefix}{key.name}={key.value}", key.comment) for key in configs.keys(name))


def _groups(configs: catalogue.Catalogue, command_name: str) -> list[str]:
    lines = []
    for group, default in configs.groups(command_name).items():
        kind, package, _ = group.partition("@")
        if package:  # one more choice of a group, at another place of the config
            lines.append(f"  {group}: an option of {kind}; * {default}")
            continue
        options = configs.choices(group, command_name)
        lines.append(f"  {group}" if options else f"  {group}: none yet; add DIR/{group}/NAME.yaml")
        rows = (
            (("* " if name == default else "  ") + name, configs.title(file))
            for name, file in options.items()
        )
        lines += _table(rows)
    return lines


def _table(rows: Iterable[tuple[str, str]]) -> list[str]:
    """Return two columns, the second wrapped to the terminal."""
    width = max(shutil.get_terminal_size().columns, 60)
    lines = []
    for left, right in rows:
        label = f"  {left}".ljust(_COLUMN - 1) + " "
        wrapped = textwrap.wrap(right, width, initial_indent=label, subsequent_indent=" " * _COLUMN)
        lines += wrapped or [label.rstrip()]
    return lines


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Describe --trust, which `runners/cli/main.py` removes from the words of every command."""
    help_text = "run the code that a run names (SECURITY.md); without it, only lme's own is run"
    parser.add_argument(trust.FLAG, action="store_true", help=help_text)


def texts(description: str | None, examples: Iterable[str], notes: str = "") -> dict[str, Any]:
    """Return keywords for `ArgumentParser` and `add_parser`; the help ends with notes, if any, and examples."""
    example_text = "\n".join(["examples:", *(f"  {example}" for example in examples)])
    return {
        "description": description,
        "epilog": f"{notes}\n\n{example_text}" if notes else example_text,
        "formatter_class": argparse.RawDescriptionHelpFormatter,
    }
