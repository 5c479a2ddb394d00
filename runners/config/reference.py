"""The reference of the documentation: every config key and every field of a dataclass, with type, default and meaning.

`pages` gives the keys of `conf/` as Markdown; `fields` and `as_rst` those of one class, for the Python reference.
`python -m runners.config.reference` writes the pages anew into `docs/reference/config/`.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from lme.config import composer
from lme.robots import Robot
from runners.config import catalogue, instantiate, schema
from runners.config.catalogue import Catalogue, Key, shipped
from runners.config.escaping import markdown_table, without_markup
from runners.config.instantiate import dataclass_of, describe_expected

_SCHEMAS = {"robot": Robot}  # groups that are a dataclass themselves; the others name a class in `_target_`
_NO_KEYS = {"experiment", "system"}  # their keys are those of other groups, or figures of the paper
_NOTES = {
    "experiment": "`experiment=` sets several groups and keys at once. What has a folder belongs to that command, "
    "where the folder may be left out: `lme figure experiment=task`.",
    "space": "Without `space=`, `lme train` takes the file of the guide, and for another guide than LME the planner's.",
}
FOLDER = Path(__file__).parents[2] / "docs" / "reference" / "config"
MARKS = "*|_"  # markup of reStructuredText, which comments do not mean
HEADER = ("Name", "Type", "Default", "Meaning")


def pages() -> dict[str, str]:
    """Return the reference: a page for the commands, and one for each config group, by name."""
    configs = shipped()
    return {"commands": _commands(configs)} | {group: _group(configs, group) for group in groups(configs)}


def write(folder: Path) -> None:
    """Write the pages into a folder, where those of former groups go."""
    folder.mkdir(parents=True, exist_ok=True)
    for page in folder.glob("*.md"):
        page.unlink()
    for name, text in pages().items():
        (folder / f"{name}.md").write_text(text, encoding="utf-8")


def groups(configs: Catalogue) -> list[str]:
    """Return the config groups of all commands, in the order of their first use."""
    used = [group for command in schema.COMMANDS for group in configs.groups(command) if "@" not in group]
    return list(dict.fromkeys(used))


def _commands(configs: Catalogue) -> str:
    sections = [
        "# Commands",
        "The keys of each command, and the config groups that it chooses from. `lme COMMAND --help` says the same.",
    ]
    for command, schema_class in schema.COMMANDS.items():
        chosen = configs.groups(command).items()
        sections += [
            f"## lme {command}",
            f"{configs.title(command)}.",
            _table(("Group", "Default"), ((_link(group), _code(default)) for group, default in chosen)),
            _keys(configs.keys(command), schema_class),
        ]
    return _joined(sections)


def _group(configs: Catalogue, group: str) -> str:
    commands = [f"`lme {command}`" for command in schema.COMMANDS if group in configs.groups(command)]
    sections = [f"# {group}", f"Options of `{group}=`, a group of {', '.join(commands)}."]
    sections += [_NOTES[group]] if group in _NOTES else []
    titles = {option: _plain(configs.title(file)) for option, file in _files(configs, group).items()}
    sections.append(_table(("Option", ""), ((_code(option), title) for option, title in titles.items())))
    if group not in _NO_KEYS:
        sections += [part for option in titles for part in _option(configs, group, option)]
    return _joined(sections)


def _files(configs: Catalogue, group: str) -> dict[str, str]:
    """Return the options of a group, each with its file; those in subfolders come last."""
    inner = sorted({path.name for folder in configs.folders for path in (folder / group).glob("*/")})
    options = [*configs.options(group)]
    options += [f"{name}/{option}" for name in inner for option in configs.options(f"{group}/{name}")]
    return {option: f"{group}/{option}" for option in options}


def _option(configs: Catalogue, group: str, option: str) -> list[str]:
    name = f"{group}/{option}"
    keys = configs.keys(name)
    target = configs.values(name).get("_target_")
    if not keys:
        return []
    schema_class = instantiate.config_class(target, group) if target else _SCHEMAS.get(group)
    title = _plain(configs.title(name)).removesuffix(".")
    made_by = f" Class `{target}`." if target else ""
    return [f"## {option}", f"{title}.{made_by}", _keys(keys, schema_class)]


def _keys(keys: Sequence[Key], schema_class: Any) -> str:
    rows = (
        (
            _code(key.name),
            _code(key.value),
            describe_expected(schema_class, key.name) if schema_class else "",
            _plain(key.comment),
        )
        for key in keys
    )
    return _table(("Key", "Default", "Type", "Meaning"), rows)


def _link(group: str) -> str:
    name = group.partition("@")[0]
    return f"[{group}]({name}.md)"


def _code(text: str | None) -> str:
    return f"`{text}`" if text else ""


def _plain(comment: str) -> str:
    """Escape the marks of emphasis, links and tags: a comment means them literally, as in _target_."""
    return without_markup(comment, "_*<[")


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    return markdown_table([head, ["---"] * len(head), *rows])


def _joined(sections: Iterable[str]) -> str:
    return "\n\n".join(sections) + "\n"


class ConfigField(NamedTuple):
    """One field. name: dotted for a field of a part. default: empty if there is none. meaning: includes the unit."""

    name: str
    type: str
    default: str
    meaning: str


def fields(schema: type) -> list[ConfigField]:
    """Return the fields of a dataclass in order; a part that is never absent is replaced by its own fields.

    Values and meanings of the Config of a shipped class are those of the YAML that names the class.
    """
    written = {key.name: key for key in _written(schema)}
    return [
        field._replace(default=written[field.name].value, meaning=written[field.name].comment)
        if field.name in written
        else field
        for field in _fields(schema, "")
    ]


def _written(schema: type) -> list[catalogue.Key]:
    """Return the keys of the shipped YAML of the class whose Config is `schema`; none if there is none."""
    configs = catalogue.shipped()
    for file in sorted(configs.folders[0].glob("*/*.yaml")):
        name = f"{file.parent.name}/{file.stem}"
        target = composer.own_target(file) or ""
        is_near = "." in target and schema.__module__.startswith(target.rpartition(".")[0])
        if is_near and instantiate.config_class(target, name) is schema:
            return configs.keys(name)
    return []


def as_rst(fields_shown: list[ConfigField]) -> list[str]:
    """Return the lines of a table in reStructuredText."""
    lines = [".. list-table::", "   :header-rows: 1", "   :class: fields", ""]
    rows = [
        (_literal(name), _literal(kind), _literal(default), without_markup(text, MARKS))
        for name, kind, default, text in fields_shown
    ]
    for row in (HEADER, *rows):
        lines += [f"   {'  -' if at else '* -'} {cell}" for at, cell in enumerate(row)]
    return [*lines, ""]


def _fields(schema: type, prefix: str) -> Iterator[ConfigField]:
    comments = _comments(schema)
    for field in dataclasses.fields(schema):
        default = _default(field)
        part: Any = type(default) if dataclasses.is_dataclass(default) else None
        if default is dataclasses.MISSING:
            part = dataclass_of(get_type_hints(schema)[field.name])
        if part:
            yield from _fields(part, f"{prefix}{field.name}.")
            continue
        text = "" if default is dataclasses.MISSING else repr(default)
        yield ConfigField(f"{prefix}{field.name}", str(field.type), text, comments.get(field.name, ""))


def _default(field: dataclasses.Field[Any]) -> Any:
    if field.default_factory is not dataclasses.MISSING:
        return field.default_factory()
    return field.default


def _comments(schema: type) -> dict[str, str]:
    """Return the comments after the fields, inherited ones included, by name."""
    bases = [base for base in reversed(inspect.getmro(schema)) if dataclasses.is_dataclass(base)]
    lines = "".join(map(inspect.getsource, bases))
    return dict(re.findall(r"^    (\w+): .*?  # (.*)$", lines, re.MULTILINE))


def _literal(text: str) -> str:
    return f"``{text}``" if text else ""


if __name__ == "__main__":
    write(FOLDER)
