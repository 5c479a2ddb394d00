"""Launch a command with its composed config: check everything, choose the run directory, start Hydra."""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from lme.errors import InputError
from lme.resources import resource_dir
from runners.cli import arguments
from runners.config import overrides, schema
from runners.config.composer import Composer, quoted
from runners.records import run_directories

Run = Callable[[DictConfig, Path], Any]
FinishSweep = Callable[[DictConfig, Path, list[Path]], None]

_DIRECTORY_KEYS = ("hydra.run.dir", "hydra.sweep.dir")
_DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
# What Hydra itself says, where nobody asked for another directory.
_HYDRAS_OWN = ("outputs/${now:", "multirun/${now:")


@dataclass(frozen=True, slots=True)
class Command:
    """What a command gives to be launched."""

    name: str
    run: Run
    validate: overrides.Validate
    finish_sweep: FinishSweep | None


def launch(
    config_name: str,
    run: Run,
    argv: Sequence[str],
    *,
    validate: overrides.Validate,
    finish_sweep: FinishSweep | None = None,
) -> int:
    """Run a command on what `argv` composes from `conf/<config_name>.yaml`; returns the exit status.

    run: called with the config and the run directory, once per job. validate: called with every job's config
    before anything is written, to raise InputError. finish_sweep: called after a `-m` sweep with its first job's
    config, its directory and those of its jobs. Raises InputError for what the user can put right.
    """
    return _launch(Command(config_name, run, validate, finish_sweep), arguments.parse(argv))


def _launch(command: Command, given: arguments.Arguments) -> int:
    schema.register()
    given, resumed = _replayed(given)
    with Composer(given.config_name or command.name, given.config_dir) as composer:
        plan = overrides.plan(composer, given.overrides, given.multirun)
        given = replace(given, multirun=plan.multirun, overrides=plan.overrides)
        if not given.shows:
            overrides.validate_all(plan, composer, command.validate)
    if given.shows:
        return _hydra(command, replace(given, overrides=plan.jobs[0]), print)
    run_dir = _directory(command, given, plan, resumed)
    return _start(command, given, run_dir, plan)


def _replayed(given: arguments.Arguments) -> tuple[arguments.Arguments, Path | None]:
    """With `resume=PATH`, the overrides of that run under those given now; and the PATH."""
    directory = _resume_path(given.overrides)
    if directory is None:
        return given, None
    saved = run_directories.read_launch(directory)
    if saved is None:
        what = (
            f"holds no {run_directories.LAUNCH}, so it is no run"
            if directory.is_dir()
            else "no such directory"
        )
        raise InputError(f"resume={directory}: {what}; give true, or the directory of a run")
    keys = {_key(override) for override in given.overrides}
    if keys & {*_DIRECTORY_KEYS}:
        raise InputError(f"resume={directory}: names the directory already; leave hydra.run.dir away")
    kept = [override for override in saved.overrides if _key(override) not in keys]
    return replace(
        given,
        overrides=kept + given.overrides,
        multirun=given.multirun or saved.multirun,
        config_dir=given.config_dir or (Path(saved.config_dir) if saved.config_dir else None),
        config_name=given.config_name or saved.config_name,
    ), directory


def _key(override: str) -> str:
    return override.partition("=")[0].lstrip("+")


def _resume_path(overrides: Sequence[str]) -> Path | None:
    values = [o.partition("=")[2].strip("'\"") for o in overrides if _key(o) == "resume"]
    if not values or values[-1].lower() in ("", "true", "false"):
        return None
    return Path(values[-1])


def _directory(
    command: Command, given: arguments.Arguments, plan: overrides.Plan, resumed: Path | None
) -> Path:
    """Where to write; made, with its launch record in it, unless it is resumed."""
    record, asked = _record(command, given, plan), _asked_directory(plan)
    if resumed is None and OmegaConf.select(plan.configs[0], "resume") is not True:
        return run_directories.make_fresh(record, asked)
    if resumed is None and asked is not None and not run_directories.holds_run(asked):
        print(f"resume=true: nothing in {asked} yet, starting afresh", file=sys.stderr)
        return run_directories.make_fresh(record, asked)
    directory = resumed or asked or run_directories.resumable(record)
    run_directories.check_same(record, directory)
    return directory


def _record(command: Command, given: arguments.Arguments, plan: overrides.Plan) -> run_directories.Launch:
    configs = [run_directories.identity(config) for config in plan.configs]
    return run_directories.Launch(
        command=command.name,
        fingerprint=run_directories.fingerprint(configs, plan.multirun),
        multirun=plan.multirun,
        overrides=[o for o in plan.overrides if _key(o) not in (*_DIRECTORY_KEYS, "resume")],
        configs=configs,
        config_dir=str(given.config_dir) if given.config_dir else None,
        config_name=given.config_name,
    )


