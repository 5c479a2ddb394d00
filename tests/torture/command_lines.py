"""Command lines: overrides of every command that Hydra configures, and words for the others."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from tests.torture.mutations import Rng, value

_FILE = "words.json"
_COMMANDS = ("eval", "train", "learn", "replay", "figure", "live")
_SIGNS = ("", "+", "++", "~", "-", "=", "[", "{", "'", '"', "\\", "$", "${", "@", ":", ",", "\0", "\n", "%")
_VALUES = (
    "0", "-1", "1e999", "nan", "inf", "-inf", "null", "true", "[]", "{}", "[1,2,3]", "{a:1}", "1,2", "range(3)",
    "choice(1,2)", "interval(0,1)", "${seed}", "${oc.env:HOME}", "${x.y}", "'", '"', "???", "a b", "../x", "/dev/full",
    "99999999999999999999999", "1_000", "0x10", "ü", "[[[[", "{a:{b:{c:[1,{d:2}]}}}", "x" * 3000, "glob(*)", "_self_",
)  # fmt: skip
_WORDS = (
    "--text", "--output", "--format", "--into", "--help", "--cfg", "-m", "--list", "show", "import", "barn", "42", "-1",
    "--", "-", "/nowhere", "failures", "0/0", "dclp", "bash", "x" * 99, "ü", "a\nb", "--resolve", "--config-dir",
)  # fmt: skip
_OTHERS = (
    "table",
    "maps",
    "explain",
    "weights",
    "completion",
    "figure",
    "replay",
    "eval",
    "train",
    "nothing",
    "--x",
)


def write(folder: Path) -> None:
    """A command line that prints a config."""
    (folder / _FILE).write_text(json.dumps(["eval", "--cfg", "job"]))


def vary(rng: Rng, folder: Path) -> None:
    """A command with one to four overrides: keys that there are or nearly are, values that fit or do not."""
    command = str(rng.choice(_COMMANDS))
    words = [_override(rng, command) for _ in range(rng.integers(1, 5))]
    if rng.random() < 0.2:
        words.append("-m")
    _save(folder, [command, *words])


def vary_command(rng: Rng, folder: Path) -> None:
    """A command that Hydra does not configure, or `--cfg job` of one that it does, with odd words."""
    command = str(rng.choice(_OTHERS))
    words = [str(rng.choice(_WORDS)) for _ in range(rng.integers(0, 4))]
    if command in _COMMANDS:
        words = ["--cfg", "job", *words, _override(rng, command)]
    _save(folder, [command, *words])


def compose(folder: Path) -> None:
    """Everything that a command checks before it makes a directory."""
    from runners.config import command_line

    name, *words = _words(folder)
    command_line.compose(name, words, _validate(name))


def run(folder: Path) -> None:
    """The command itself."""
    from tests.torture.readers import command

    command(*_words(folder))


def _validate(name: str) -> Any:
    from runners.evaluate import evaluate, figure
    from runners.learning import learn
    from runners.recordings import run as replay
    from runners.training import train

    found = {"eval": evaluate, "train": train, "learn": learn, "figure": figure, "replay": replay}.get(name)
    return found.validate if found else lambda job: None


def _override(rng: Rng, command: str) -> str:
    keys = _keys(command)
    key = keys[rng.integers(len(keys))]
    how = rng.random()
    if how < 0.1:
        key = (
            key[: rng.integers(len(key) + 1)]
            + _SIGNS[rng.integers(len(_SIGNS))]
            + key[rng.integers(len(key)) :]
        )
    elif how < 0.15:
        key = f"{key}.{keys[rng.integers(len(keys))]}"
    given = _VALUES[rng.integers(len(_VALUES))] if rng.random() < 0.8 else str(value(rng))
    if rng.random() < 0.2:
        options = _options(key)
        given = options[rng.integers(len(options))] if options else given
    if rng.random() < 0.1:
        at = int(rng.integers(len(given) + 1))
        given = given[:at] + _SIGNS[rng.integers(len(_SIGNS))] + given[at:]
    sign = _SIGNS[rng.integers(5)] if rng.random() < 0.2 else ""
    return f"{sign}{key}={given}" if rng.random() < 0.97 else f"{sign}{key}"


@cache
def _keys(command: str) -> list[str]:
    """The dotted keys of a command's config, and its groups."""
    from omegaconf import OmegaConf

    from runners.config import schema
    from runners.config.changes import dotted_keys
    from runners.config.composer import Composer

    schema.register()
    with Composer(command, None) as composer:
        plain: Any = OmegaConf.to_container(composer.compose([]), resolve=False)
        own = {key for key in dotted_keys(plain) if not key.startswith("hydra")}
        return sorted({*own, *composer.slots, "hydra.run.dir", "hydra.sweeper.params", "hydra.job.chdir"})


@cache
def _options(group: str) -> list[str]:
    from runners.config import catalogue

    return catalogue.shipped().options(group)


def _words(folder: Path) -> list[str]:
    words: list[str] = json.loads((folder / _FILE).read_text())
    return words


def _save(folder: Path, words: list[str]) -> None:
    # No process can be given the one, and a message repeats the other.
    kept = [word.replace("\0", "").replace("\n", " ") for word in words]
    (folder / _FILE).write_text(json.dumps(kept))
