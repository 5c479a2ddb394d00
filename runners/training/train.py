"""Train one job: search for parameters, race the best, write the weight file, and compare it with the start."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lme.errors import require
from lme.guides.lme.weight_files import WEIGHTS
from runners.config import build, instantiate
from runners.config.changes import TRAINING
from runners.config.job import Job
from runners.config.quoting import element, lme_command, override, resume_command
from runners.config.schema import TrainConfig
from runners.config.space import PARAMETERS
from runners.evaluate import evaluate
from runners.evaluate.driven import driven
from runners.evaluate.labels import resume_hint, run_labels
from runners.records import weight_file
from runners.records.episode_record import RunLabels
from runners.records.launch_record import fingerprint, identity
from runners.records.run_directories import locked
from runners.reports.analysis import failures
from runners.tracking.mlflow import closed_by
from runners.tracking.parameters import parameters
from runners.training.families import Families, families, too_narrow
from runners.training.held_out import Places, evaluate_held_out, report_held_out
from runners.training.race import START, check_race
from runners.training.report import write_training_report
from runners.training.search_and_race import (
    Found,
    evaluation_places,
    search_and_race,
    search_space,
    start_name,
    world_numbers,
)
from runners.training.storage import open_storage, storage_errors
from runners.training.verdict import Verdict, judge, with_rewards
from runners.workers.trials import check_disturbances

if TYPE_CHECKING:
    import pandas as pd

_START = "start"  # folder of the evaluation with the config's own values


def validate(job: Job[TrainConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    config = job.config
    evaluate.check_report(job)
    trained = families(config, job.choices)
    for family in trained.values():
        check_disturbances(family)
        build.check_drive(family)
    for key in ("trials", "restarts", "configurations"):
        require(key, getattr(config, key), at_least=1)
    if config.race is not None:
        check_race(config.race)
    for key, penalty in (("crash", config.reward.crash), ("timeout", config.reward.timeout)):
        require(f"reward.{key}", penalty, at_most=0.0)
    if config.reward.max_steps is not None:
        require("reward.max_steps", config.reward.max_steps, at_least=1)
    search_space(job)
    instantiate.build(config.search, "search")
    world_numbers(job, trained)
    weight_file.check_name(weights_name(job), _fingerprint(config))
    if config.storage is not None:
        open_storage(config.storage)


def train(job: Job[TrainConfig]) -> None:
    """Search, race, evaluate the result and the start, and write everything below the run directory."""
    config, run_dir = job.config, job.run_dir
    # Set up the families of worlds and the tracked run.
    trained = families(config, job.choices)
    labels = _labels(job, trained)
    tracking = instantiate.build(config.tracking, "tracking")
    tags = {**asdict(labels), "changes": job.changes_text, "command": "train"}
    tracking.start(parameters(asdict(config), labels), run_dir, tags, job.sweep_dir)
    with closed_by(tracking):
        _announce(job, trained)
        with resume_hint("train", run_dir), locked(run_dir):
            # Search and race. The weights are written at once, in case the evaluation is stopped.
            with storage_errors(
                config.storage, f"finished trials are kept, continue with: {resume_command('train', run_dir)}"
            ):
                found = search_and_race(job, trained)
                weights = _write_weights(job, trained, found)
                pictures = _pictures(found, run_dir)
            # Compare start and result on held-out worlds; the weight file then holds the verdict.
            places = evaluation_places(job, trained)
            start, frame = _evaluate(job, places, found)
            verdict = judge(places, start, frame, found.reward)
            _write_weights(job, trained, found, verdict)
            _advise(job, found, verdict)
            use = _usage(job, found)
            pictures += write_training_report(
                job, places, found, start, frame, verdict, use, run_dir / _START
            )
        pages = [page for place in frame["run_dir"].unique() for page in failures.folder(Path(place))]
        _track(tracking, found, frame, [weights, *pictures, *pages])


def _announce(job: Job[TrainConfig], trained: Families) -> None:
    narrow = too_narrow(job.config)
    print(f"Training on {', '.join(f'{name} ({family.robot.name})' for name, family in trained.items())}")
    if narrow:
        print(
            f"Not on {', '.join(narrow)}: too narrow for {job.config.robot.name}. "
            "To train on one map alone: map=NAME, or map=file map.path=FILE for your own"
        )


def _evaluate(job: Job[TrainConfig], places: Places, found: Found) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Evaluate start and result on held-out worlds, and print the table; return the records with rewards.

    If the start is the result, it is evaluated only once, as the result, and both are the same object.
    """
    import pandas as pd

    if found.number == START:
        only = with_rewards(places, evaluate_held_out(job, places, {}, job.weights, "the start"))
        report_held_out(job, only)
        return only, only
    start = with_rewards(places, evaluate_held_out(job, places, {}, job.weights, "the start", _START))
    driven = evaluate_held_out(job, places, found.values, weights_name(job), "the result")
    frame = with_rewards(places, driven)
    report_held_out(job, pd.concat([start, frame], ignore_index=True))
    return start, frame


