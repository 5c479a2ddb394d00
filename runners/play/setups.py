"""Translation of the words of a command line into what a session drives, and trials of words before it adopts them.

A trial runs in a process of its own, since no step may take minutes: a value such as a cell size of one micrometre
would fill the memory or compute for hours, and nothing could interrupt that in the process of the page. The values that
its sliders set have limits instead and need no trial.
"""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any

from lme.errors import InputError, require
from lme.guides.lme.weight_files import PUBLISHED
from lme.worlds.check import check_task
from runners.config import build, command_line
from runners.config.composer import Composer
from runners.config.job import Job
from runners.config.schema import DriveConfig
from runners.evaluate.evaluate import run_labels
from runners.evaluate.from_python import to_hydra
from runners.play.session import Entrant, Session, Setup, Source
from runners.records.episode_record import RunLabels
from runners.workers import forkserver

LANES = 4  # most systems side by side

_CHOSEN = ("robot", "map", "sim", "crowd", "system", "guide", "planner", "filter", "ablation")
START_S, LONGEST_S = 120.0, 20.0  # time limits for the start of a trial's process and for its first steps
STEPS = 3  # of a trial
MOST_BYTES = 8 * 2**30  # of address space

# Least and greatest values that the page sets without a trial.
LIMITS: Mapping[str, tuple[float, float]] = {
    "robot.v_max": (0.0, 20.0),
    "robot.omega_max": (0.0, 50.0),
    "robot.alpha_v": (0.0, 100.0),
    "robot.alpha_omega": (0.0, 100.0),
    "robot.control_rate": (1.0, 200.0),
    "robot.lidar.num_beams": (2.0, 5000.0),
    "robot.lidar.fov": (0.0, 7.0),
    "robot.lidar.range_max": (0.0, 500.0),
    "robot.lidar.noise_std": (0.0, 10.0),
    "sim.latency": (0.0, 5.0),
    "sim.lag": (0.0, 10.0),
    "sim.slip": (0.0, 10.0),
    "sim.odometry_error": (0.0, 10.0),
    "sim.scan_noise": (0.0, 10.0),
    "sim.scan_dropout": (0.0, 1.0),
    "sim.goal_noise": (0.0, 100.0),
    "sim.goal_noise_yaw": (0.0, 10.0),
    "scale": (-1000.0, 1000.0),
}
_HARMLESS = ("map.worlds", "seed", "run")
_NUMBER = re.compile(
    r"(?<![\w.])[+-]?(?:inf|nan|(?:\d[\d_]*\.?[\d_]*|\.\d[\d_]*)(?:e[+-]?\d[\d_]*)?)(?!\w)", re.IGNORECASE
)


def setup_of(
    source: Source, run: int | None = None, world: int | None = None, former: Setup | None = None
) -> Setup:
    """Return the setup that these words describe.

    run, world: replace those that the words choose; by default the first world of the map set. former: its task is
    reused if it is the same. Raises InputError.
    """
    # Compose the systems and check the numbers that the random generators need.
    jobs = _jobs(source)
    config = jobs[0].config
    for key, value in (("seed", config.seed), ("run", getattr(config, "run", 0))):
        require(key, value, at_least=0)
    # Take the task of the former setup if it is the same, so that its drawing can stay; else build and check it.
    maps = build.map_set(config)
    number = maps.numbers[0] if world is None else world
    if former is not None and _same_task(former, config, number):
        task = former.task
    else:
        task = (maps if number in maps.numbers else build.map_set(config, [number])).task(number)
        for job in jobs:
            check_task(task, job.config.robot)
    # Name the systems, with words that would make each of them again.
    labels = [run_labels(job, maps) for job in jobs]
    systems = tuple(
        Entrant(job.config, name, explicit(job.choices, job.changes, job.config), label)
        for job, name, label in zip(jobs, _names(jobs, labels), labels, strict=True)
    )
    return Setup(
        systems, task, getattr(config, "run", 0) if run is None else run, source, tuple(maps.numbers)
    )


def _jobs(source: Source) -> Sequence[Job[Any]]:
    # Count the sweep before composing it, which may take long.
    num_systems = math.prod(
        word.count(",") + 1 for word in source.words if not word.endswith(("]", "}", "'"))
    )
    if num_systems > LANES:
        raise InputError(f"{num_systems} systems: must be at most {LANES} side by side")
    with Composer(source.config_name, source.config_dir) as composer:
        plan = command_line.plan(composer, source.words, multirun=True, typed=source.words)
        if plan.num_jobs > LANES:
            raise InputError(f"{plan.num_jobs} systems: must be at most {LANES} side by side")
        jobs = command_line.validated(plan, composer, _check)
    _check_together(jobs)
    return jobs


