"""A system by name, as a navigator, without Hydra."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lme.config.presets import ablation_settings, configured, find_option, option
from lme.errors import InputError, nearest
from lme.guides.lme.weight_files import PUBLISHED, learned_parameters, own_weights, with_network
from lme.inputs.resources import overlaid
from lme.inputs.yaml_entry import read_yaml
from lme.navigation.navigator import Navigator
from lme.perception.people.source import people_source
from lme.robots import Robot
from lme.types import Guide, Planner

_PARTS = ("guide", "planner", "filter")
_OVERRIDE = re.compile(r"override /(\w+)")


def load_system(
    name: str,
    robot: Robot,
    *,
    weights: str | Path | None = None,
    goal_tolerance: float = 0.0,
    people: str = "truth",
    feedback: str = "OPEN_LOOP",
    **changes: Any,
) -> Navigator:
    """The navigator that `lme eval system=NAME` drives with::

        navigator = lme.load_system("lme_plus", robot)
        navigator = lme.load_system("lme", robot, planner="dwa_tuned", **{"guide.candidates.number": 500})

    name: in `conf/system/`. robot: it drives this one. weights: as on the command line; None: the system's own.
    goal_tolerance: the robot stops within this distance of the target [m]. people: "truth": those in the
    observations; "tracked": those found in the scans; "none". feedback: commands ramp from the last command
    (OPEN_LOOP) or from the measured twist (CLOSED_LOOP). changes: words of the command line, as keywords: `guide`,
    `planner` and `filter` by name or by the path of a YAML, `ablation` by name or several in a list, and any key of
    these parts, such as "planner.latency".

    Call `reset(rng)` before each episode, and `act(observation)` in each control period.

    Raises InputError for an unknown name or key, and for a wrong value.
    """
    chosen, own = _composed(name)
    chosen.update({group: changes.pop(group) for group in (*_PARTS, "ablation") if group in changes})
    ablated: dict[str, Any] = {}
    names = chosen.get("ablation", ())
    for each in [names] if isinstance(names, str) else names:
        ablated = overlaid(ablated, ablation_settings(find_option("ablation", each)))
    settings = overlaid(ablated, _nested(changes))
    guide, where = option("guide", chosen["guide"], settings.get("guide"))
    _fill_parameters(guide, weights, str(own.get("weights", PUBLISHED)), ablated.get("ablation", {}))
    planner, place = option("planner", chosen["planner"], settings.get("planner"))
    guide_class, guide_config = configured(with_network(guide, "guide"), where)
    planner_class, planner_config = configured(with_network(planner), place)
    made: Planner = planner_class(planner_config, robot)
    filtered, its_place = option("filter", chosen.get("filter", "none"), settings.get("filter"))
    if filtered:
        filter_class, filter_config = configured(filtered, its_place)
        made = filter_class(filter_config, made, robot)
    guide_made: Guide = guide_class(guide_config, robot)
    source = people_source(people, robot)
    return Navigator(guide_made, made, goal_tolerance, source, feedback, robot.dt)


def _composed(name: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """The options that a system chooses, by group, and its own keys."""
    content = read_yaml(find_option("system", name))
    assert isinstance(content, dict)
    chosen: dict[str, Any] = {}
    for entry in content.pop("defaults", []):
        for key, choice in entry.items() if isinstance(entry, dict) else ():
            found = _OVERRIDE.fullmatch(key)
            if found:
                chosen[found[1]] = choice
    return chosen, content


def _nested(changes: Mapping[str, Any]) -> dict[str, Any]:
    """{"guide.travel.comfort": 0.5} as {"guide": {"travel": {"comfort": 0.5}}}."""
    nested: dict[str, Any] = {}
    for key, value in changes.items():
        part, *rest = key.split(".")
        if part not in _PARTS or not rest:
            known = [*_PARTS, "ablation", "weights", "goal_tolerance", "people", "feedback"]
            raise InputError(
                f"{key} is unknown: {nearest(key, known)}must be one of {', '.join(known)}, or a key of guide, "
                "planner or filter, such as 'planner.latency'"
            )
        for name in reversed(rest):
            value = {name: value}
        nested = overlaid(nested, {part: value})
    return nested


def _fill_parameters(
    guide: dict[str, Any], weights: str | Path | None, usual: str, ablated: Mapping[str, float]
) -> None:
    """Put the parameters in the place of the reference to them."""
    given = guide.get("parameters")
    if not isinstance(given, str):
        if weights is not None:
            raise InputError(f"weights is {str(weights)!r}: this guide has no parameters; omit it")
        return
    learned = learned_parameters(str(weights or usual), guide.get("criteria") or (), own_weights(guide))
    guide["parameters"] = {**learned, **ablated}
