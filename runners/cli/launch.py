"""Launch a command: compose and check every job, choose the run directory, let Hydra run the jobs."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from lme.errors import InputError
from lme.inputs.user_code import explained, show_traceback
from runners.cli import hydra_jobs
from runners.cli.guards import explain_os_error, status_of, terminable
from runners.cli.hydra_jobs import LauncherError
from runners.config import arguments, command_line, schema
from runners.config.catalogue import Catalogue
from runners.config.composer import Composer, without_hydra
from runners.config.escaping import masked_text
from runners.config.instantiate import translate_error
from runners.config.job import Job
from runners.config.quoting import key_of, resume_command, unquoted
from runners.records import inputs, launch_record, run_directories, trust
from runners.workers.environment import search_working_folder_last

_PROCESSES = "runners.workers.executor.ProcessExecutor"
_DIRECTORY_KEYS = ("hydra.run.dir", "hydra.sweep.dir")
_FAILED = 1  # exit status of a failed episode, and of a failure outside the program
_HYDRAS_OWN = ("outputs/${now:", "multirun/${now:")  # where Hydra writes by default


@dataclass(frozen=True, slots=True)
class Command:
    """A command and the functions that carry it out.

    validate: called with every job before anything is written, to raise InputError. run: called with every job.
    finish_sweep: called after a sweep with its first job and the directories of all jobs.
    """

    name: str
    run: Callable[[Job[Any]], Any]
    validate: command_line.Validate
    finish_sweep: Callable[[Job[Any], list[Path]], None] | None = None


def launch(command: Command, argv: Sequence[str]) -> int:
    """Run a command on what `argv` composes from its config; return the exit status.

    Raises InputError for what the user can put right.
    """
    # Read the command line, with the overrides of a run that is resumed.
    typed_args = arguments.parse(argv)
    args, resumed = _with_resumed(command.name, typed_args)
    config_name = args.config_name or command.name
    if args.info or args.hydra_help:
        from runners.cli import show

        return show.print_hydra_info(command.name, config_name, args)
    # Compose the config of every job.
    with Composer(config_name, args.config_dir) as composer:
        with _activity("Reading the config"):
            plan = command_line.plan(composer, args.overrides, args.multirun, typed_args.overrides)
        if resumed is not None:
            _check_code(plan, resumed)
        if args.cfg:
            from runners.cli import show

            show.config(plan.first, args.cfg, args.package, args.resolve)
            return 0
        if OmegaConf.select(plan.first, "executor._target_") == _PROCESSES and not _is_short(plan.first):
            from runners.workers import forkserver

            forkserver.start()  # imports while this process builds and checks the jobs
        # Check every job before anything is written, then choose the directory.
        with _activity("Checking the config, and building its worlds"):
            jobs = command_line.validated(plan, composer, command.validate)
        record, directory = _directory(command, args, plan, jobs, resumed)
        # Let Hydra run the jobs, and the command finish the sweep if all of them succeeded.
        checked = {job.overrides: job for job in jobs}
        num_jobs = plan.num_jobs if plan.multirun else None
        task = _Task(command, record, directory, composer.catalogue.folders, checked, num_jobs, os.getpid())
        try:
            with trust.trusting(directory):  # whose config is the one just composed
                status = hydra_jobs.run(composer, plan, command.name, directory, task)
                if plan.multirun and status == 0 and command.finish_sweep is not None:
                    job_dirs = run_directories.jobs_of_sweep(directory, plan.num_jobs)
                    command.finish_sweep(replace(jobs[0], sweep_dir=directory), job_dirs)
        # An error that ended the sweep becomes an exit status and, for a sweep, the command that resumes it.
        except SystemExit as end:
            return end.code if isinstance(end.code, int) else 1
        except (KeyboardInterrupt, LauncherError) as error:
            if isinstance(error, LauncherError):
                print(f"lme {command.name}: {error}", file=sys.stderr)
            if plan.multirun:
                print(f"The whole sweep: {resume_command(command.name, directory)}", file=sys.stderr)
            return status_of(error) if isinstance(error, KeyboardInterrupt) else 1
        return status


def _activity(label: str) -> contextlib.AbstractContextManager[object]:
    """Show what takes seconds; nothing in a robot's installation, which has no rich."""
    if find_spec("rich") is None:
        return contextlib.nullcontext()
    from runners.workers.progress import activity

    return activity(label)


def _is_short(config: DictConfig) -> bool:
    """Return whether a config names so few worlds that they will hardly need workers."""
    from runners.config.build import FEW_EPISODES

    worlds, runs = (OmegaConf.select(config, key) for key in ("map.worlds", "runs"))
    return bool(worlds and runs) and len(worlds) * int(runs) <= FEW_EPISODES


