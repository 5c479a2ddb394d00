"""Messages about the jobs of a sweep that submitit runs elsewhere, since their own output goes to files."""

from __future__ import annotations

import contextlib
import sys
import traceback
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from hydra.core.utils import JobReturn
from omegaconf import DictConfig, OmegaConf

_ID = "%j"  # submitit's sign for the number of a job


class LauncherError(RuntimeError):
    """Jobs could not be submitted, or one of them ended without a result, for instance because it was killed."""


@dataclass(frozen=True, slots=True)
class Submitted:
    """The jobs of a sweep. name: of the command. folder: for a job's output, with _ID; "" for other launchers."""

    name: str
    folder: str

    @classmethod
    def of(cls, config: DictConfig, name: str) -> Submitted:
        """Return the jobs of a config that includes Hydra's own part."""
        return cls(name, str(OmegaConf.select(config, "hydra.launcher.submitit_folder", default="")))

    def announce(self, num_jobs: int) -> None:
        """Print where to look while the jobs run."""
        if self.folder:
            print(
                f"lme {self.name}: {num_jobs} jobs submitted; their output: {self._output_folder}",
                file=sys.stderr,
            )

    def report_failures(self, jobs: Sequence[JobReturn]) -> None:
        """Name every failed job, and the file in which it says why."""
        for job in jobs if self.folder else ():
            if int(job.return_value):
                assert job.hydra_cfg is not None
                job_settings, words = job.hydra_cfg.hydra.job, " ".join(job.overrides or ())
                log = Path(self.folder.replace(_ID, job_settings.id)) / f"{job_settings.id}_0_log.err"
                print(f"lme {self.name}: job {job_settings.num} failed ({words}): see {log}", file=sys.stderr)

    @contextlib.contextmanager
    def explain_errors(self) -> Iterator[None]:
        """Raise a LauncherError of one line in place of submitit's error about a job or the cluster."""
        try:
            yield
        except RuntimeError as error:
            if not _is_of_submitit(error):
                raise
            summary = " ".join(str(error).splitlines()[:2])  # the log of the job follows
            raise LauncherError(f"{summary}; output of the jobs: {self._output_folder}") from error

    @property
    def _output_folder(self) -> Path:
        """Return the folder with the output of all jobs."""
        return Path(self.folder.partition(_ID)[0])


def _is_of_submitit(error: Exception) -> bool:
    """Return whether submitit itself raised the error. Errors of a job's code are raised elsewhere."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    return str(frames[-1].f_globals["__name__"]).startswith("submitit.")
