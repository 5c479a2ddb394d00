"""Compose `conf/` without Hydra, for the library, help and everything but the command line.

`compose` merges a file with those that its defaults list names, which takes nothing but YAML. `resolved` then
replaces the interpolations. OmegaConf does this, as it does for Hydra, so a user's file means the same to a robot's
own program as to `lme eval`; a parser of our own would be simpler only for the few forms that our own files use.
"""

from __future__ import annotations

import math
import os.path
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from string import Template
from typing import Any, cast

from lme.errors import InputError, nearest
from lme.inputs.guarded_file import YAML_BYTES, read_text, read_yaml
from lme.inputs.resources import overlaid, resource_dir

SHIPPED = (resource_dir("conf"),)  # the config folders without those of a user
CUSTOM = "custom"  # the option of a group that takes a class of the user's own
_SELF, _HERE = "_self_", "_here_"
_USUAL = re.compile(r"\$\{usual_sim:(\w+),(\w+)\}")  # with the groups that it names filled in


@dataclass(frozen=True, slots=True)
class Option:
    """A file of a config group, merged over those that it inherits.

    package: the dotted key under which the whole config holds it; empty for a file with `# @package _global_`.
    settings: its keys within the whole config. choices: the options of other groups that it chooses. files: the
    files that were merged, in this order.
    """

    package: str
    settings: dict[str, Any]
    choices: dict[str, Any]
    files: tuple[Path, ...]

    @property
    def values(self) -> dict[str, Any]:
        """The keys as the file has them, below its package."""
        values = self.settings
        for name in filter(None, self.package.split(".")):
            values = values.get(name, {})
        return values


def find(name: str, folders: Sequence[Path] = SHIPPED) -> Path | None:
    """Return the YAML `name` ("robot/jackal") in the first folder that has it; None if there is none."""
    files = (folder / f"{name}.yaml" for folder in folders)
    return next(filter(os.path.isfile, files), None)  # Path.is_file raises for long names


def folders_of(file: Path, group: str) -> tuple[Path, ...]:
    """Return the folders for the defaults of a file: those that ship, and its own if it lies in one named `group`."""
    folder = file.absolute().parent
    return (*SHIPPED, folder.parent) if folder.name == group else SHIPPED


def compose(
    file: Path,
    group: str,
    folders: Sequence[Path] | None = None,
    choices: Mapping[str, str] | None = None,
) -> Option:
    """Merge the file of an option of `group` with those that its defaults list names.

    group: empty for the config of a command. folders: None for those of `folders_of`. choices: options of other
    groups, for a list with `${planner}`; entries that depend on another choice are left out. A user's file for a
    shipped class inherits from the shipped file of this class, so that it may leave keys out. Raises InputError for a
    file that cannot be read or composed.
    """
    own = _composed(file, group, None, folders or folders_of(file, group), choices or {}, ())
    base = None if file.is_relative_to(SHIPPED[0]) else _introducing(group, own.values.get("_target_"))
    if base is None or base in own.files:
        return own
    shipped = _composed(base, group, own.package, SHIPPED, {}, ())
    return replace(
        own,
        settings=overlaid(shipped.settings, own.settings),
        choices=shipped.choices | own.choices,
        files=(*shipped.files, *own.files),
    )


@cache
def _introducing(group: str, target: object) -> Path | None:
    """Return the shipped file that says `_target_: target` itself, so that others inherit it; None if there is none."""
    files = sorted((SHIPPED[0] / group).glob("*.yaml"))
    return next((file for file in files if target is not None and own_target(file) == target), None)


def own_target(file: Path) -> str | None:
    """Return the class that a file itself names, rather than one that it inherits from; None if it names none."""
    lines = read_text(file, YAML_BYTES).splitlines()
    return next((line.split()[1] for line in lines if line.startswith("_target_: ")), None)


def resolved(group: str, values: Mapping[str, Any], config: Mapping[str, Any], place: str) -> dict[str, Any]:
    """Replace the interpolations in the values of a group.

    config: the other keys of the whole config. place: the source of the values, for messages. Raises InputError for
    an interpolation that leads nowhere.
    """
    if "${" not in str(values):
        return dict(values)
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    register_resolvers()
    try:
        whole = OmegaConf.create({**config, group: values})
        return cast(dict[str, Any], OmegaConf.to_container(whole[group], resolve=True))
    except OmegaConfBaseException as error:
        reason = str(error).splitlines()[0]
        raised = "InputError raised while resolving interpolation: "
        place = "" if reason.startswith(raised) else f"{place}: "
        raise InputError(f"{place}{reason.removeprefix(raised)}") from error


def parameters(
    weights: str,
    ablation: Mapping[str, float],
    criteria: Iterable[str] = (),
    scale: Mapping[str, float] | None = None,
    weight_set: str | None = None,
) -> dict[str, float]:
    """Return the parameters of a weight set, multiplied by `scale`, with those of the ablation in their place.

    weights: a name in `conf/weight_set/` or `outputs/weights/`, the directory of a training run, or the path of
    a YAML with a mapping `parameters`; the paper's set stands for the guide's own. criteria: names of criteria besides
    those of the guide's own set. scale: factors by name; an ablation replaces what they give. weight_set: the guide's
    own; None: the paper's. Raises InputError naming the file where it is missing or malformed, and for a scale of no
    parameter or a factor that is negative or not finite.
    """
    # Imported only here, since help composes too and must answer at once.
    from lme.guides.lme.weight_files import PUBLISHED, learned_parameters

    learned = learned_parameters(weights, weight_set or PUBLISHED, criteria)
    factors = scale or {}
    for name, factor in factors.items():
        if name not in learned:
            names = sorted(learned)
            raise InputError(
                f"scale.{name}: no such key; {nearest(name, names)}scale holds: {', '.join(names)}"
            )
        if not (math.isfinite(factor) and factor >= 0):
            raise InputError(f"scale.{name} is {factor:g}: must be a number, at least 0 and finite")
    return {**learned, **{name: learned[name] * factor for name, factor in factors.items()}, **ablation}