def _with_resumed(command: str, args: arguments.Arguments) -> tuple[arguments.Arguments, Path | None]:
    """Add the overrides of the run that `resume=PATH` names, below those given now; return the PATH too.

    Where an option is chosen again, such as `hydra/launcher=basic`, the saved keys of the former option are left out.
    """
    directory = _resume_path(args.overrides)
    if directory is None:
        return args, None
    # Read the launch record of the run, which must be one of this command.
    try:
        saved = launch_record.read_launch(directory)
    except InputError as error:
        raise InputError(f"resume={error}") from error
    if saved is None:
        not_a_run = f"holds no {launch_record.LAUNCH}, so it is not a run"
        problem = not_a_run if directory.is_dir() else "no such directory"
        raise InputError(f"resume={directory}: {problem}; give true, or the directory of a run")
    if saved.command != command:
        hint = resume_command(saved.command, directory)
        raise InputError(
            f"resume={directory}: holds a run of lme {saved.command}, not of lme {command}: use {hint}"
        )
    # Refuse an untrusted run, and an override that names the directory a second time.
    _check_foreign(saved, directory, args)
    keys = {key_of(override) for override in args.overrides}
    if keys & {*_DIRECTORY_KEYS}:
        raise InputError(f"resume={directory}: names the directory already; omit hydra.run.dir")
    # Keep the saved overrides that nothing given now replaces: neither their key, nor the option that holds it.
    anew = tuple(f"{key.replace('/', '.')}." for key in keys)
    saved_overrides = [
        word for word in saved.overrides if key_of(word) not in keys and not key_of(word).startswith(anew)
    ]
    if not saved.multirun and "hydra.mode" not in keys:
        saved_overrides.append("hydra.mode=RUN")  # a single job, even if its experiment asks for a sweep
    # Take everything else that was not given now from the launch.
    config_dir = args.config_dir or (Path(saved.config_dir) if saved.config_dir else None)
    if config_dir is not None:
        arguments.check_config_dir(config_dir)
    return replace(
        args,
        overrides=saved_overrides + args.overrides,
        multirun=args.multirun or saved.multirun,
        config_dir=config_dir,
        config_name=args.config_name or saved.config_name,
    ), directory


def _check_foreign(saved: launch_record.Launch, directory: Path, args: arguments.Arguments) -> None:
    """Raise UntrustedError where a run that somebody else made must not decide what is read and executed.

    The user's own runs, and those that --trust vouches for, are allowed to. Code that such a run used and that is no
    longer in its place is imported from the run's copy.
    """
    # A lost input has to be restored by the user, whoever made the run.
    lost_source = next((source for source in saved.inputs if inputs.is_lost(source)), None)
    if lost_source is not None:
        raise InputError(
            f"resume={directory}: {lost_source.given}, its {lost_source.key}, is not here; the run holds a copy, "
            f"{inputs.FOLDER}/{lost_source.digest}/{lost_source.name}: put that there first"
        )
    # A trusted run only needs its code.
    if saved.is_own or trust.is_trusted(directory):
        with trust.trusting(directory):
            inputs.provide_code([source for source in saved.inputs if inputs.is_gone(source)], directory)
        return
    # In any other run, check everything that it would decide: its words, its folder of options, and its configs.
    trust.check_words(saved.overrides, directory)
    trust.check_words([f"config_name={saved.config_name or ''}"], directory)
    if saved.config_dir and args.config_dir is None:
        trust.check_words([f"--config-dir={saved.config_dir}"], directory)
    for config in saved.configs:
        trust.check_config(config, directory)
        inputs.located(config, saved.inputs, directory)


def _check_code(plan: command_line.Plan, directory: Path) -> None:
    """Raise UntrustedError if a run that somebody else made chose code from outside lme."""
    saved = launch_record.read_launch(directory)
    if saved is not None and not saved.is_own:
        for config in plan.configs.values():
            values = OmegaConf.to_container(without_hydra(config), resolve=False)
            trust.check_code(cast(dict[str, Any], values), directory)


def _resume_path(words: Sequence[str]) -> Path | None:
    values = [unquoted(word.partition("=")[2]) for word in words if key_of(word) == "resume"]
    if not values or values[-1].lower() in ("", "true", "false"):
        return None
    return Path(values[-1])


def _directory(
    command: Command,
    args: arguments.Arguments,
    plan: command_line.Plan,
    jobs: Sequence[Job[Any]],
    resumed: Path | None,
) -> tuple[launch_record.Launch, Path]:
    """Return the launch record and the directory to write to; create both unless a run is resumed."""
    # Record what is launched, without the words that only say where to write.
    words = [word for word in plan.overrides if key_of(word) not in (*_DIRECTORY_KEYS, "resume")]
    record = launch_record.launch_of(command.name, jobs, words, plan.multirun, args.config_name)
    record.num_jobs = plan.num_jobs if plan.multirun else None
    # Find out whether to start afresh: also if resume=true finds nothing in the directory.
    requested = _requested_directory(plan.first, plan.multirun)
    is_fresh = resumed is None and OmegaConf.select(plan.first, "resume") is not True
    if not (is_fresh or resumed) and requested is not None and not run_directories.holds_run(requested):
        print(f"resume=true: nothing in {requested} yet, starting afresh", file=sys.stderr)
        is_fresh = True
    if is_fresh:
        return record, run_directories.make_fresh(record, requested)
    # Else continue in the directory of the same launch.
    directory = resumed or requested or run_directories.resumable(record)
    run_directories.check_same(record, directory)
    return record, directory


