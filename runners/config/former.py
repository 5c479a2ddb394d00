"""Words of earlier versions: systems and planners that had an ablation in their names, such as lme_plus_no_memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from hydra.core.override_parser.overrides_parser import OverridesParser

from runners.config.ablations import GROUP
from runners.config.catalogue import Catalogue

_GROUPS = ("system", "planner")
_NONE = "none"


class _Choice(NamedTuple):
    """What an override chooses, in the order of a sweep: today's options, and for each the names of its ablations."""

    options: list[str]
    ablations: list[list[str]]


def option(group: str, name: str, catalogue: Catalogue) -> tuple[str, str] | None:
    """("lme_plus", "no_memory") for the former system lme_plus_no_memory; None for any other name."""
    if group not in _GROUPS or catalogue.has(f"{group}/{name}"):
        return None
    known = (known for known in catalogue.options(group) if name.startswith(f"{known}_"))
    pairs = ((known, name.removeprefix(f"{known}_")) for known in known)
    return next((pair for pair in pairs if pair[1] in catalogue.options(GROUP)), None)


def today(group: str, name: str, catalogue: Catalogue) -> str:
    """What stands for a former option, "system=lme_plus ablation=no_memory"; empty for any other."""
    pair = option(group, name, catalogue)
    return f"{group}={pair[0]} {GROUP}={pair[1]}" if pair else ""


def named(word: str, catalogue: Catalogue) -> str:
    """The first former option that an override names; empty if it names none."""
    group = _group(word)
    names = _values(word) if group in _GROUPS else []
    return next((name for name in names if option(group, name, catalogue)), "")


def in_todays_words(words: Sequence[str], catalogue: Catalogue) -> list[str]:
    """The overrides of an earlier run with today's options and ablations; as they are where these cannot say it.

    Ablations are a factor of a sweep like any other key. So they cannot say that some systems have one and others not.
    """
    former = [word for word in words if named(word, catalogue)]
    choices = {word: _choice(word, catalogue) for word in words if word in former or _group(word) == GROUP}
    swept = [word for word, choice in choices.items() if len(choice.ablations) > 1]
    if not former or len(swept) > 1 or any(len(set(choices[word].options)) > 1 for word in former):
        return list(words)
    always = [
        name for choice in choices.values() if len(choice.ablations) == 1 for name in choice.ablations[0]
    ]
    varied = choices[swept[0]].ablations if swept else [[]]
    ablation = f"{GROUP}={','.join(_together([*always, *names]) for names in varied)}"
    place = swept[0] if swept else former[0]
    now = []
    for word in words:
        now += [f"{_group(word)}={choices[word].options[0]}"] if word in former else []
        now += [ablation] if word == place else []
        now += [word] if word not in choices else []
    return now


def _choice(word: str, catalogue: Catalogue) -> _Choice:
    if _group(word) == GROUP:
        return _Choice([], [[name for name in _names(value) if name != _NONE] for value in _values(word)])
    pairs = [option(_group(word), name, catalogue) or (name, _NONE) for name in _values(word)]
    return _Choice([pair[0] for pair in pairs], [[pair[1]] if pair[1] != _NONE else [] for pair in pairs])


def _together(names: Sequence[str]) -> str:
    return f"[{','.join(names)}]" if len(names) > 1 else "".join(names) or _NONE


def _names(value: str) -> list[str]:
    return [name.strip() for name in value.strip("[]").split(",")]


def _values(word: str) -> list[str]:
    """The values of an override: of a sweep, all of them."""
    parsed = OverridesParser.create().parse_override(word)
    if parsed.is_discrete_sweep():
        return list(parsed.sweep_string_iterator())
    return [] if parsed.is_sweep_override() else [parsed.get_value_element_as_str()]


def _group(word: str) -> str:
    return word.partition("=")[0].lstrip("+")
