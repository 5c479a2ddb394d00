"""A system by name, as a navigator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from lme.config.composer import CUSTOM, compose, find, folders_of
from lme.config.presets import configured, find_option, load_robot, option
from lme.errors import InputError, building, nearest
from lme.guides.lme.weight_files import PUBLISHED, with_network
from lme.inputs.resources import overlaid
from lme.navigation.navigator import Navigator
from lme.perception.people.source import people_source
from lme.robots import Cap, Robot
from lme.types import Guide, Planner

_PARTS = ("guide", "planner", "filter")
_CAPS = [each.name for each in fields(Cap)]
_GROUPS = (*_PARTS, "ablation")


def load_system(
    name: str,
    robot: Robot | str,
    *,
    weights: str | Path | None = None,
    goal_tolerance: float = 0.0,
    people: str = "truth",
    feedback: str = "OPEN_LOOP",
    cap: Mapping[str, float] | None = None,
    **changes: Any,
) -> Navigator:
    """The navigator that `lme eval system=NAME` drives with::

        navigator = lme.load_system("lme_plus", robot)
        navigator = lme.load_system("lme", robot, planner="dwa_tuned", **{"guide.candidates.number": 500})

    name: in `conf/system/`, or the path of a YAML in a folder `system`, beside which the folders `planner` and so on
    may hold the options that it names. robot: it drives this one, or that of `conf/robot/` with this name. weights: as
    on the command line; None: the system's own.
    goal_tolerance: the robot stops within this distance of the target [m]. people: "truth": those in the
    observations; "tracked": those found in the scans; "none". feedback: commands ramp from the last command
    (OPEN_LOOP) or from the measured twist (CLOSED_LOOP). cap: highest speeds of its commands, as `{"v_max": 1.0}` [m/s,
    rad/s]; None: the system's own, if it has any. changes: words of the command line, as keywords: `guide`,
    `planner` and `filter` by name or by the path of a YAML, `ablation` by name or several in a list, and any key of
    these parts, such as "planner.latency", or "planner._target_" for a class of your own.

    Call `reset(rng)` before each episode, and `act(observation)` in each control period.

    Raises InputError for an unknown name or key, and for a wrong value.
    """
    robot = load_robot(robot) if isinstance(robot, str) else robot
    file = find_option("system", name)
    system, folders = compose(file, "system"), folders_of(file, "system")
    custom = {p: CUSTOM for p in _PARTS if f"{p}._target_" in changes and find(f"{p}/{CUSTOM}")}
    given = {group: changes.pop(group) for group in _GROUPS if group in changes}
    choices = {**system.choices, **custom, **given}

    # Compose the whole config: ablations over the options, the system over these, the caller's changes over all.
    config: dict[str, Any] = {"weights": PUBLISHED, "ablation": {}, "robot": asdict(robot)}
    ablations = choices.get("ablation", ())
    for ablation in [ablations] if isinstance(ablations, str) else ablations:
        config = overlaid(config, compose(find_option("ablation", ablation, folders), "ablation").settings)
    config = overlaid(overlaid(config, system.settings), _nested(changes))
    if weights is not None:
        config["weights"] = str(weights)
    parts = {
        part: option(part, choices.get(part, "none"), config.get(part), config, folders) for part in _PARTS
    }
    if weights is not None and "parameters" not in parts["guide"][0]:
        raise InputError(f"weights is {str(weights)!r}: this guide has no parameters; omit it")
    if config["ablation"] and "parameters" not in parts["guide"][0]:
        raise InputError(f"ablation is {ablations!r}: it sets parameters, and this guide has none; omit it")

    # Build the planner within its filter, then the guide.
    speeds = config.get("cap", {}) if cap is None else cap
    for key in speeds:
        if key not in _CAPS:
            raise InputError(f"cap.{key} is unknown: must be {' or '.join(_CAPS)}")
    with building("cap"):
        own_cap = Cap(**speeds)
    robot = robot.capped(own_cap)
    guide, place = parts["guide"]
    guide_class, guide_config = configured(with_network(guide, "guide"), place, "guide")
    planner, place = parts["planner"]
    planner_class, planner_config = configured(with_network(planner), place, "planner")
    with building("planner"):
        driver: Planner = planner_class(planner_config, robot)
    safety, place = parts["filter"]
    if safety:
        filter_class, filter_config = configured(safety, place, "filter")
        with building("filter"):
            driver = filter_class(filter_config, driver, robot)
    with building("guide"):
        made_guide: Guide = guide_class(guide_config, robot)
    return Navigator(
        made_guide,
        driver,
        goal_tolerance,
        people_source(people, robot),
        feedback,
        robot.dt,
        own_cap,
        robot.lidar,
    )


def _nested(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Nest dotted keys: {"guide.travel.comfort": 0.5} becomes {"guide": {"travel": {"comfort": 0.5}}}."""
    nested: dict[str, Any] = {}
    for key, value in changes.items():
        part, *rest = key.split(".")
        if part not in _PARTS or not rest:
            known = [*_GROUPS, "weights", "goal_tolerance", "people", "feedback", "cap"]
            raise InputError(
                f"{key} is unknown: {nearest(key, known)}must be one of {', '.join(known)}, or a key of guide, "
                "planner or filter, such as 'planner.latency'"
            )
        for name in reversed(rest):
            value = {name: value}
        nested = overlaid(nested, {part: value})
    return nested
