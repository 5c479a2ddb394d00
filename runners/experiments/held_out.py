"""Evaluate the result of a training on worlds that it never saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from runners.config import ablations, build, instantiate
from runners.config.changes import HELD_OUT
from runners.config.job import Job
from runners.config.schema import EvalConfig, HeldOutConfig
from runners.config.space import PARAMETERS, with_values
from runners.config.systems import systems
from runners.experiments.evaluate import drive, report
from runners.experiments.labels import run_labels
from runners.explainer import pages
from runners.records.launch_record import launch_of

if TYPE_CHECKING:
    import pandas as pd


def evaluate_held_out(job: Job[HeldOutConfig], values: Mapping[str, Any], weights: str) -> pd.DataFrame:
    """Evaluate the result on every held-out map, print the tables, and return the records.

    values: those found, by dotted config key. weights: the name that the records have as `weights`. Every map has its
    own directory below that of the training.
    """
    from runners.analysis.summary import summarise
    from runners.analysis.tables import print_table, write_tables
    from runners.records.records import read_episodes

    places = job.config.held_out or {job.choices["map"]: job.config.map}
    for place, node in places.items():
        _evaluate_on(place, _evaluation(job, values, place, node, weights), values)
    frame = read_episodes([job.run_dir / place for place in places])
    rows = summarise(frame, systems=systems(job.folders), labels=ablations.labels(job.folders))
    write_tables(frame, rows, job.run_dir)
    print_table(frame, rows)
    print(f"Weights, pictures, records and tables: {job.run_dir}")
    return frame


def _evaluation(
    job: Job[HeldOutConfig], values: Mapping[str, Any], place: str, node: dict[str, Any], weights: str
) -> Job[EvalConfig]:
    """The job that evaluates the result on one map."""
    trained = with_values(job.config, values)
    names = {field.name for field in fields(EvalConfig)} & {field.name for field in fields(job.config)}
    shared = {each: getattr(trained, each) for each in names}
    config = EvalConfig(**{**shared, "map": node, "weights": weights, "resume": False})
    return Job(
        config=config,
        choices={**job.choices, "map": job.choices.get(f"map@{HELD_OUT}{place}", place)},
        overrides=job.overrides,
        changes=_changes(job, place) | _settings(values),
        folders=job.folders,
        run_dir=job.run_dir / place,
    )


def _changes(job: Job[HeldOutConfig], place: str) -> dict[str, Any]:
    """The changed keys of the evaluation on one map: those of the training map say nothing about a held-out one."""
    if not job.config.held_out:
        return dict(job.changes)
    of_map = f"{HELD_OUT}{place}."
    return {
        key.replace(of_map, "map.", 1): value
        for key, value in job.changes.items()
        if key.startswith(of_map) or not key.startswith((HELD_OUT, "map."))
    }


def _evaluate_on(place: str, job: Job[EvalConfig], values: Mapping[str, Any]) -> None:
    config, maps = job.config, build.map_set(job.config)
    print(f"Now {len(maps.numbers)} worlds of {place} that training never saw, {config.runs} runs each")
    job.run_dir.mkdir(exist_ok=True)
    launch_of("eval", [job], [], False, None).write(job.run_dir)
    labels = replace(run_labels(job, maps), map=place)
    if _settings(values):  # its planner is no longer that of the named pair
        labels = replace(labels, system=f"{labels.guide}+{labels.planner}")
    drive(config, labels, maps, job.run_dir)
    pages.make_requested_pages(config.explain, job.run_dir, instantiate.build(config.executor, "executor"))
    report(maps, job)


def _settings(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values found for keys that are not parameters of the guide."""
    return {key: value for key, value in values.items() if not key.startswith(PARAMETERS)}
