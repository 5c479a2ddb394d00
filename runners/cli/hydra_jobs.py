"""Run composed jobs with Hydra's folders, sweepers, launchers and callbacks, without composing them again.

This is the only module that uses Hydra's private part, `hydra._internal`. Every job is composed and checked before
any of them runs, and then runs exactly as it was checked. Hydra can only run what it composes itself: `hydra.main`
composes a job when its turn comes, and sweepers and launchers ask a config loader for it. They are therefore given a
loader that already has the configs (`ConfigLoaderImpl` is the class that they expect) and the callbacks (`Callbacks`)
that `hydra.main` would make.
"""

from __future__ import annotations

import contextlib
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydra._internal.callbacks import Callbacks
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.plugins import Plugins
from hydra.core.utils import JobReturn, JobStatus, run_job
from hydra.experimental.callback import Callback
from hydra.types import HydraContext, RunMode
from omegaconf import DictConfig, OmegaConf, open_dict

from runners.config import map_sets
from runners.config.command_line import Plan
from runners.config.composer import Composer
from runners.config.escaping import masked_text

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


def run(composer: Composer, plan: Plan, name: str, directory: Path, task: Callable[[DictConfig], int]) -> int:
    """Call `task` on every job of the plan. Return the highest status that it returned, or raise what it raised.

    A job writes to `directory`; each job of a sweep writes to a folder of its own below it. name: of the jobs, for
    Hydra. Raises LauncherError.
    """
    if plan.multirun:
        return _sweep(composer, plan, name, directory, task)
    # Do what hydra.main does with a single job.
    (config,) = plan.configs.values()
    _set(config, {"job.name": name, "run.dir": str(directory), "mode": RunMode.RUN})
    callbacks = Callbacks(config)
    callbacks.on_run_start(config=config, config_name=composer.config_name)
    callbacks.callbacks.append(_MaskPasswords())
    context = HydraContext(config_loader=composer.loader, callbacks=callbacks)
    job_return = run_job(
        hydra_context=context,
        task_function=task,
        config=config,
        job_dir_key="hydra.run.dir",
        job_subdir_key=None,
    )
    callbacks.on_run_end(config=config, config_name=composer.config_name, job_return=job_return)
    return int(job_return.return_value)


def _sweep(
    composer: Composer, plan: Plan, name: str, directory: Path, task: Callable[[DictConfig], int]
) -> int:
    """Run the jobs of a plan with Hydra's sweeper and launcher."""
    from runners.tracking.mlflow import sweep_closed

    config = composer.compose(plan.overrides, RunMode.MULTIRUN)
    settings = {"job.name": name, "sweep.dir": str(directory), "mode": RunMode.MULTIRUN}
    _set(config, settings)
    callbacks = Callbacks(config)
    callbacks.on_multirun_start(config=config, config_name=composer.config_name)
    # Hand the checked configs over to the loader; the plan drops its own, so that none is kept twice.
    loader = _PlannedJobs(composer, plan, settings)
    plan.configs.clear()
    callbacks.callbacks += [loader, _MaskPasswords()]
    # Let the sweeper run the jobs, here or through a launcher.
    sweeper = Plugins.instance().instantiate_sweeper(
        config=config,
        hydra_context=HydraContext(config_loader=loader, callbacks=callbacks),
        task_function=task,
    )
    submitted = Submitted.of(config, name)
    submitted.announce(plan.num_jobs)
    with submitted.explain_errors(), sweep_closed(directory, goes_on=bool(submitted.folder)):
        batches = sweeper.sweep(arguments=list(config.hydra.overrides.task))
    # Report the jobs that failed.
    callbacks.on_multirun_end(config=config, config_name=composer.config_name)
    jobs = [job for batch in batches or () for job in batch]
    submitted.report_failures(jobs)
    return max((int(job.return_value) for job in jobs), default=0)


class _MaskPasswords(Callback):
    """Callback that masks the passwords of URLs in the files that Hydra has written about a job."""

    def on_job_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Mask the files of the job, which Hydra has just written."""
        folder = Path(config.hydra.runtime.output_dir) / str(config.hydra.output_subdir)
        for file in folder.glob("*.yaml"):
            text = file.read_text(encoding="utf-8")
            if masked_text(text) != text:
                file.write_text(masked_text(text), encoding="utf-8")


class _PlannedJobs(ConfigLoaderImpl, Callback):
    """Hydra's config loader, but with the configs of the jobs as they were checked.

    The configs of a job are dropped once it has run, since those of a thousand jobs take half a gigabyte.
    """

    def __init__(self, composer: Composer, plan: Plan, settings: Mapping[str, Any]) -> None:
        """Store the jobs' configs. settings: keys of Hydra's own part that every job has."""
        super().__init__(composer.loader.get_search_path())
        self._configs = {composer.canonical(words): config for words, config in plan.configs.items()}
        self._composer = composer
        self._job_settings = settings

    def get_group_options(self, group_name: str, *args: Any, **kwargs: Any) -> list[str]:
        """Return the options among which a glob chooses: those that were checked."""
        return self._composer.get_group_options(group_name)

    def load_sweep_config(self, master_config: DictConfig, sweep_overrides: list[str]) -> DictConfig:
        """Return the config of one job. In a very large sweep, some jobs have not been composed yet."""
        config = self._configs.get(self._composer.canonical(sweep_overrides))
        if config is None:
            config = super().load_sweep_config(master_config, sweep_overrides)
            map_sets.expand_worlds(config)
        _set(config, self._job_settings)
        return config

    def on_job_end(self, config: DictConfig, job_return: JobReturn, **kwargs: Any) -> None:
        """Drop the job's configs: Hydra keeps what the job returns, with two configs, until the sweep ends."""
        job_return.cfg = None
        if job_return.status == JobStatus.COMPLETED and job_return.return_value == 0:
            job_return.hydra_cfg = None  # names the job that failed
        for key in [key for key, job_config in self._configs.items() if job_config is config]:
            del self._configs[key]


def _set(config: DictConfig, values: Mapping[str, Any]) -> None:
    """Set keys in Hydra's own part of a config."""
    OmegaConf.set_readonly(
        config.hydra, None
    )  # HydraConfig sets it; Hydra's launchers write the job's number
    with open_dict(config.hydra):
        for key, value in values.items():
            OmegaConf.update(config.hydra, key, value)