def usual(option: str | None, choices: Mapping[str, str | None]) -> str | None:
    """Return an option of a defaults list by the options of other groups, without OmegaConf, since help must be quick.

    The list may name a group, as ${guide}, or say ${usual_sim:${map},${robot}}.
    """
    chosen = None if option is None else Template(option).safe_substitute(choices)
    words = _USUAL.fullmatch(chosen or "")
    return _usual_sim(*words.groups()) if words else chosen


def register_resolvers() -> None:
    """Make the resolvers of `conf/` known to OmegaConf; safe to call again."""
    from omegaconf import OmegaConf

    OmegaConf.register_new_resolver("parameters", _parameters, replace=True)
    OmegaConf.register_new_resolver("given", _given, replace=True)
    OmegaConf.register_new_resolver("when", _when, replace=True)
    OmegaConf.register_new_resolver("start_on", _start_on, replace=True)
    OmegaConf.register_new_resolver("usual_sim", _usual_sim, replace=True)


def _parameters(*, _root_: Any, _parent_: Any) -> dict[str, float]:
    """Resolve the parameters of a guide, whose other keys are beside this one."""
    from omegaconf import OmegaConf

    criteria, weight_set = _parent_.get("criteria") or (), _parent_.get("weight_set")
    scale = OmegaConf.select(_root_, "scale")
    return parameters(_root_.weights, _root_.ablation, criteria, scale, weight_set)


def _given(key: str, default: Any, *, _root_: Any) -> Any:
    """Resolve to another key of the whole config; to the default if there is no such key, or if it is null."""
    from omegaconf import OmegaConf

    value = OmegaConf.select(_root_, key)
    return default if value is None else value


def _when(key: str, value: Any, *, _root_: Any) -> Any:
    """Resolve to the value if a key of the whole config is true, else to null."""
    from omegaconf import OmegaConf

    return value if OmegaConf.select(_root_, key) else None


def _start_on(subset: str, default: Any, *, _root_: Any) -> Any:
    """Resolve to the start that the simulator has for a subset of BARN; to the default if it has none."""
    from omegaconf import OmegaConf

    start = OmegaConf.select(_root_, f"sim.{subset}_start")
    return default if start is None else start


def _usual_sim(map_set: str, robot: str) -> str:
    """Return the simulator of `lme eval` if none is named: BARN's own for BARN's robot, else the fast one."""
    return "gazebo" if (map_set, robot) == ("barn", "jackal") else "fast"


def _composed(
    file: Path,
    group: str,
    package: str | None,
    folders: Sequence[Path],
    choices: Mapping[str, str],
    heirs: tuple[Path, ...],
) -> Option:
    """Merge a file with those that it inherits; see `compose`.

    package: the dotted key that holds it; None for the file's own. heirs: the files that inherit this one.
    """
    if file in heirs:
        raise InputError(f"{file}: inherits itself; its defaults must name other files")
    # Read the file's own keys, and place them under its package.
    content = read_yaml(file) or {}
    if not isinstance(content, dict):
        raise InputError(f"{file}: must be a mapping of keys to values")
    entries = content.get("defaults", [])
    if not isinstance(entries, list):
        raise InputError(f"{file}: defaults is {entries!r:.80}: must be a list")
    package = _package(file, group) if package is None else package
    own: dict[str, Any] = {key: value for key, value in content.items() if key != "defaults"}
    for name in reversed(list(filter(None, package.split(".")))):
        own = {name: own}

    # Merge in the order of the defaults list; without `_self_`, the file's own keys come last.
    settings: dict[str, Any] = {}
    chosen: dict[str, Any] = {}
    files: list[Path] = []
    for entry in entries if _SELF in entries else [*entries, _SELF]:
        if entry == _SELF:
            settings, files = overlaid(settings, own), [*files, file]
            continue
        slot, option = next(iter(entry.items())) if isinstance(entry, dict) and entry else ("", entry)
        *keywords, slot = str(slot).split(" ")  # keywords: optional, override
        # An entry for another group, or any in the config of a command, only chooses an option.
        if slot and (not group or slot.startswith("/")):
            chosen[slot.removeprefix("/")] = option
            continue
        try:
            option = None if option is None else Template(str(option)).substitute(choices)
        except (KeyError, ValueError):  # a choice that has not been made
            option = None
        if option is None:
            continue

        # An inherited file has the package of its own group, unless the list names another.
        subgroup, _, target = slot.partition("@")
        name = option[1:] if option.startswith("/") else "/".join(filter(None, (group, subgroup, option)))
        base = find(name, folders)
        if base is not None:
            base_group = name.rpartition("/")[0]
            where = {"": None, _HERE: package}.get(target, f"{package}.{target}".strip("."))
            layer = _composed(base, base_group, where, folders, choices, (*heirs, file))
            settings, files = overlaid(settings, layer.settings), [*files, *layer.files]
            chosen |= layer.choices
        elif group and "optional" not in keywords:  # the schema of a command is listed too, but is not a file
            raise InputError(f"{file}: its defaults name {name}.yaml, which does not exist")
    return Option(package, settings, chosen, tuple(files))


def _package(file: Path, group: str) -> str:
    """The dotted key under which the whole config holds a file, by its first comments or its group."""
    lines = read_text(file, YAML_BYTES).splitlines()
    is_global = any(line.strip("# ").split() == ["@package", "_global_"] for line in lines if line[:1] == "#")
    return "" if is_global else group.replace("/", ".")