def _write_weights(
    job: Job[TrainConfig], trained: Families, found: Found, verdict: Verdict | None = None
) -> Path:
    config, name = job.config, weights_name(job)
    about: dict[str, Any] = {
        "map": "+".join(trained),
        "configurations": found.configurations,
        "search": job.choices["search"],
        "trials": len(found.told),
        "trial": _START if found.number == START else found.number,
        "reward": found.reward,
        "worlds": found.worlds,
        "study": _fingerprint(config),
    }
    if verdict is not None:
        about["held_out"] = verdict.content()
    whose = f": no trial beat the start, {start_name(job)}" if found.number == START else ""
    note = f"{whose}; use with: {_usage(job, found)}"
    return weight_file.write_weights(config, found.values, about, job.run_dir, name, note)


def _usage(job: Job[TrainConfig], found: Found) -> str:
    """Return the command that drives with the values found."""
    words = driven(job, "train", found.values)
    if weight_file.best_parameters(job.config, found.values):
        words.append(override("weights", weights_name(job)))
    return lme_command("eval", *words, *weight_file.settings(found.values), folders=job.folders)


def _advise(job: Job[TrainConfig], found: Found, verdict: Verdict) -> None:
    """Print the result and what to do with it."""
    whose = "the start" if found.number == START else f"trial {found.number}"
    worlds = f"{found.worlds} worlds" + ("" if job.config.map else " of each family")
    print(f"Best of {len(found.told)} trials: reward {found.reward:.3f} ({whose}), {worlds}")
    for key, value in found.values.items():
        print(f"  {key.removeprefix(PARAMETERS)} = {value:.4g}")
    if found.num_elsewhere:
        print(f"{found.num_elsewhere} trials are still running on other machines and do not count")
    for line in verdict.lines(start_name(job)):
        print(line)
    use = f"{'not recommended' if verdict.is_worse else 'use them with'}: {_usage(job, found)}"
    print(f"Weights: {job.run_dir / WEIGHTS}; {'those started from' if found.number == START else use}")
    if found.number != START and (elsewhere := _elsewhere(job, found)):
        print(f"Trained on {job.choices['map']} alone, they may be worse elsewhere: {elsewhere}")


def _elsewhere(job: Job[TrainConfig], found: Found) -> str:
    """Return the command that drives weights trained on one map on the families that any robot can drive.

    It compares them with the starting weights, unless values were also found for other keys.
    """
    config = job.config
    if not config.map or config.held_out or not config.guide.get("parameters"):
        return ""
    # The maps of the families that any robot can drive, except the one trained on.
    maps = [
        job.choices.get(f"map@{TRAINING}{name}", "")
        for name, node in config.training.items()
        if node is not None and name not in config.training_robots
    ]
    others = [name for name in maps if name not in ("", job.choices["map"])]
    if not others:
        return ""
    # A sweep over these maps.
    words = [
        word for word in driven(job, "train", found.values) if word.lstrip("+").partition("=")[0] != "robot"
    ]
    settings = weight_file.settings(found.values)
    compared = [*([] if settings else [job.weights]), weights_name(job)]
    words = [f"robot={job.choices['robot']}", *words, f"map={','.join(others)}"]
    words += [f"weights={','.join(map(element, compared))}", *settings]
    return lme_command("eval", "-m", *words, folders=job.folders)


def _pictures(found: Found, run_dir: Path) -> list[Path]:
    from runners.training.pictures import training_figures, write_race, write_trials

    told = found.told
    tables = [write_trials(told, run_dir), *([write_race(found.race, run_dir)] if found.race else [])]
    return [*tables, *training_figures(told, found.importances, run_dir)]


def _track(tracking: Any, found: Found, frame: pd.DataFrame, files: list[Path]) -> None:
    """Track one run with a series of rewards. A tracked run for each trial would take longer than the trial."""
    from runners.reports.analysis.summary import metrics_by_map

    rewards = [trial.reward for trial in found.told]
    series = {"reward": rewards, "best_reward": np.maximum.accumulate(rewards).tolist()}
    numbers = {"train_reward": found.reward, "trials": float(len(rewards))}
    numbers |= metrics_by_map(frame)
    numbers |= {f"best_{key.rpartition('.')[2]}": value for key, value in found.values.items()}
    tracking.finish(numbers, files, series)


def _fingerprint(config: TrainConfig) -> str:
    return fingerprint([identity(config)], multirun=False)


def weights_name(job: Job[TrainConfig]) -> str:
    """Return the name under which the weights are registered."""
    config = job.config
    if config.name is not None:
        return config.name
    place = config.map.get("name") or _class_name(config.map) if config.map else "families"
    parts = (config.robot.name, place, _class_name(config.search), config.seed, _fingerprint(config)[:8])
    return "-".join(map(str, parts))


def _labels(job: Job[TrainConfig], trained: Families) -> RunLabels:
    first = next(iter(trained.values()))
    labels = run_labels(replace(job, config=first), build.map_set(first))
    if not job.config.map:
        labels = replace(labels, map="+".join(trained), robot=job.config.robot.name, subset="")
    return replace(labels, weights=weights_name(job))


def _class_name(node: Mapping[str, Any]) -> str:
    return str(node["_target_"]).rpartition(".")[2].lower()
