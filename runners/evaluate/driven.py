"""Overrides with which `lme eval` drives what a job has trained."""

from __future__ import annotations

from collections.abc import Collection

from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.schema import SystemConfig
from runners.config.space import PARAMETERS
from runners.config.systems import PAIR

# Parts of the config that drive a robot, and those that are groups: a file can choose their option.
_DRIVES = ("robot", "system", "guide", "planner", "filter", "ablation", "scale", "sim")
_OPTIONS = ("robot", "system", *PAIR, "filter", "sim")


def driven(job: Job[SystemConfig], command: str, values: Collection[str]) -> list[str]:
    """Return the overrides that choose the driving system, without those of the trained keys `values`.

    An experiment, or a config of the user's own, may have chosen parts of the system instead, so a part is named if
    it is not the default of `command`. The pair is always named if more than a guide's parameters was trained.
    """
    keys = {word: word.partition("=")[0].lstrip("+") for word in job.overrides}
    trained = {*values, *(PARAMETERS.rstrip(".") for key in values if key.startswith(PARAMETERS))}
    words = [word for word, key in keys.items() if key.partition(".")[0] in _DRIVES and key not in trained]
    defaults = Catalogue(job.folders).groups(command)
    choices = {
        group: job.choices[group]
        for group in _OPTIONS
        if job.choices.get(group, defaults[group]) != defaults[group]
    }
    if not all(key.startswith(PARAMETERS) for key in values):
        choices |= {group: job.choices[group] for group in PAIR}
    if "system" in {*choices, *keys.values()}:  # it chooses the pair
        choices = {group: option for group, option in choices.items() if group not in PAIR}
    return [*words, *(f"{group}={option}" for group, option in choices.items() if group not in keys.values())]
