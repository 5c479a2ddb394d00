"""Jobs of a command line: composed, checked and typed before anything runs or is written."""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from hydra.core.override_parser.types import IntervalSweep, Override, RangeSweep, ValueType
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from lme.errors import InputError
from lme.inputs.user_code import user_error
from runners.config import arguments, map_sets, systems
from runners.config.changes import namesakes, radius_note
from runners.config.composer import (
    COMPOSING,
    SEVERAL_OPTIONS,
    Composer,
    normalised,
    refuse_conflicts,
    text_of,
    without_hydra,
)
from runners.config.instantiate import keys_beside, translate_error, unknown_key
from runners.config.job import Job

MAX_JOBS_CHECKED = 64  # of a sweep; in larger ones every value is checked once

Validate = Callable[[Job[Any]], None]


@dataclass(slots=True)
class Plan:
    """Command line that Hydra can compose.

    overrides: in Hydra's grammar. configs: by the overrides of each checked job, with Hydra's own part.
    num_jobs: number of jobs of the whole sweep.
    """

    overrides: list[str]
    multirun: bool
    num_jobs: int
    configs: dict[tuple[str, ...], DictConfig]

    @property
    def first(self) -> DictConfig:
        """Config of the first job that has not run: a config is released when its job has run."""
        return next(iter(self.configs.values()))


def compose(command: str, argv: Sequence[str] = (), validate: Validate = lambda job: None) -> list[Job[Any]]:
    """Return the jobs of `lme COMMAND ARGV`, checked and typed. Nothing runs, and `resume` is not followed.

    validate: checks of the command. A very large sweep gives only enough jobs for each value to occur once. Nothing
    is written. Raises InputError.
    """
    parsed = arguments.parse(argv)
    with Composer(parsed.config_name or command, parsed.config_dir) as composer:
        planned = plan(composer, parsed.overrides, parsed.multirun, parsed.overrides)
        return validated(planned, composer, validate)


def plan(composer: Composer, overrides: Sequence[str], multirun: bool, typed: Sequence[str] = ()) -> Plan:
    """Compose every job of a command line.

    typed: overrides that must not contradict each other; the others come from a run that is resumed.
    Raises InputError where Hydra could not compose.
    """
    parsed = normalised(overrides, composer)
    _refuse_swept_hydra(parsed)
    words = [text_of(override) for override in parsed]
    job = next(_jobs(parsed))
    first = _composed(composer, job)
    if multirun or str(first.hydra.mode or "").endswith("MULTIRUN"):
        # Sweeps of an experiment file come first, since those of the command line take precedence.
        params = OmegaConf.select(first, "hydra.sweeper.params") or {}
        swept = composer.parse([f"{key}={value}" for key, value in params.items()]) + parsed
        _refuse_intervals(swept, first)
        configs = {
            words_of_job: first if words_of_job == job else _composed(composer, words_of_job)
            for words_of_job in _checked_jobs(swept)
        }
        planned = Plan(words, True, math.prod(map(len, _choices(swept))), configs)
    else:
        _refuse_intervals(parsed, first)
        _refuse_sweep(parsed, composer)
        planned = Plan(words, False, 1, {job: first})
    refuse_conflicts(composer.parse(typed), planned.configs.values(), composer.catalogue)
    return planned


def compose_job(composer: Composer, words: Sequence[str]) -> Job[Any]:
    """Return the single job of a command line, without the checks of its command. Raises InputError."""
    (job,) = validated(plan(composer, words, multirun=False), composer, lambda job: None)
    return job


def validated(plan: Plan, composer: Composer, validate: Validate) -> list[Job[Any]]:
    """Return the jobs, validated by their command. An error names the user's file that holds the bad value."""
    jobs: list[Job[Any]] = []
    for words, config in plan.configs.items():
        try:
            job: Job[Any] = Job.composed(without_hydra(config), config.hydra, composer.catalogue)
            for line in (*namesakes(job.choices, job.folders), radius_note(job.config.robot)):
                if line:
                    warnings.warn(line, stacklevel=2)
            validate(job)
        except (InputError, OmegaConfBaseException) as error:
            from runners.config.diagnosis import add_location

            schema = OmegaConf.get_type(config)
            mistake = error if isinstance(error, InputError) else translate_error(error, schema)
            raise add_location(mistake, config, words, composer) from error
        except (Exception, SystemExit) as error:  # a user's own class may raise anything
            explanation = user_error(error)
            if not explanation:
                raise
            raise InputError(explanation) from error
        jobs.append(job)
    _refuse_shared_label(jobs, composer)
    return jobs