def _same_task(former: Setup, config: DriveConfig, number: int) -> bool:
    former_config = former.systems[0].config
    same_map = (former_config.map, former_config.crowd) == (
        config.map,
        config.crowd,
    ) and former.task.number == number
    return same_map and (
        config.map.get("radius") is not None or former_config.robot.footprint == config.robot.footprint
    )


def explicit(choices: Mapping[str, str], changes: Mapping[str, Any], config: DriveConfig) -> tuple[str, ...]:
    """Return words that state a whole config: every choice, every changed key, and the keys outside groups."""
    options = {group: choices[group] for group in _CHOSEN if choices.get(group) not in (None, "null")}
    if "system" in options:  # the system chooses these two
        options.pop("guide", None)
        options.pop("planner", None)
    if "+" in options.get("ablation", ""):
        options["ablation"] = f"[{options['ablation'].replace('+', ',')}]"
    keys = {key: to_hydra(value) for key, value in changes.items() if key.partition(".")[0] != "people"}
    factors = getattr(config, "scale", {})
    scale = {"scale": to_hydra(factors)} if factors else {}
    weights = {} if config.weights == PUBLISHED else {"weights": to_hydra(config.weights)}
    people = {"people": str(build.people_of(config))}
    words_by_key = {**weights, **scale, **people, "seed": str(config.seed)}
    return tuple(f"{key}={value}" for key, value in {**options, **keys, **words_by_key}.items())


def _names(jobs: Sequence[Job[Any]], labels: Sequence[RunLabels]) -> list[str]:
    """Return the names of the systems; equal names are followed by what differs."""
    names = [
        f"{label.system}, {label.ablation}" if label.ablation not in ("", "none") else label.system
        for label in labels
    ]
    if len(set(names)) == len(names):
        return names
    return [f"{name} ({job.changes_text or 'unchanged'})" for name, job in zip(names, jobs, strict=True)]


def _check(job: Job[Any]) -> None:
    job.check_scale()
    build.simulator(job.config)


def _check_together(jobs: Sequence[Job[Any]]) -> None:
    """Raise InputError unless all systems share the world, the time step and the random numbers."""
    config = jobs[0].config
    for key, value in (
        ("map", config.map),
        ("crowd", config.crowd),
        ("seed", config.seed),
        ("run", getattr(config, "run", 0)),
    ):
        if any(getattr(job.config, key, 0) != value for job in jobs):
            raise InputError(
                f"{key} is swept: side by side are different systems in one world; must be one value"
            )
    if len({job.config.robot.dt for job in jobs}) > 1:
        raise InputError("robot is swept: robots side by side must have the same control_rate")


def try_words(source: Source, changes: Mapping[str, object]) -> None:
    """Raise InputError unless words drive their first steps in reasonable time and memory.

    source: has the changed words. changes: made to the words; changes of names alone need no trial.
    """
    # Values within the limits of the sliders are harmless; any other number makes a trial necessary.
    numbers = {
        key: [float(number.replace("_", "")) for number in _NUMBER.findall(str(value))]
        for key, value in changes.items()
        if key not in _HARMLESS
    }
    for key, (lowest, highest) in LIMITS.items():
        for number in numbers.pop(key, []):
            if not lowest <= number <= highest:
                raise InputError(f"{key} is {number:g}: lme play takes {lowest:g} to {highest:g}")
    if any(numbers.values()):
        _try(source)


def _try(source: Source) -> None:
    with forkserver.context() as context:
        parent, child = context.Pipe()
        process = context.Process(target=_drive, args=(child, source), daemon=True)
        process.start()
        child.close()
    # Wait for the process, then for the first steps. It is killed in any case.
    try:
        problem = (
            parent.recv() if parent.poll(START_S) and parent.recv() and parent.poll(LONGEST_S) else _TOO_LONG
        )
    except EOFError:
        problem = "these words end the process that drives them, perhaps for want of memory"
    finally:
        process.kill()
        process.join()
    if problem:
        raise InputError(problem)


_TOO_LONG = f"these words need more than {LONGEST_S:g} s for the first {STEPS} steps: choose values nearer to the usual"


def _drive(page: Connection, source: Source) -> None:
    """Report that the process has started, then what prevents driving; "" if nothing does."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    page.send("there")
    try:
        Session(setup_of(source)).advance(STEPS, LONGEST_S)
    except InputError as error:
        page.send(str(error))
    except Exception as error:
        page.send(f"{type(error).__name__}: {error}")
    else:
        page.send("")
