"""Tracking of runs: what every kind of it does, and the kind that logs nothing."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from runners.config.job import Job
    from runners.config.schema import SystemConfig
    from runners.records.episode_record import RunLabels

FINISHED, KILLED, FAILED = "FINISHED", "KILLED", "FAILED"  # how a run ended, the worst last
Series = Mapping[str, Sequence[float]]


class Tracking(Protocol):
    """Log of one run. `start` returns at once; `finish` or `stop` is called once, at the end."""

    def start(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None = None,
    ) -> None:
        """Open a run with the config as parameters; in a sweep, as a child of the run of `sweep_dir`."""

    def finish(
        self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series | None = None
    ) -> None:
        """Log the results and close the run.

        artifacts: files, and folders with their contents. series: by name, one value for each step from 0 on.
        """

    def stop(self, state: str) -> None:
        """Close a run that did not finish. state: KILLED or FAILED. Do nothing after `finish`."""


@contextlib.contextmanager
def closed_by(tracking: Tracking) -> Iterator[Tracking]:
    """Close a run that the block does not finish: as KILLED after Ctrl-C or SIGTERM, else as FAILED."""
    try:
        yield tracking
    except BaseException as error:
        tracking.stop(state_of(error))
        raise


def state_of(error: BaseException) -> str:
    return KILLED if isinstance(error, KeyboardInterrupt) else FAILED


@dataclass(slots=True)
class NoTrackingConfig:
    """No settings."""


class NoTracking:
    """Tracking that logs nothing. The results are on disk anyway."""

    Config = NoTrackingConfig

    def __init__(self, config: NoTrackingConfig) -> None:
        self._config = config

    def start(
        self,
        config: Mapping[str, Any],
        run_dir: Path,
        tags: Mapping[str, Any],
        sweep_dir: Path | None = None,
    ) -> None:
        """Do nothing."""

    def finish(
        self, metrics: Mapping[str, float], artifacts: Sequence[Path], series: Series | None = None
    ) -> None:
        """Do nothing."""

    def stop(self, state: str) -> None:
        """Do nothing."""


def parameters(job: Job[SystemConfig], labels: RunLabels) -> dict[str, Any]:
    """Return the config by dotted key, and the short names that users search for. labels: those of the records."""
    from runners.config.changes import flatten  # slow to import, and `lme doctor` does not need it

    names = short_names(asdict(labels), job.folders, job.choices.get("system", ""))
    return dict(flatten(asdict(job.config))) | names | {"weights": job.weights}


def short_names(labels: Mapping[str, Any], folders: tuple[Path, ...], chosen: str = "") -> dict[str, str]:
    """Return system, robot, map, ablation and weights of a run, one word each.

    The system is the option that `system=` takes, such as lme_plus; a pair without one has its label.
    labels: columns of the records. chosen: option of the group `system`.
    """
    from runners.config.systems import system_of

    options = system_of(labels["guide"], labels["planner"], folders, chosen)
    others = {key: str(labels[key]) for key in ("robot", "map", "ablation", "weights")}
    return {"system": next(iter(options), str(labels["system"])), **others}