def _refuse_shared_label(jobs: Sequence[Job[Any]], composer: Composer) -> None:
    """Raise InputError for one name of the user's for several systems, which no table could tell apart."""
    pairs: dict[str, dict[str, None]] = {}
    for job in jobs:
        label = systems.own_label(job.config.system.label, job.choices.get("system", ""), composer.catalogue)
        if label is not None:
            pair = " + ".join(job.choices.get(group, "") for group in systems.PAIR)
            pairs.setdefault(label, {})[pair] = None
    for label, names in pairs.items():
        if len(names) > 1:
            raise InputError(
                f"system.label is {label} for {len(names)} systems ({', '.join(names)}): must name one; "
                "start each in a run of its own, or leave the label out"
            )


def _refuse_swept_hydra(parsed: Sequence[Override]) -> None:
    """Raise InputError for a sweep over Hydra's own keys, which are the same for all jobs."""
    for override in parsed:
        if override.is_hydra_override() and override.is_sweep_override():
            key, _, value = text_of(override).partition("=")
            swept = key.removeprefix("hydra.sweeper.params.")
            better = f"-m {swept}={value} to sweep it" if swept != key else "one value"
            raise InputError(
                f"{text_of(override)}: several values for a key of Hydra's own; must be {better}"
            )


def _refuse_intervals(parsed: Sequence[Override], config: DictConfig) -> None:
    """Raise InputError for an interval, unless a sweeper plugin chooses values from it."""
    if not config.hydra.sweeper._target_.endswith(".BasicSweeper"):
        return
    for override in parsed:
        interval = override.value()
        if isinstance(interval, IntervalSweep):
            text = text_of(override).lstrip("+")
            raise InputError(
                f"{text}: an interval does not say which values to run; list them, "
                f"e.g. {text.partition('=')[0]}={interval.start:g},{interval.end:g}"
            )


def _refuse_sweep(parsed: Sequence[Override], composer: Composer) -> None:
    for override in parsed:
        if override.is_sweep_override():
            text = text_of(override).lstrip("+")
            key, _, value = text.partition("=")
            takes_list = key in SEVERAL_OPTIONS or key not in composer.slots
            is_list = takes_list and override.value_type is ValueType.SIMPLE_CHOICE_SWEEP
            better = f", or write {key}=[{value}] for a list" if is_list else _suggest_range(key, override)
            raise InputError(f"{text}: several values; add -m to run each of them{better}")


def _suggest_range(key: str, override: Override) -> str:
    """Return advice for a range(5) that was meant as worlds of one run; empty for anything else."""
    swept = override.value()
    if not isinstance(swept, RangeSweep) or key.rpartition(".")[2] != "worlds":
        return ""
    numbers = list(swept.range())
    if not numbers or swept.step != 1:
        return ""
    return f", or write {key}={numbers[0]}-{numbers[-1]} to drive them in one run"


def _checked_jobs(parsed: Sequence[Override]) -> list[tuple[str, ...]]:
    """Return all jobs of a sweep in Hydra's order; of a very large one, enough for each value to occur once."""
    jobs = list(itertools.islice(_jobs(parsed), MAX_JOBS_CHECKED + 1))
    if len(jobs) <= MAX_JOBS_CHECKED:
        return jobs
    choices = _choices(parsed)
    firsts = [texts[0] for texts in choices]
    once = [(*firsts[:i], text, *firsts[i + 1 :]) for i, texts in enumerate(choices) for text in texts[1:]]
    return [tuple(firsts), *once]


def _jobs(parsed: Sequence[Override]) -> Iterator[tuple[str, ...]]:
    return itertools.product(*_choices(parsed))


def _choices(parsed: Sequence[Override]) -> list[list[str]]:
    """Return the overrides of each key. A key's last override wins. Sweeps without fixed values are left out."""
    choices: dict[str, list[str]] = {}
    for override in parsed:
        key = override.get_key_element()
        if override.is_discrete_sweep():
            choices[key] = [f"{key}={value}" for value in override.sweep_string_iterator()]
        elif not override.is_sweep_override():
            choices[key] = [text_of(override)]
    return [texts for texts in choices.values() if texts]


def _composed(composer: Composer, job: Sequence[str]) -> DictConfig:
    try:
        config = composer.compose(job)
    except COMPOSING as error:
        from runners.config.diagnosis import diagnose

        raise diagnose(error, composer, job) from error
    known = keys_beside(OmegaConf.get_type(config), "")
    for key in sorted({str(key) for key in config} - {*known, "hydra"} if known else ()):
        raise unknown_key(key, known)  # the ++ of an open mapping also adds keys of other commands
    try:
        map_sets.expand_worlds(config)
    except InputError as error:
        from runners.config.diagnosis import add_location

        raise add_location(error, config, job, composer) from error
    return config
