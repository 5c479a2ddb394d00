"""Train one job: search for parameters, write the weight file, and evaluate it on held-out worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import InputError, require
from lme.worlds.world import MapSet
from runners.analysis import failures
from runners.config import ablations, build, instantiate
from runners.config.catalogue import Catalogue
from runners.config.flatten import flatten
from runners.config.job import Job
from runners.config.quoting import resume_command
from runners.config.schema import TrainConfig
from runners.config.space import PARAMETERS, Space, own_values, read_space, with_values
from runners.experiments import evaluate
from runners.experiments.held_out import evaluate_held_out
from runners.experiments.labels import run_labels
from runners.experiments.resume_hint import resume_hint
from runners.records import weight_file
from runners.records.launch_record import fingerprint, identity
from runners.records.run_directories import locked
from runners.search.loop import run_trials
from runners.search.opening import open_study
from runners.search.storage import masked, open_storage, storage_errors
from runners.search.study import CONFIGURATIONS, Study, Trial
from runners.workers import trials
from runners.workers.progress import TrialProgress

if TYPE_CHECKING:
    import pandas as pd

_TRAINING = 0x7472  # seeds the draw of configurations apart from the episodes


def validate(job: Job[TrainConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    config = job.config
    evaluate.check_report(job)
    build.check_drive(config)
    for key, count in (("trials", config.trials), ("configurations", config.configurations)):
        require(key, count, at_least=1)
    for key, penalty in (("crash", config.reward.crash), ("timeout", config.reward.timeout)):
        require(f"reward.{key}", penalty, at_most=0.0)
    if config.reward.max_steps is not None:
        require("reward.max_steps", config.reward.max_steps, at_least=1)
    _space(job)
    instantiate.build(config.search, "search")
    training_maps(config, training_worlds(config))
    weight_file.check_name(weights_name(config), _fingerprint(config))
    if config.storage is not None:
        open_storage(config.storage)


def train(job: Job[TrainConfig]) -> None:
    """Search until the study has all its trials, evaluate the best, and write everything below the run directory."""
    config, run_dir = job.config, job.run_dir
    tracking = instantiate.build(config.tracking, "tracking")
    labels = replace(run_labels(job, build.map_set(config)), weights=weights_name(config))
    tags = {**asdict(labels), "changes": job.changes_text, "command": "train"}
    tracking.start(asdict(_without_password(config)), run_dir, tags, job.sweep_dir)
    with resume_hint("train", run_dir), locked(run_dir):
        with storage_errors(
            config.storage, f"finished trials are kept, continue with: {resume_command('train', run_dir)}"
        ):
            found = _search(job)
            best = max(found.told, key=lambda trial: (trial.reward, -trial.number))
            weights = _write_weights(job, found, best)
            pictures = _pictures(found, _space(job), run_dir)
        frame = evaluate_held_out(job, best.values, weights_name(config))
    pages = [page for place in frame["run_dir"].unique() for page in failures.folder(Path(place))]
    _track(tracking, found.told, best, frame, [weights, *pictures, *pages])


def training_worlds(config: TrainConfig) -> list[int]:
    """The numbers of the configurations to train on: drawn once per seed, without those held out.

    Raises InputError if there are too few to draw from.
    """
    numbers, count = config.training_numbers, config.configurations
    if len(numbers) != 2 or not 0 <= numbers[0] <= numbers[1]:
        raise InputError(f"training_numbers is {numbers}: must be [first, last], from 0 on")
    first, last = numbers
    nodes = list(config.held_out.values()) or [config.map]
    kept = {number for node in nodes for number in build.map_set(replace(config, map=node)).numbers}
    left = last - first + 1 - sum(first <= number <= last for number in kept)
    if left < count:
        raise InputError(
            f"training_numbers is {numbers}: must leave {count} worlds besides those held out, but leaves {left}"
        )
    rng = np.random.default_rng(np.random.SeedSequence([config.seed, _TRAINING]))
    drawn: list[int] = []
    while len(drawn) < count:
        number = int(rng.integers(first, last + 1))
        if number not in kept and number not in drawn:
            drawn.append(number)
    return drawn


def training_maps(config: TrainConfig, worlds: list[int]) -> MapSet:
    """The map set with these worlds. Raises InputError if it does not have them."""
    try:
        return build.map_set(config, worlds)
    except InputError as error:
        raise InputError(
            f"training_numbers is {config.training_numbers}: must be worlds that the map has, such as "
            f"[0,299] with map=barn and its lab100 held out ({error})"
        ) from error


def _space(job: Job[TrainConfig]) -> Space:
    """The search space: the ranges of the config, without the keys that the ablation fixes."""
    ablated = ablations.settings(job.choices.get(ablations.GROUP, ""), Catalogue(job.folders))
    return read_space(job.config, dict(flatten(ablated)))


def _search(job: Job[TrainConfig]) -> Study:
    """Run the study until it has all its trials; trials of an earlier run count."""
    config, run_dir = job.config, job.run_dir
    search = instantiate.build(config.search, "search")
    space = _space(job)
    first = own_values(config, space) if config.start_from_config else {}
    study = open_study(config.storage, config.study, run_dir, identity(config), space, search, first)
    worlds = _configurations(study, config, run_dir)
    training = with_values(config, {"map.worlds": worlds})
    with TrialProgress(f"train {config.robot.name}", config.trials) as progress:
        progress.skip(len(study.told), study.best)
        if study.num_told < config.trials:
            executor = instantiate.build(config.executor, "executor")
            with executor.open(trials.initialise, training, len(worlds) * search.batch) as run_all:
                run_trials(study, config.trials, search.batch, worlds, run_all, progress.set_done)
    return study


def _configurations(study: Study, config: TrainConfig, run_dir: Path) -> list[int]:
    """The configurations of the study. Raises InputError if the map has changed since they were drawn."""
    worlds = training_worlds(config)
    maps = training_maps(config, worlds)
    drawn = []
    for task in map(maps.task, worlds):
        drawn.append({"world": task.number, "start": list(task.start), "goal": task.goal.tolist()})
    kept = study.get_or_set(CONFIGURATIONS, drawn)
    if kept != drawn:
        raise InputError(
            f"{run_dir}: its study was trained on other configurations of map {task.map_name}, which has changed "
            "since: start another study"
        )
    return worlds


def _write_weights(job: Job[TrainConfig], found: Study, best: Trial) -> Path:
    config, told, name = job.config, found.told, weights_name(job.config)
    about = {
        "map": job.choices["map"],
        "configurations": training_worlds(config),
        "search": job.choices["search"],
        "trials": len(told),
        "trial": best.number,
        "reward": best.reward,
        "study": _fingerprint(config),
    }
    pair = {group: job.choices[group] for group in ("guide", "planner")}
    use = weight_file.usage(config, best.values, pair, name)
    path = weight_file.write_weights(config, best.values, about, job.run_dir, name, use)
    print(f"Best of {len(told)} trials: reward {best.reward:.3f} (trial {best.number})")
    for key, value in best.values.items():
        print(f"  {key.removeprefix(PARAMETERS)} = {value:.4g}")
    if found.num_elsewhere:
        print(f"{found.num_elsewhere} trials are still running on other machines and do not count")
    print(f"Weights: {path}; use them with: {use}")
    return path


def _pictures(found: Study, space: Space, run_dir: Path) -> list[Path]:
    from runners.figures.reports.training import training_figures, write_trials

    told = found.told
    return [write_trials(told, run_dir), *training_figures(told, space, found.importances(), run_dir)]


def _track(tracking: Any, told: list[Trial], best: Trial, frame: pd.DataFrame, files: list[Path]) -> None:
    """Track one run with a series of rewards. A tracked run for each trial would take longer than the trial."""
    from runners.analysis.summary import metrics_by_map

    rewards = [trial.reward for trial in told]
    series = {"reward": rewards, "best_reward": np.maximum.accumulate(rewards).tolist()}
    numbers = {"train_reward": best.reward, "trials": float(len(told))}
    numbers |= metrics_by_map(frame)
    numbers |= {f"best_{key.rpartition('.')[2]}": value for key, value in best.values.items()}
    tracking.finish(numbers, files, series)


def _fingerprint(config: TrainConfig) -> str:
    return fingerprint([identity(config)], multirun=False)


def weights_name(config: TrainConfig) -> str:
    """The name under which the weights are registered."""
    if config.name is not None:
        return config.name
    place = config.map.get("name") or _class_name(config.map)
    parts = (config.robot.name, place, _class_name(config.search), config.seed, _fingerprint(config)[:8])
    return "-".join(map(str, parts))


def _class_name(node: Mapping[str, Any]) -> str:
    return str(node["_target_"]).rpartition(".")[2].lower()


def _without_password(config: TrainConfig) -> TrainConfig:
    return config if config.storage is None else replace(config, storage=masked(config.storage))
