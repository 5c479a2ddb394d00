"""Evaluate the result of a training on worlds that it never saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runners.config import ablations, build, instantiate
from runners.config.changes import HELD_OUT, TRAINING, TRAINING_ROBOTS
from runners.config.job import Job
from runners.config.schema import EvalConfig, HeldOutConfig
from runners.config.space import PARAMETERS, with_values
from runners.config.systems import systems
from runners.evaluate.evaluate import drive, report
from runners.evaluate.labels import run_labels
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
    places = config.held_out or {job.choices["map"]: config.map}
    return {name: replace(config, map=node) for name, node in places.items()}


def evaluate_held_out(
    job: Job[HeldOutConfig],
    places: Places,
    values: Mapping[str, Any],
    weights: str,
    what: str,
    below: str = "",
) -> pd.DataFrame:
    """Evaluate values on every held-out map, and return the records.

    places: configs by name, each with its map and robot. values: by dotted config key. weights: name for the column
    `weights` of the records. what: description of the values. Every map has its own directory in the folder `below`
    of the training's.
    """
    from runners.records.records import read_episodes

    for place, config in places.items():
        _evaluate_on(place, _evaluation(job, config, values, place, weights, below), values, what)
    return read_episodes([job.run_dir / below / place for place in places])


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

    return summarise(frame, systems=systems(job.folders), labels=ablations.labels(job.folders))


def _evaluation(
    job: Job[HeldOutConfig],
    place_config: HeldOutConfig,
    values: Mapping[str, Any],
    place: str,
    weights: str,
    below: str,
) -> Job[EvalConfig]:
    """Return the job that evaluates the values on one map."""
    # The keys that this config shares with that of lme eval, with the values found.
    found = with_values(place_config, values)
    own_robot = place_config.robot is not job.config.robot
    names = {field.name for field in fields(EvalConfig)} & {field.name for field in fields(found)}
    shared = {each: getattr(found, each) for each in names}
    config = EvalConfig(**{**shared, "weights": weights, "resume": False})
    return Job(
        config=config,
        choices=_choices(job, place, own_robot),
        overrides=job.overrides,
        changes=_changes(job, place, own_robot) | _settings(values),
        folders=job.folders,
        run_dir=job.run_dir / below / place,
    )


def _choices(job: Job[HeldOutConfig], place: str, own_robot: bool) -> dict[str, str]:
    """Return the options of the evaluation: the place has its own map, and perhaps its own robot."""
    chosen = dict(job.choices)
    here = [f"map@{HELD_OUT}{place}", f"map@{TRAINING}{place}"]
    chosen["map"] = next((job.choices[key] for key in here if key in job.choices), place)
    if own_robot:
        chosen["robot"] = job.choices[f"robot@{TRAINING_ROBOTS}{place}"]
    return chosen


def _changes(job: Job[HeldOutConfig], place: str, own_robot: bool) -> dict[str, Any]:
    """Return the changed keys of the evaluation on one map, without those of other maps."""
    own = {f"{HELD_OUT}{place}.": "map.", f"{TRAINING}{place}.": "map."}
    own |= {f"{TRAINING_ROBOTS}{place}.": "robot."} if own_robot else {}
    foreign = [HELD_OUT, TRAINING, TRAINING_ROBOTS]
    foreign += ["map."] if job.config.held_out else []
    foreign += ["robot."] if own_robot else []
    found = {key: value for key, value in job.changes.items() if not key.startswith(tuple(foreign))}
    for prefix, group in own.items():
        found |= {
            key.replace(prefix, group, 1): value
            for key, value in job.changes.items()
            if key.startswith(prefix)
        }
    return found


def _evaluate_on(place: str, job: Job[EvalConfig], values: Mapping[str, Any], what: str) -> None:
    config, maps = job.config, build.map_set(job.config)
    worlds = f"{len(maps.numbers)} worlds of {place} that training never saw"
    print(f"Now {what}: {worlds}, {config.runs} runs each")
    job.run_dir.mkdir(parents=True, exist_ok=True)
    launch = launch_of("eval", [job], [], False, None)
    launch.write(job.run_dir)
    inputs.keep(launch.inputs, job.run_dir)
    labels = replace(run_labels(job, maps), map=place)
    if _settings(values):  # not the planner of the named pair any more
        labels = replace(labels, system=f"{labels.guide}+{labels.planner}")
    drive(config, labels, maps, job.run_dir)
    pages.make_requested_pages(config.explain, job.run_dir, instantiate.build(config.executor, "executor"))
    report(maps, job)


def _settings(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values found for keys that are not parameters of the guide."""
    return {key: value for key, value in values.items() if not key.startswith(PARAMETERS)}
