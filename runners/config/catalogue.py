"""Options in `conf/` with their comments, for help, the documentation and checks."""

from __future__ import annotations

import os.path
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from lme.config import composer
from lme.config.composer import SHIPPED
from lme.errors import InputError
from lme.inputs.guarded_file import YAML_BYTES, SafeLoader, UnfoldingError, check_structure, read_text


@dataclass(frozen=True, slots=True)
class Key:
    """One value of a YAML file: dotted name, value as written, and the comment after or above it."""

    name: str
    value: str
    comment: str


@dataclass(frozen=True, slots=True)
class Catalogue:
    """Config folders, the shipped one first."""

    folders: tuple[Path, ...]

    def groups(self, config_name: str) -> dict[str, str | None]:
        """Return the config groups of a command in the order of its defaults list, each with its default option."""
        choices = self.option(config_name).choices
        groups = {group: option for group, option in choices.items() if not group.startswith("hydra/")}
        return {group: composer.usual(option, groups) for group, option in groups.items()}

    def choices(self, group: str, command: str) -> dict[str, str]:
        """Return the options of a group with their files; experiments are the command's, if it has a folder of them.

        A user's own experiments count for every command.
        """
        files = {option: f"{group}/{option}" for option in self.options(group)}
        own = self.options(f"{group}/{command}") if group == "experiment" else []
        if not own:
            return files
        users = Catalogue(self.folders[1:]).options(group)
        named = {option: f"{group}/{command}/{option}" for option in own}
        return dict(sorted({**named, **{option: files[option] for option in users}}.items()))

    def options(self, group: str) -> list[str]:
        """Return the names of a group's options. A file named _… is not an option: others inherit it."""
        folders = filter(os.path.isdir, (folder / group for folder in self.folders))
        return sorted({path.stem for folder in folders for path in folder.glob("[!_]*.yaml")})

    def has(self, name: str) -> bool:
        """Return whether a folder has the YAML `name`."""
        return composer.find(name, self.folders) is not None

    def file(self, name: str) -> Path:
        """Return the first file with the YAML `name`, such as "robot/jackal". Raises FileNotFoundError."""
        file = composer.find(name, self.folders)
        if file is None:
            raise FileNotFoundError(name)
        return file

    def option(self, name: str) -> composer.Option:
        """Compose the YAML `name` with those that it inherits. Raises FileNotFoundError and InputError."""
        return composer.compose(self.file(name), name.rpartition("/")[0], self.folders)

    def values(self, name: str) -> dict[str, Any]:
        """Return the values of the YAML `name`, inherited ones included, without its defaults list."""
        return self.option(name).values

    def title(self, name: str) -> str:
        """Return the first comment line of the YAML `name`."""
        lines = _text(self.file(name)).splitlines()
        comments = (line[1:].strip() for line in lines if line.startswith("#"))
        return next((line for line in comments if not line.startswith("@package")), "")

    def titles(self, group: str) -> dict[str, str]:
        """Return the options of a group, each with its title."""
        return {option: self.title(f"{group}/{option}") for option in self.options(group)}

    def keys(self, name: str) -> list[Key]:
        """Return every value of the YAML `name`, inherited ones included, in order, without defaults and `_target_`.

        A key without a comment of its own has the inherited one.
        """
        keys_by_name: dict[str, Key] = {}
        for file in self.option(name).files:
            text = _text(file)
            for key in _walk(yaml.compose(text, SafeLoader), text.splitlines(), ""):
                comment = key.comment or (keys_by_name[key.name].comment if key.name in keys_by_name else "")
                keys_by_name[key.name] = replace(key, comment=comment)
        return list(keys_by_name.values())


def shipped(*more: Path) -> Catalogue:
    """Return the catalogue of `conf/` and of the user's own folders."""
    return Catalogue((*SHIPPED, *more))


def check_structure_of(file: Path) -> None:
    """Raise InputError for a YAML file that is too large, nested too deeply, or inflated by aliases."""
    try:
        check_structure(_text(file))
    except UnfoldingError as error:
        raise InputError(f"{file}: not valid YAML ({error})") from error
    except yaml.YAMLError:
        pass  # left to the reader of the file: OmegaConf accepts a little more


def _text(file: Path) -> str:
    try:
        return read_text(file, YAML_BYTES)
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: not valid YAML in UTF-8 ({error})") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from error


def _walk(node: Any, lines: list[str], prefix: str) -> Iterator[Key]:
    if not isinstance(node, yaml.MappingNode):
        return
    for key, value in node.value:
        name = f"{prefix}{key.value}"
        if name in ("defaults", "_target_"):
            continue
        if isinstance(value, yaml.MappingNode) and value.value:
            yield from _walk(value, lines, f"{name}.")
        else:
            yield Key(name, _written(value, lines), _comment(key, value, lines))


def _written(value: Any, lines: list[str]) -> str:
    """Return the value as written in the file, shortened to its first line."""
    start, end = value.start_mark, value.end_mark
    stop = end.column if end.line == start.line else None
    return lines[start.line][start.column : stop].strip() if start.line < len(lines) else ""


def _comment(key: Any, value: Any, lines: list[str]) -> str:
    """Return the comment after the value, or else the line of comment above the key; the first line is the title."""
    line = key.start_mark.line
    after = lines[line][value.end_mark.column :] if value.end_mark.line == line else ""
    if "#" in after:
        return after.partition("#")[2].strip()
    above = lines[line - 1].strip() if line > 1 else ""
    return above[1:].strip() if above.startswith("#") else ""
