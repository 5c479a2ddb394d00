"""Comparisons of systems against differences by hand."""

import csv

import pandas as pd
import pytest

from runners.reports.analysis.comparison import Comparison
from runners.reports.analysis.study import write
from runners.reports.analysis.summary import DASH
from tests.runners.reports.analysis.test_paired import draws, episodes

SMOOTHNESS = "mean_abs_domega_radps"


def frame(*parts):
    return pd.concat(parts, ignore_index=True)


LME = episodes([1, 1, 1, 0], runs=2, system="LME", mean_abs_domega_radps=0.25)
OTHER = episodes([1, 0, 0, 1], runs=2, system="Other", mean_abs_domega_radps=0.5)


def test_differences_and_intervals_by_hand():
    (study,) = Comparison.studies(frame(OTHER, LME))
    assert (study.reference, list(study.rows), list(study.changes)) == ("LME", ["LME", "Other"], ["Other"])
    change = study.changes["Other"]
    assert change["success"].mean == pytest.approx(-0.25)
    assert change["barn_metric"].mean == pytest.approx(-0.1)
    assert change[SMOOTHNESS].mean == pytest.approx(0.25)
    assert (change["success"].worlds, change["success"].pairs) == (4, 8)


def test_without_lme_the_system_driven_first_is_the_reference():
    (study,) = Comparison.studies(frame(OTHER, LME.assign(system="Third")))
    assert (study.reference, list(study.changes)) == ("Other", ["Third"])


def test_several_settings_have_a_latex_table_each(tmp_path):
    parts = [part.assign(**{"sim.latency": value}) for part in (LME, OTHER) for value in ("0", "0.1")]
    _, _, latex, *_ = write(Comparison.studies(frame(*parts)), tmp_path)
    text = latex.read_text(encoding="utf-8")
    assert text.count(r"\begin{table*}") == 2
    assert r"\label{tab:comparison-1}" in text
    assert r"\label{tab:comparison-2}" in text


def test_one_system_is_not_compared():
    assert Comparison.studies(frame(LME, LME.assign(ablation="no_c_o"))) == []


def test_rows_are_compared_in_their_own_setting():
    """What varies within the reference is a setting; what only another system has names its row."""
    values = ("0", "0.1")
    both = [part.assign(**{"sim.latency": value}) for part in (LME, OTHER) for value in values]
    tuned = both[2].assign(**{"planner.samples": "5"})
    studies = Comparison.studies(frame(*both, tuned))
    assert [str(study.setting).split(" · ")[0] for study in studies] == ["sim.latency=0", "sim.latency=0.1"]
    assert [list(study.changes) for study in studies] == [["Other", "Other, planner.samples 5"], ["Other"]]
    seeds = Comparison.studies(frame(LME.assign(seed=0), OTHER.assign(seed=0), OTHER.assign(seed=1)))
    assert [str(study.setting).split(" · ")[0] for study in seeds] == ["seed 0"]


def test_other_weights_make_a_row_of_their_own():
    """A row is named after what is unusual in it."""
    own = OTHER.assign(weights="mine")
    (study,) = Comparison.studies(frame(LME.assign(weights="published"), own))
    assert list(study.rows) == ["LME", "Other, weights mine"]


def test_systems_trained_with_several_seeds_are_compared_seed_by_seed():
    trained = [
        records.assign(seed=seed, weights=f"{name}-{seed}")
        for seed in (0, 1)
        for name, records in (("lme", LME), ("other", OTHER))
    ]
    studies = Comparison.studies(frame(*trained))
    by_seed = [("seed 0", ["LME", "Other"]), ("seed 1", ["LME", "Other"])]
    assert [(str(study.setting).split(" · ")[0], list(study.rows)) for study in studies] == by_seed
    kept_start = [part.assign(weights="mine") if "Other" in set(part["system"]) else part for part in trained]
    studies = Comparison.studies(frame(*kept_start))
    assert [(str(study.setting).split(" · ")[0], list(study.rows)) for study in studies] == by_seed


def test_weights_that_one_seed_has_twice_stay_apart():
    twice = [LME.assign(seed=seed, weights=name) for seed in (0, 1) for name in ("a", "b")]
    studies = Comparison.studies(frame(*twice, OTHER.assign(seed=0, weights="a")))
    assert [list(study.rows) for study in studies] == [["LME", "Other"]]


def both_with(column, values):
    """Parts of two systems that were driven with each value of a column, each in a folder of its own."""
    return [
        part.assign(**{column: value, "run_dir": f"{system}{value}"})
        for system, part in (("LME", LME), ("Other", OTHER))
        for value in values
    ]


def test_whom_the_systems_see_is_a_setting_and_not_the_folder():
    parts = both_with("people", ("truth", "none"))
    studies = Comparison.studies(frame(*parts))
    assert [str(study.setting).split(" · ")[0] for study in studies] == ["people truth", "people none"]
    assert [list(study.changes) for study in studies] == [["Other"], ["Other"]]
    (study,) = Comparison.studies(frame(parts[0], parts[3]))
    assert list(study.rows) == ["LME", "Other, people none"]


def test_a_changed_key_without_a_dot_is_a_setting_and_not_the_folder():
    studies = Comparison.studies(frame(*both_with("feedback", ("OPEN_LOOP", "CLOSED_LOOP"))))
    assert [study.setting.changes for study in studies] == [
        ("feedback=OPEN_LOOP",),
        ("feedback=CLOSED_LOOP",),
    ]
    assert [list(study.changes) for study in studies] == [["Other"], ["Other"]]


def test_the_setting_is_what_all_rows_have_in_common():
    values = ((LME, "0.3"), (OTHER, "0"))
    parts = [part.assign(**{"map.count": "4", "planner.back": value}) for part, value in values]
    (study,) = Comparison.studies(frame(*parts))
    assert str(study.setting) == "map.count=4 · 4 worlds × 2 runs"


def test_rows_without_a_common_episode_say_so():
    apart = episodes(draws(0.4), system="Other").assign(world=lambda rows: rows["world"] + 1000)
    (study,) = Comparison.studies(frame(episodes(draws(0.9), system="LME"), apart))
    assert study.sentences()[1:] == ["Other: no episode in common."]


def test_files_and_words(tmp_path, says):
    lme = episodes(draws(0.9), runs=2, system="LME", mean_abs_domega_radps=0.25)
    worse = episodes(draws(0.4), runs=2, system="Worse").drop(columns="barn_metric")
    found = Comparison.studies(frame(lme, worse))
    markdown, table, latex, *_ = write(found, tmp_path)
    header, _, line = (row.split(" | ") for row in markdown.read_text("utf-8").splitlines()[2:5])
    cells = dict(zip(header, line, strict=True))
    assert cells["Success"].startswith("**\u2212")
    assert cells["BARN metric"] == cells[r"\|Δω\| [rad/s]"] == DASH
    _, row = csv.DictReader(table.open(encoding="utf-8"))
    assert (row["row"], row["reference"], row["success_beyond_noise"]) == ("Worse", "LME", "True")
    text = latex.read_text(encoding="utf-8")
    assert r"Worse & \textbf{$-$0." in text
    assert (
        r"\caption{Differences from LME: 60 worlds $\times$ 2 runs, seed not recorded; version not recorded. "
        in text
    )
    assert r"\label{tab:comparison}" in text
    heading, sentence = found[0].sentences()
    says(heading)
    assert sentence.startswith("Worse: Success \u2212")
    assert sentence.endswith(", beyond the noise.")
