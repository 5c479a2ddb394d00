"""Curves over factors, from records made by hand."""

import csv

import numpy as np
import pandas as pd
import pytest

from runners.config import schema
from runners.config.composer import Composer
from runners.records.launch_record import Launch
from runners.reports.analysis import sensitivity
from runners.reports.analysis.sensitivity import SensitivityStudy
from runners.reports.analysis.study import write
from tests.conf.test_conf import PARAMETERS
from tests.runners.reports.analysis.test_paired import episodes

RATES = {
    "": 0.9,
    "d2 × 0": 0.88,
    "d2 × 2": 0.9,
    "a_close × 0": 0.2,
    "a_close × 0.25": 0.8,
    "a_close × 4": 0.9,
}
VALUES = {"a_close": 1.51, "d2": 200}


def sweep(rates, worlds=100, **columns):
    """The easiest share of the worlds succeeds."""
    about = {"robot": "jackal", "map": "barn", "subset": "fresh", **columns}
    parts = []
    for name, rate in rates.items():
        parts.append(episodes(np.arange(worlds) < rate * worlds, scale=name, run_dir=name or "0", **about))
    return pd.concat(parts, ignore_index=True)


@pytest.fixture(autouse=True)
def launched(monkeypatch):
    """The launch records of the runs, which hold the parameters."""
    config = {"guide": {"parameters": VALUES}}
    monkeypatch.setattr(sensitivity, "read_launch", lambda run_dir: Launch("eval", "0", False, [], [config]))


def curves(rates=RATES):
    (study,) = SensitivityStudy.studies(sweep(rates))
    return {curve.parameter: curve for curve in study.curves}


def test_the_experiment_is_each_parameter_alone_in_worlds_made_for_it():
    schema.register()
    with Composer("eval") as composer:
        config = composer.compose(["experiment=sensitivity"])
        params = dict(config.hydra.sweeper.params)
        systems, (key, values), *others = params.pop("system"), *params.items()
        scales = list(composer.parse([f"{key}={values}"])[0].sweep_iterator())
    assert systems == "lme,lme_printed"
    assert (key, others, config.hydra.mode.name) == ("++scale", [], "MULTIRUN")
    assert scales[0] == {}
    assert all(len(scale) == 1 for scale in scales[1:])
    pairs = {(name, factor) for scale in scales for name, factor in scale.items()}
    assert pairs == {(name, factor) for name in PARAMETERS for factor in (0.0, 0.25, 0.5, 2.0, 4.0)}
    assert len(scales) == 41
    assert (config.map.subset, config.map.worlds, config.runs) == ("fresh", None, 1)


def test_factors_rise_and_one_is_shared():
    found = curves()
    assert list(found) == ["d2", "a_close"]
    assert [point.factor for point in found["a_close"].points] == [0.0, 0.25, 1.0, 4.0]
    assert [point.success for point in found["a_close"].points] == [0.2, 0.8, 0.9, 0.9]
    assert found["a_close"].points[2].row == found["d2"].points[1].row
    assert (found["a_close"].value, found["d2"].value) == ("1.51", "200")


def test_factors_beyond_the_noise_come_first(says):
    found = curves()
    assert found["a_close"].range == pytest.approx(0.7)
    assert [point.factor for point in found["a_close"].beyond("success")] == [0.0, 0.25]
    assert found["d2"].beyond("success") == []
    lines = SensitivityStudy.studies(sweep(RATES))[0].sentences()
    assert [line.split()[0] for line in lines] == ["LME,", "a_close", "d2"]
    says(lines[1])
    says(lines[2])


def test_several_factors_at_once_belong_to_no_curve():
    found = curves({**RATES, "a_close × 0.5, d2 × 2": 0.1})
    assert [point.factor for point in found["a_close"].points] == [0.0, 0.25, 1.0, 4.0]
    assert found["d2"].range == pytest.approx(0.02)


def test_without_the_unchanged_run_there_is_no_study():
    assert SensitivityStudy.studies(sweep({"d2 × 2": 0.9, "d2 × 4": 0.8})) == []
    assert SensitivityStudy.studies(sweep({"": 0.9})) == []
    assert SensitivityStudy.studies(sweep({"": 0.9, "d2 × 2, a_close × 2": 0.9})) == []
    assert SensitivityStudy.studies(sweep(RATES).drop(columns="scale")) == []


def test_every_place_has_its_own_curves():
    frame = pd.concat(
        [sweep({"": 0.9, "d2 × 2": 0.8}), sweep({"": 0.7, "d2 × 2": 0.6}, map="traps").assign(run_dir="x")]
    )
    found = SensitivityStudy.studies(frame)
    assert [study.setting.place[0] for study in found] == ["barn", "traps"]
    assert [study.curves[0].points[0].success for study in found] == [0.9, 0.7]


def test_the_files_of_a_sensitivity_are_written(tmp_path):
    markdown, table, *_ = write(SensitivityStudy.studies(sweep(RATES)), tmp_path)
    text = markdown.read_text(encoding="utf-8")
    assert (
        "| a_close | 1.51 | **0.200** (\u22120.700) | **0.800** (\u22120.100) | 0.900 | – | 0.900 |" in text
    )
    assert "| d2 | 200 | 0.880 | – | 0.900 | 0.900 | – |" in text
    lines = list(csv.DictReader(table.open(encoding="utf-8")))
    assert [(line["parameter"], float(line["factor"])) for line in lines] == [
        ("d2", 0), ("d2", 1), ("d2", 2), ("a_close", 0), ("a_close", 0.25), ("a_close", 1), ("a_close", 4),
    ]  # fmt: skip
    assert float(lines[3]["success_difference"]) == pytest.approx(-0.7)
    assert (lines[3]["success_beyond_noise"], lines[1]["success_difference"]) == ("True", "")