def _asked_directory(plan: overrides.Plan) -> Path | None:
    """The directory that the command line or a config file names; None where it is left to us."""
    config = plan.configs[0]
    names = ("sweep", "run") if plan.multirun else ("run",)
    before = HydraConfig.instance().cfg
    HydraConfig.instance().set_config(config)  # for ${hydra:...}
    try:
        for name in names:
            written = OmegaConf.to_container(config.hydra[name], resolve=False)["dir"]
            if not str(written).startswith(_HYDRAS_OWN):
                return Path(str(config.hydra[name].dir))
    finally:
        HydraConfig.instance().cfg = before
    return None


def _start(command: Command, given: arguments.Arguments, run_dir: Path, plan: overrides.Plan) -> int:
    kind = "sweep" if given.multirun else "run"
    own = [f"hydra.job.name={command.name}", f"hydra.{kind}.dir={quoted(str(run_dir))}"]
    others = [o for o in given.overrides if _key(o) not in (*_DIRECTORY_KEYS, "hydra.job.name")]
    task = _task(command, given, plan.num_jobs)
    try:
        status = _hydra(command, replace(given, overrides=others + own), task)
    except KeyboardInterrupt:
        if given.multirun:
            print(f"The whole sweep: lme {command.name} resume={run_dir}", file=sys.stderr)
        return 130
    if status == 0 and given.multirun and command.finish_sweep is not None:
        command.finish_sweep(plan.configs[0], run_dir, _job_dirs(run_dir))
    return status


def _hydra(command: Command, given: arguments.Arguments, task: Callable[..., Any]) -> int:
    """`hydra.main` on these arguments; returns its exit status."""
    before = sys.argv
    sys.argv = [f"lme {command.name}", *given.hydra_argv()]
    try:
        hydra.main(
            version_base="1.3",
            config_path=str(resource_dir("conf")),
            config_name=given.config_name or command.name,
        )(task)()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(bool(end.code))
    finally:
        sys.argv = before
    return 0


def _task(command: Command, given: arguments.Arguments, num_jobs: int) -> Callable[[DictConfig], None]:
    """What Hydra calls for every job, in this process or in one of a launcher plugin's."""

    def task(config: DictConfig) -> None:
        schema.register()
        try:
            command.run(config, _job_directory(command, given, config, num_jobs))
        except InputError as error:
            print(f"lme {command.name}: {error}", file=sys.stderr)
            raise SystemExit(2) from error
        except (OSError, RuntimeError) as error:
            if not _broken_off(error):
                raise
            print(f"lme {command.name}: {error}", file=sys.stderr)
            raise SystemExit(1) from error

    return task


def _job_directory(command: Command, given: arguments.Arguments, config: DictConfig, num_jobs: int) -> Path:
    """This job's directory; a job of a sweep gets its own launch record there."""
    hydra_config = HydraConfig.get()
    run_dir = Path(hydra_config.runtime.output_dir)
    if run_dir.is_relative_to(Path.cwd()):
        run_dir = run_dir.relative_to(Path.cwd())
    if given.multirun:
        own = run_directories.identity(config)
        number, overrides = int(hydra_config.job.num), list(hydra_config.overrides.task)
        overrides = [override for override in overrides if _key(override) != "resume"]
        print(f"[{number + 1}/{num_jobs}] {' '.join(overrides)}", file=sys.stderr)
        run_directories.Launch(
            command=command.name,
            fingerprint=run_directories.fingerprint([own], multirun=False),
            multirun=False,
            overrides=overrides,
            configs=[own],
            config_dir=str(given.config_dir) if given.config_dir else None,
            config_name=given.config_name,
            job=number,
        ).write(run_dir)
    return run_dir


def _job_dirs(sweep_dir: Path) -> list[Path]:
    """The directories of a sweep's jobs in the order of the jobs."""
    found = [
        (run_directories.read_launch(path.parent), path.parent)
        for path in sweep_dir.rglob(run_directories.LAUNCH)
    ]
    jobs = {record.job: path for record, path in found if record is not None and record.job is not None}
    return [jobs[number] for number in sorted(jobs)]


def _broken_off(error: OSError | RuntimeError) -> bool:
    """Whether the run ended for a reason outside the program: a full disk, a killed worker process."""
    from runners.records.records import RecordsWriteError
    from runners.workers.executor import WorkerDiedError

    disk_full = isinstance(error, OSError) and error.errno in _DISK_FULL
    return disk_full or isinstance(error, RecordsWriteError | WorkerDiedError)
