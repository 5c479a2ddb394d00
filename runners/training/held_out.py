"""Evaluate the result of a training on worlds that it never saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config import build, instantiate
from runners.config.changes import HELD_OUT, TRAINING, TRAINING_ROBOTS
from runners.config.job import Job
from runners.config.schema import EvalConfig, HeldOutConfig
from runners.config.space import PARAMETERS, with_values
from runners.config.systems import ablation_labels, systems
from runners.evaluate.evaluate import drive, report, run_labels
from runners.records import inputs
from runners.records.launch_record import launch_of
from runners.reports.explainer import pages

if TYPE_CHECKING:
    import pandas as pd

    from runners.reports.analysis.summary import Row

Places = Mapping[str, HeldOutConfig]


def held_out_places(job: Job[HeldOutConfig]) -> Places:
    """Return the maps of `held_out`, or else `map`."""
    config = job.config
    map_nodes = config.held_out or {job.choices["map"]: config.map}
    return {name: replace(config, map=node) for name, node in map_nodes.items()}


def evaluate_held_out(
    job: Job[HeldOutConfig],
    held_out: Places,
    values: Mapping[str, Any],
    weights: str,
    subject: str,
    subfolder: str = "",
) -> pd.DataFrame:
    """Evaluate values on every held-out map, and return the records.

    held_out: configs by name, each with its map and robot. values: by dotted config key. weights: name for the column
    `weights` of the records. subject: description of the values. Every map has its own directory in `subfolder`
    of the training's.
    """
    from runners.records.records import read_episodes

    for map_name, config in held_out.items():
        _evaluate_on(
            map_name, _evaluation(job, config, values, map_name, weights, subfolder), values, subject
        )
    return read_episodes([job.run_dir / subfolder / map_name for map_name in held_out])


def report_held_out(job: Job[HeldOutConfig], frame: pd.DataFrame) -> None:
    """Write and print the table of held-out records."""
    from runners.reports.analysis.tables import print_table, write_tables

    rows = _rows(job, frame)
    write_tables(frame, rows, job.run_dir)
    print_table(frame, rows)
    print(f"Weights, pictures, records and tables: {job.run_dir}")


def write_table(job: Job[HeldOutConfig], run_dir: Path) -> None:
    """Write the tables of one held-out map again."""
    from runners.records.records import read_episodes
    from runners.reports.analysis.tables import write_tables

    frame = read_episodes([run_dir])
    write_tables(frame, _rows(job, frame), run_dir)


def _rows(job: Job[HeldOutConfig], frame: pd.DataFrame) -> list[Row]:
    from runners.reports.analysis.summary import summarise

    return summarise(frame, systems=systems(job.folders), labels=ablation_labels(job.folders))


def _evaluation(
    job: Job[HeldOutConfig],
    place_config: HeldOutConfig,
    values: Mapping[str, Any],
    map_name: str,
    weights: str,
    subfolder: str,
) -> Job[EvalConfig]:
    """Return the job that evaluates the values on one map."""
    # The keys that this config shares with that of lme eval, with the values found.
    tuned_config = with_values(place_config, values)
    own_robot = place_config.robot is not job.config.robot
    names = {field.name for field in fields(EvalConfig)} & {field.name for field in fields(tuned_config)}
    shared = {field_name: getattr(tuned_config, field_name) for field_name in names}
    config = EvalConfig(**{**shared, "weights": weights, "resume": False})
    return Job(
        config=config,
        choices=_choices(job, map_name, own_robot),
        overrides=job.overrides,
        changes=_changes(job, map_name, own_robot) | _settings(values),
        folders=job.folders,
        run_dir=job.run_dir / subfolder / map_name,
    )


def _choices(job: Job[HeldOutConfig], map_name: str, own_robot: bool) -> dict[str, str]:
    """Return the options of the evaluation: the place has its own map, and perhaps its own robot."""
    choices = dict(job.choices)
    group_keys = [f"map@{HELD_OUT}{map_name}", f"map@{TRAINING}{map_name}"]
    choices["map"] = next((job.choices[key] for key in group_keys if key in job.choices), map_name)
    if own_robot:
        choices["robot"] = job.choices[f"robot@{TRAINING_ROBOTS}{map_name}"]
    return choices


def _changes(job: Job[HeldOutConfig], map_name: str, own_robot: bool) -> dict[str, Any]:
    """Return the changed keys of the evaluation on one map, without those of other maps."""
    key_prefixes = {f"{HELD_OUT}{map_name}.": "map.", f"{TRAINING}{map_name}.": "map."}
    key_prefixes |= {f"{TRAINING_ROBOTS}{map_name}.": "robot."} if own_robot else {}
    foreign = [HELD_OUT, TRAINING, TRAINING_ROBOTS]
    foreign += ["map."] if job.config.held_out else []
    foreign += ["robot."] if own_robot else []
    changes = {key: value for key, value in job.changes.items() if not key.startswith(tuple(foreign))}
    for prefix, group in key_prefixes.items():
        changes |= {
            key.replace(prefix, group, 1): value
            for key, value in job.changes.items()
            if key.startswith(prefix)
        }
    return changes


def _evaluate_on(map_name: str, job: Job[EvalConfig], values: Mapping[str, Any], subject: str) -> None:
    config, maps = job.config, build.map_set(job.config)
    worlds = f"{len(maps.numbers)} worlds of {map_name} that training never saw"
    print(f"Now {subject}: {worlds}, {config.runs} runs each")
    job.run_dir.mkdir(parents=True, exist_ok=True)
    launch = launch_of("eval", [job], [], False, None)
    launch.write(job.run_dir)
    inputs.keep(launch.inputs, job.run_dir)
    labels = replace(run_labels(job, maps), map=map_name)
    if _settings(values):  # not the planner of the named pair any more
        labels = replace(labels, system=f"{labels.guide}+{labels.planner}")
    drive(config, labels, maps, job.run_dir)
    pages.make_requested_pages(config.explain, job.run_dir, instantiate.build(config.executor, "executor"))
    report(maps, job)


def _settings(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values found for keys that are not parameters of the guide."""
    return {key: value for key, value in values.items() if not key.startswith(PARAMETERS)}
