"""Curves over the values of changed keys, from records made by hand."""

import csv

import numpy as np
import pandas as pd
import pytest

from runners.reports.analysis.curves import CurveStudy
from runners.reports.analysis.study import write
from tests.runners.reports.analysis.test_paired import episodes

LATENCY, SPEED = "sim.latency", "robot.v_max"


def job(rate, latency="0", speed="2", system="LME", worlds=20, **columns):
    """The records of one job of a sweep, as they are read: every changed key is a column in all of them."""
    changed = {LATENCY: (latency, "0"), SPEED: (speed, "2")}
    return episodes(
        np.arange(worlds) < rate * worlds,
        system=system,
        robot="jackal",
        map="barn",
        subset="fresh",
        run_dir=f"{system}-{latency}-{speed}",
        changes=", ".join(f"{key}={value}" for key, (value, own) in changed.items() if value != own),
        **{LATENCY: latency, SPEED: speed},
        **columns,
    )


def sweep(*jobs):
    return pd.concat(jobs, ignore_index=True)


BY_LATENCY = (job(0.9), job(0.5, latency="0.1"), job(0.8, latency="0.05"))
BY_SPEED = (job(0.9), job(1.0, speed="1"), job(0.95, speed="1.5"))


def shown(study):
    return {
        curve.label: [(value, row.stats["success"][0]) for value, row in curve.points]
        for curve in study.curves
    }


def test_values_rise_and_the_unchanged_one_is_among_them(says):
    (study,) = CurveStudy.studies(sweep(*BY_LATENCY))
    assert study.key == LATENCY
    assert shown(study) == {"LME": [(0.0, 0.9), (0.05, 0.8), (0.1, 0.5)]}
    says(str(study.setting))


def test_each_system_is_a_curve_and_its_own_ablation_too():
    others = [job(0.1 * k, latency=f"{0.05 * k:g}", system="DWA", ablation="none") for k in (0, 1, 2)]
    ablated = [job(0.2, latency=f"{0.05 * k:g}", ablation="no_c_t") for k in (0, 1, 2)]
    (study,) = CurveStudy.studies(
        sweep(*(part.assign(ablation="none") for part in BY_LATENCY), *others, *ablated)
    )
    assert sorted(shown(study)) == ["DWA, none", "LME, no_c_t", "LME, none"]


def test_two_sweeps_with_the_same_unchanged_run_are_two_studies():
    again = BY_SPEED[0].assign(run_dir="again")
    by_latency, by_speed = CurveStudy.studies(sweep(*BY_LATENCY, again, *BY_SPEED[1:]))
    assert (by_latency.key, by_speed.key) == (LATENCY, SPEED)
    assert shown(by_latency) == {"LME": [(0.0, 0.9), (0.05, 0.8), (0.1, 0.5)]}
    assert shown(by_speed) == {"LME": [(1.0, 1.0), (1.5, 0.95), (2.0, 0.9)]}
    assert {row.episodes for curve in by_speed.curves for _, row in curve.points} == {20}


@pytest.mark.parametrize(
    "jobs",
    [
        BY_LATENCY[:2],
        [job(0.5, latency=text) for text in ("a", "b", "c")],
        [job(0.5, system=name, latency=text) for name, text in (("A", "0"), ("B", "0.1"), ("C", "0.2"))],
    ],
    ids=["two values", "words", "one value a system"],
)
def test_too_few_runs_make_no_curve(jobs):
    assert CurveStudy.studies(sweep(*jobs)) == []


def test_the_files_of_curves_are_written(tmp_path, says):
    found = CurveStudy.studies(sweep(*BY_LATENCY))
    markdown, table, *_ = write(found, tmp_path)
    assert "| LME | 0.900 | 0.800 | 0.500 |" in markdown.read_text(encoding="utf-8")
    lines = list(csv.DictReader(table.open(encoding="utf-8")))
    assert [(line["key"], line["value"], line["success"]) for line in lines] == [
        (LATENCY, "0.0", "0.9"),
        (LATENCY, "0.05", "0.8"),
        (LATENCY, "0.1", "0.5"),
    ]
    says("\n".join(found[0].sentences()))


def test_keys_that_an_experiment_changes_in_every_run_are_as_usual():
    """As in experiment=robustness_latency beside robustness_speed, which both lower the speed."""
    lowered = [job(0.9 - latency, latency=f"{latency:g}", speed="1") for latency in (0.0, 0.1, 0.2)]
    by_speed = [job(0.9 - 0.1 * speed, speed=f"{speed:g}") for speed in (0.5, 1.5)]
    studies = CurveStudy.studies(sweep(*lowered, *by_speed))
    assert {study.key: shown(study)["LME"] for study in studies} == {
        LATENCY: [(0.0, 0.9), (0.1, 0.8), (0.2, 0.7)],
        SPEED: [(0.5, 0.85), (1.0, 0.9), (1.5, 0.75)],
    }
