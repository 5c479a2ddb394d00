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
from runners.config.quoting import element, key_of, lme_command, override, resume_command
from runners.config.schema import TrainConfig
from runners.config.space import PARAMETERS
from runners.evaluate import evaluate
from runners.evaluate.evaluate import resume_hint, run_labels
from runners.records import weight_file
from runners.records.episode_record import RunLabels
from runners.records.launch_record import fingerprint, identity
from runners.records.run_directories import locked
from runners.reports.analysis import failures
from runners.tracking.tracking import closed_by, parameters
from runners.training.families import Families, check_map_alone, describe_too_narrow, families, too_narrow
from runners.training.held_out import Places, Verdict, evaluate_held_out, judge, report_held_out, with_rewards
from runners.training.race import START, check_race
from runners.training.report import write_training_report
from runners.training.search import (
    SearchResult,
    evaluation_places,
    search_and_race,
    search_space,
    start_name,
    world_numbers,
)
from runners.training.storage import open_storage, storage_errors
from runners.workers.progress import activity
from runners.workers.trials import check_disturbances

if TYPE_CHECKING:
    import pandas as pd

_START = "start"  # folder of the evaluation with the config's own values


def validate(job: Job[TrainConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    config = job.config
    evaluate.check_report(job)
    trained = families(config, job.choices)
    if config.map:
        check_map_alone(job.choices["map"], job.overrides)
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
    weight_file.check_weights_name(weights_name(job), _fingerprint(config))
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
    tracking.start(parameters(job, labels), run_dir, tags, job.sweep_dir)
    with closed_by(tracking):
        _announce(job, trained)
        with resume_hint("train", run_dir), locked(run_dir):
            # Search and race. The weights are written at once, in case the evaluation is stopped.
            with storage_errors(
                config.storage, f"finished trials are kept, continue with: {resume_command('train', run_dir)}"
            ):
                search_result = search_and_race(job, trained)
                weights = _write_weights(job, trained, search_result)
                with activity("Pictures of the search"):
                    pictures = _pictures(search_result, run_dir)
            # Compare start and result on held-out worlds; the weight file then holds the verdict.
            held_out = evaluation_places(job, trained)
            start, frame = _evaluate(job, held_out, search_result)
            verdict = judge(held_out, start, frame, search_result.reward)
            _write_weights(job, trained, search_result, verdict)
            _advise(job, search_result, verdict)
            usage = _usage(job, search_result)
            pictures += write_training_report(
                job, held_out, search_result, start, frame, verdict, usage, run_dir / _START
            )
        pages = [page for run_path in frame["run_dir"].unique() for page in failures.folder(Path(run_path))]
        tables = sorted(run_dir.glob("table.*"))
        _track(tracking, search_result, verdict, frame, [weights, *tables, *pictures, *pages])


def _announce(job: Job[TrainConfig], trained: Families) -> None:
    print(f"Training on {', '.join(f'{name} ({family.robot.name})' for name, family in trained.items())}")
    if too_narrow(job.config):
        print(
            f"{describe_too_narrow(job.config)}. "
            "To train on one map alone: map=NAME, or map=file map.path=FILE for your own"
        )


def _evaluate(
    job: Job[TrainConfig], held_out: Places, search_result: SearchResult
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Evaluate start and result on held-out worlds, and print the table; return the records with rewards.

    If the start is the result, it is evaluated only once, as the result, and both are the same object.
    """
    import pandas as pd

    if search_result.number == START:
        only = with_rewards(held_out, evaluate_held_out(job, held_out, {}, job.weights, "the start"))
        report_held_out(job, only)
        return only, only
    start = with_rewards(held_out, evaluate_held_out(job, held_out, {}, job.weights, "the start", _START))
    result_frame = evaluate_held_out(job, held_out, search_result.values, weights_name(job), "the result")
    frame = with_rewards(held_out, result_frame)
    report_held_out(job, pd.concat([start, frame], ignore_index=True))
    return start, frame


def _write_weights(
    job: Job[TrainConfig], trained: Families, search_result: SearchResult, verdict: Verdict | None = None
) -> Path:
    config, name = job.config, weights_name(job)
    metadata: dict[str, Any] = {
        "map": "+".join(trained),
        "configurations": search_result.configurations,
        "search": job.choices["search"],
        "trials": len(search_result.trials),
        "trial": _START if search_result.number == START else search_result.number,
        "reward": search_result.reward,
        "worlds": search_result.worlds,
        "study": _fingerprint(config),
    }
    if verdict is not None:
        metadata["held_out"] = verdict.content()
    whose = f": no trial beat the start, {start_name(job)}" if search_result.number == START else ""
    note = f"{whose}; use with: {_usage(job, search_result)}"
    return weight_file.write_weights(config, search_result.values, metadata, job.run_dir, name, note)


def _usage(job: Job[TrainConfig], search_result: SearchResult) -> str:
    """Return the command that drives with the values found."""
    words = weight_file.driven(job, search_result.values)
    if weight_file.best_parameters(job.config, search_result.values):
        words.append(override("weights", weights_name(job)))
    return lme_command("eval", *words, *weight_file.settings_words(search_result.values), folders=job.folders)


def _advise(job: Job[TrainConfig], search_result: SearchResult, verdict: Verdict) -> None:
    """Print the result and what to do with it."""
    whose = "the start" if search_result.number == START else f"trial {search_result.number}"
    worlds = f"{search_result.worlds} worlds" + ("" if job.config.map else " of each family")
    print(
        f"Best of {len(search_result.trials)} trials: reward {search_result.reward:.3f} ({whose}), {worlds}"
    )
    for key, value in search_result.values.items():
        print(f"  {key.removeprefix(PARAMETERS)} = {value:.4g}")
    if search_result.num_elsewhere:
        print(f"{search_result.num_elsewhere} trials are still running on other machines and do not count")
    for line in verdict.lines(start_name(job)):
        print(line)
    usage = f"{'not recommended' if verdict.is_worse else 'use them with'}: {_usage(job, search_result)}"
    print(
        f"Weights: {job.run_dir / WEIGHTS}; {'those started from' if search_result.number == START else usage}"
    )
    if search_result.number != START and (elsewhere := _elsewhere(job, search_result)):
        print(f"Trained on {job.choices['map']} alone, they may be worse elsewhere: {elsewhere}")


def _elsewhere(job: Job[TrainConfig], search_result: SearchResult) -> str:
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
    other_maps = [name for name in maps if name not in ("", job.choices["map"])]
    if not other_maps:
        return ""
    # A sweep over these maps.
    words = [word for word in weight_file.driven(job, search_result.values) if key_of(word) != "robot"]
    settings = weight_file.settings_words(search_result.values)
    compared = [*([] if settings else [job.weights]), weights_name(job)]
    words = [f"robot={job.choices['robot']}", *words, f"map={','.join(other_maps)}"]
    words += [f"weights={','.join(map(element, compared))}", *settings]
    return lme_command("eval", "-m", *words, folders=job.folders)


def _pictures(search_result: SearchResult, run_dir: Path) -> list[Path]:
    from runners.training.pictures import training_figures, write_race, write_trials

    trials = search_result.trials
    tables = [
        write_trials(trials, run_dir),
        *([write_race(search_result.race, run_dir)] if search_result.race else []),
    ]
    return [*tables, *training_figures(trials, search_result.importances, run_dir)]


def _track(
    tracking: Any, search_result: SearchResult, verdict: Verdict, frame: pd.DataFrame, files: list[Path]
) -> None:
    """Track one run with a series of rewards. A tracked run for each trial would take longer than the trial."""
    from runners.reports.analysis.summary import metrics_by_map

    rewards = [trial.reward for trial in search_result.trials]
    series = {"reward": rewards, "best_reward": np.maximum.accumulate(rewards).tolist()}
    numbers = {"train_reward": search_result.reward, "trials": float(len(rewards))}
    numbers |= {"held_out_reward": verdict.mean_reward, **metrics_by_map(frame)}
    numbers |= {f"best_{key.rpartition('.')[2]}": value for key, value in search_result.values.items()}
    tracking.finish(numbers, files, series)


def _fingerprint(config: TrainConfig) -> str:
    return fingerprint([identity(config)], multirun=False)


def weights_name(job: Job[TrainConfig]) -> str:
    """Return the name under which the weights are registered."""
    config = job.config
    if config.name is not None:
        return config.name
    map_name = config.map.get("name") or _class_name(config.map) if config.map else "families"
    words = (config.robot.name, map_name, _class_name(config.search), config.seed, _fingerprint(config)[:8])
    return "-".join(map(str, words))


def _labels(job: Job[TrainConfig], trained: Families) -> RunLabels:
    family, config = next(iter(trained.items()))
    # Without map=, the job itself has chosen none.
    family_job = replace(job, config=config, choices={**job.choices, "map": family})
    labels = run_labels(family_job, build.map_set(config))
    if not job.config.map:
        labels = replace(labels, map="+".join(trained), robot=job.config.robot.name, subset="")
    return replace(labels, weights=weights_name(job))


def _class_name(node: Mapping[str, Any]) -> str:
    return str(node["_target_"]).rpartition(".")[2].lower()
