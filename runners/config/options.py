"""Options of a config group that a job names besides its chosen one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from lme.config.composer import resolved
from lme.errors import InputError, nearest
from lme.inputs.resources import overlaid
from runners.config.catalogue import Catalogue
from runners.config.job import Job
from runners.config.schema import SystemConfig


def named_option(
    job: Job[SystemConfig], key: str, group: str, name: str, settings: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return the node of a group's option `name`, as if the job had chosen it, with `settings` in place of its own.

    For the option that the job has chosen this is the job's own node. key: key of the name in the config, for
    messages. Raises InputError for a name that is not an option.
    """
    if job.choices.get(group) == name:
        node: Mapping[str, Any] = getattr(job.config, group)
    else:
        node = _read(job, key, group, name)
    return overlaid(node, settings or {})


def _read(job: Job[SystemConfig], key: str, group: str, name: str) -> dict[str, Any]:
    catalogue = Catalogue(job.folders)
    known = catalogue.options(group)
    if name not in known:
        raise InputError(f"{key} is {name!r}: {nearest(name, known)}must be one of {', '.join(known)}")
    file = f"{group}/{name}"
    return resolved(group, catalogue.values(file), asdict(job.config), str(catalogue.file(file)))
