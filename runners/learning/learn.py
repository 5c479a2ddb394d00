"""Learn the network of one job, write its weight file, and evaluate it on held-out worlds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lme.errors import InputError, require
from lme.guides.lme.weight_files import NETWORK, find_network, with_network
from lme.requirements import install
from runners.config import build, instantiate
from runners.config.escaping import counted
from runners.config.job import Job, named_option
from runners.config.quoting import lme_command, override
from runners.config.schema import LearnConfig
from runners.evaluate import evaluate
from runners.evaluate.evaluate import resume_hint, run_labels
from runners.learning.learnable import check_learnable, learned_config, learned_part, learns_guide
from runners.records import weight_file
from runners.records.launch_record import fingerprint, identity
from runners.records.run_directories import locked
from runners.reports.analysis import failures
from runners.reports.analysis.summary import metrics, metrics_by_map
from runners.tracking.tracking import closed_by, parameters
from runners.training.families import check_left_out
from runners.training.held_out import evaluate_held_out, held_out_places, report_held_out
from runners.workers import imitation_rollouts
from runners.workers.imitation_rollouts import Expert, RolloutPayload
from runners.workers.progress import LearnProgress
from runners.workers.trials import check_ranges, ranged_keys

if TYPE_CHECKING:
    import pandas as pd

    from runners.learning.run import Learner, Run


def validate(job: Job[LearnConfig]) -> None:
    """Check the job before anything runs. Raises InputError."""
    config = job.config
    check_learnable(config, job.choices)
    if find_spec("torch") is None:
        raise InputError(f"needs torch: {install('torch')}")
    from runners.learning.run import device_of

    device_of(config.device)
    evaluate.check_report(job)
    build.check_episodes(config)
    _check_network(job)
    check_left_out(config.training, job.choices)
    _check_worlds(config)
    for key in ("validation", "threads"):
        require(key, getattr(config, key), at_least=1)
    check_ranges(config.robots)
    learner: Learner = instantiate.build(config.learner, "learner")
    learner.check(config)
    _payload(job, learner)
    weight_file.check_network_name(network_name(job), _fingerprint(config))


def learn(job: Job[LearnConfig]) -> None:
    """Learn until the learner is done, evaluate the best network, and write everything below the run directory."""
    config, run_dir = job.config, job.run_dir
    tracking = instantiate.build(config.tracking, "tracking")
    labels = run_labels(job, build.map_set(config))
    tags = {**asdict(labels), "changes": job.changes_text, "command": "learn"}
    tracking.start(parameters(job, labels), run_dir, tags, job.sweep_dir)
    with closed_by(tracking):
        with resume_hint("learn", run_dir), locked(run_dir):
            # Learn, and register the best network before its evaluation, which may be stopped.
            run = _run_learner(job)
            files = [*_register(job, run, {}), run.draw_curves()]
            # Evaluate on held-out worlds, and register again with the rates on the card.
            network = {f"{learned_part(config)}.weights": str(run_dir / NETWORK)}
            frame = evaluate_held_out(job, held_out_places(job), network, config.weights, "the network")
            report_held_out(job, frame)
            _register(job, run, _rates_by_map(frame))
        pages = [page for run_path in frame["run_dir"].unique() for page in failures.folder(Path(run_path))]
        last = run.rows[-1]
        numbers = {"validation_success": last["best_success"], "hours": last["hours"]}
        series = {f"curve_{key}": [row[key] for row in run.rows] for key in last}
        tables = sorted(run_dir.glob("table.*"))
        tracking.finish({**metrics_by_map(frame), **numbers}, [*files, *tables, *pages], series)


def network_name(job: Job[LearnConfig]) -> str:
    """Return the name that the network is registered under."""
    config = job.config
    if config.name is not None:
        return config.name
    parts = (job.choices[learned_part(config)], job.choices["learner"], config.seed, _fingerprint(config)[:8])
    return "-".join(map(str, parts))


def _run_learner(job: Job[LearnConfig]) -> Run:
    """Learn, and return the run after its last round or step."""
    from runners.learning.run import Run

    config = job.config
    learner: Learner = instantiate.build(config.learner, "learner")
    start = None if config.start is None else find_network(config.start, "start")
    executor = instantiate.build(config.executor, "executor")
    payload = _payload(job, learner)
    label = f"learn {job.choices[learned_part(config)]} by {job.choices['learner']}"
    with (
        LearnProgress(label, learner.total) as progress,
        executor.open(imitation_rollouts.initialise, payload) as drive,
    ):
        run = Run(payload.config, job.run_dir, start, drive, progress)
        learner.learn(run)
    return run


def _payload(job: Job[LearnConfig], learner: Learner) -> RolloutPayload:
    """Return the payload of the workers. Raises InputError for an option that does not exist or cannot be built."""
    config = replace(job.config, guides=job.config.guides or {job.choices["guide"]: 1.0})
    for name, share in config.guides.items():
        require(f"guides.{name}", share, above=0.0)
    guides = {name: named_option(job, "guides", "guide", name) for name in config.guides}
    part = learned_part(config)
    if part == "planner":
        for node in guides.values():
            instantiate.build(with_network(node, "guide"), "guide", robot=config.robot)
    if learner.expert is None:
        return RolloutPayload(config, guides, None, part)
    planner, guide, settings = (learner.expert[key] for key in ("planner", "guide", "settings"))
    expert = Expert(
        named_option(job, "learner.expert.planner", "planner", planner, settings),
        None if guide is None else named_option(job, "learner.expert.guide", "guide", guide),
    )
    instantiate.build(with_network(expert.planner), "learner.expert", robot=config.robot)
    return RolloutPayload(config, guides, expert)


def _check_network(job: Job[LearnConfig]) -> None:
    """Raise InputError for weights given by the wrong key, and for robot values that the planner overrides."""
    config = job.config
    part = learned_part(config)
    if f"{part}.weights" in job.changes:
        raise InputError(
            f"{part}.weights is {getattr(config, part)['weights']}: lme learn makes the weights; "
            "to continue from other weights, give start=NAME"
        )
    if config.start is not None:
        find_network(config.start, "start")
    learned_config(config)
    if learns_guide(config):
        instantiate.build(with_network(config.planner), "planner", robot=config.robot)
    reported = [
        key for key, value in dict(config.planner.get("reported_limits", {})).items() if value is not None
    ]
    if reported and ranged_keys(config.robots):
        raise InputError(
            f"planner.reported_limits sets {', '.join(reported)}: must be null if `robots` has ranges, such as with "
            "planner=dclp"
        )


def _check_worlds(config: LearnConfig) -> None:
    """Raise InputError unless the training maps have worlds that are not held out."""
    chosen = {name: node for name, node in config.training.items() if node is not None}
    if not chosen:
        raise InputError("training has no family of worlds: must hold at least one map set")
    require("first_world", config.first_world, at_least=0)
    for node in list(config.held_out.values()) or [config.map]:
        last = max(build.map_set(replace(config, map=node)).numbers)
        if last >= config.first_world:
            raise InputError(
                f"first_world is {config.first_world}: must be above {last}, the last held-out world"
            )
    for name, node in chosen.items():
        try:
            build.map_set(replace(config, map=node), [config.first_world])
        except InputError as error:
            raise InputError(
                f"training.{name} has no world {config.first_world}, first_world: must be a map set with generated "
                f"worlds, such as barn with subset fresh ({error})"
            ) from error


def _register(job: Job[LearnConfig], run: Run, held_out: Mapping[str, Any]) -> list[Path]:
    """Write network and card under the run's name; return the files in its directory."""
    config, name = job.config, network_name(job)
    last_row = {key: round(float(value), 6) for key, value in run.rows[-1].items()}
    incidental = ("resume", "executor", "tracking")  # keys that do not change the network
    words = [word for word in job.overrides if word.partition("=")[0] not in incidental]
    metadata = {
        "command": lme_command("learn", *words, folders=job.folders),
        **({"guide": job.choices["guide"]} if learns_guide(config) else {}),
        "planner": job.choices["planner"],
        "learner": job.choices["learner"],
        "robot": config.robot.name,
        "seed": config.seed,
        "training": _fingerprint(config),
        "validation": {
            "worlds": config.validation,
            "guides": list(run.config.guides),
            "best_success": run.best,
        },
        "last": last_row,
        "held_out": dict(held_out),
    }
    key = f"{learned_part(config)}.weights"
    command = lme_command("eval", *weight_file.driven(job, [key]), override(key, name), folders=job.folders)
    files = weight_file.register_network(job.run_dir, name, metadata, command)
    if not held_out:
        print(f"Best validation success of {counted(len(run.rows), 'network')}: {run.best:.3f}")
        print(f"Network: {files[0]}; use it with: {command}")
    return files


def _rates_by_map(frame: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return the rates of each held-out map, for the card."""
    return {
        str(map_name): {key: round(float(value), 6) for key, value in metrics(episodes).items()}
        for map_name, episodes in frame.groupby("map")
    }


def _fingerprint(config: LearnConfig) -> str:
    return fingerprint([identity(config)], multirun=False)
