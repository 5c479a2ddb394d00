"""The config reference of the documentation: every key with its default, its type and its comment, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from lme.robots import Robot
from runners.config import instantiate, schema
from runners.config.catalogue import Catalogue, Key, shipped
from runners.config.hydra_errors import describe_expected
from runners.config.wording import markdown_table, without_markup

_SCHEMAS = {"robot": Robot}  # groups that are a dataclass themselves; the others name a class in `_target_`
_NO_KEYS = {"experiment", "system"}  # their keys are those of other groups, or figures of the paper
_NOTES = {
    "experiment": "`experiment=` sets several groups and keys at once. What has a folder belongs to that command, "
    "where the folder may be left out: `lme figure experiment=task`.",
    "space": "Without `space=`, `lme train` takes the file of the guide, and for another guide than LME the planner's.",
}


def pages() -> dict[str, str]:
    """Return the reference: a page for the commands, and one for each config group, by name."""
    configs = shipped()
    return {"commands": _commands(configs)} | {group: _group(configs, group) for group in groups(configs)}


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
    inner = sorted({each.name for folder in configs.folders for each in (folder / group).glob("*/")})
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