def _requested_directory(config: DictConfig, multirun: bool) -> Path | None:
    """Return the directory that the command line or a config file names; None if neither names one.

    Raises InputError if its interpolations cannot be resolved.
    """
    previous_config = HydraConfig.instance().cfg
    HydraConfig.instance().set_config(config)  # resolves ${hydra:...}
    try:
        for name in ("sweep", "run") if multirun else ("run",):
            hydra_settings = OmegaConf.to_container(config.hydra[name], resolve=False)
            assert isinstance(hydra_settings, dict)
            if not str(hydra_settings["dir"]).startswith(_HYDRAS_OWN):
                return Path(str(config.hydra[name].dir))
    except OmegaConfBaseException as error:
        raise translate_error(error) from error
    finally:
        HydraConfig.instance().cfg = previous_config
    return None


@dataclass(frozen=True, slots=True)
class _Task:
    """The function that Hydra calls for every job, in this process or in one that a launcher plugin starts.

    record: of the launch, with the files that all jobs read. directory: of the run or the sweep. checked: the jobs as
    composed at launch, by their overrides. num_jobs: number of jobs in the sweep; None outside a sweep. process: id
    of the process that launches the jobs.
    """

    command: Command
    record: launch_record.Launch
    directory: Path
    folders: tuple[Path, ...]
    checked: Mapping[tuple[str, ...], Job[Any]]
    num_jobs: int | None
    process: int

    def __call__(self, config: DictConfig) -> int:
        """Run the command on a composed config and return the exit status. Hydra's own part is in HydraConfig.

        A failed episode ends only its own job; the other jobs of a sweep still run. Raises SystemExit for errors that
        would end the other jobs too, unless the jobs run in processes of their own.
        """
        from runners.workers.executor import EpisodeError

        search_working_folder_last()  # for a launcher's process, which may not know the path of this one
        schema.register()
        try:
            # A launcher's process would die of SIGTERM, and leave the tracked run open.
            ending = contextlib.nullcontext() if os.getpid() == self.process else terminable()
            with ending, trust.trusting(self.directory):
                self.command.run(self._job(config))
        except (Exception, SystemExit) as error:  # a user's own class may raise anything
            # Without a status and an explanation, the error is one of the program itself: show all of it.
            status = _status(error)
            explanation = explained(error) if status is None else ""
            if status is None and not explanation:
                raise
            message = explanation or explain_os_error(error) or masked_text(str(error))
            print(f"lme {self.command.name}: {message}", file=sys.stderr)
            show_traceback(error)
            # End this job alone, or all jobs if the error would end them too.
            if status is None or isinstance(error, EpisodeError) or os.getpid() != self.process:
                return status or _FAILED
            raise SystemExit(status) from error
        return 0

    def _job(self, config: DictConfig) -> Job[Any]:
        """Return the job as composed at launch, with its directory. A job of a sweep gets its own launch record there.

        In a very large sweep, some jobs have not been composed yet. Raises InputError if their files have changed.
        """
        hydra = HydraConfig.get()
        job = self.checked.get(tuple(hydra.overrides.task))
        # Not composed at launch: compose it now, from files that must be the same as then.
        if job is None:
            changed_paths = [source for saved in self.record.inputs for source in inputs.changed_files(saved)]
            if changed_paths:
                raise InputError(
                    f"{changed_paths[0]} has changed since the sweep began, and a sweep of more than "
                    f"{command_line.MAX_JOBS_CHECKED} jobs reads it for every job: restore it, and resume the sweep"
                )
            job = Job.composed(config, hydra, Catalogue(self.folders))
        run_dir = _relative(Path(hydra.runtime.output_dir))
        if self.num_jobs is None:
            return replace(job, run_dir=run_dir)
        # A job of a sweep says its number, and gets a launch record of its own.
        words = [word for word in job.overrides if key_of(word) != "resume"]
        number = int(hydra.job.num)
        print(f"[{number + 1}/{self.num_jobs}] {' '.join(words)}", file=sys.stderr)
        record = launch_record.launch_of(
            self.command.name, [job], words, False, self.record.config_name, self.record.inputs
        )
        replace(record, job=number).write(run_dir)
        return replace(
            job,
            run_dir=run_dir,
            sweep_dir=_relative(Path(hydra.sweep.dir)),
            config=inputs.as_at_launch(job.config, self.record.inputs, self.directory),
        )


def _relative(path: Path) -> Path:
    """Return the path relative to the working directory if it lies below it, else the path itself."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path


def _status(error: BaseException) -> int | None:
    """Return the exit status of a run that an error ended; None for an error of the program itself.

    2: a user's mistake. 1: a failed episode, or a reason outside the program, such as a full disk or a killed worker.
    """
    from runners.records.records import RecordsWriteError
    from runners.workers.executor import EpisodeError, WorkerDiedError

    if isinstance(error, InputError):
        return 2
    is_reported = isinstance(error, EpisodeError | RecordsWriteError | WorkerDiedError)
    return _FAILED if explain_os_error(error) or is_reported else None
