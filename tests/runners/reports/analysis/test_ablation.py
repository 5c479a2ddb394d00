"""What the paper says of its ablations, against records made to agree with it and not to."""

import csv

import numpy as np
import pandas as pd
import pytest

from lme.metrics import wilson_interval
from runners.config import schema
from runners.config.catalogue import shipped
from runners.config.command_line import plan
from runners.config.composer import Composer
from runners.reports.analysis import ablation_claims
from runners.reports.analysis.ablation import AblationStudy
from runners.reports.analysis.study import to_markdown, write
from tests.runners.reports.analysis.test_paired import episodes

AS_THE_PAPER_SAYS = {
    "none": 0.9, "no_a_close": 0.75, "no_a_dev": 0.9, "no_c_o": 0.1, "no_c_t": 0.6, "no_a_mount": 0.6,
    "no_c_h": 0.75, "no_maintenance": 0.7,
}  # fmt: skip


def sweep(rates, runs=2, worlds=100, **columns):
    """The easiest share of the worlds succeeds in every run."""
    about = {"robot": "jackal", "map": "barn", "subset": "lab100", **columns}
    parts = [
        episodes(np.arange(worlds) < rate * worlds, runs, ablation=name, run_dir=name, **about)
        for name, rate in rates.items()
    ]
    return pd.concat(parts, ignore_index=True)


def agreement(rates, **columns):
    """By ablation, where the paper says something."""
    (study,) = AblationStudy.studies(sweep(rates, **columns))
    return {variant.ablation: variant.agrees for variant in study.variants if variant.agrees}


def test_every_claim_has_an_ablation_file_and_every_file_a_claim():
    titles = shipped().titles("ablation")
    of_lme_plus = {
        name for name, title in titles.items() if title.startswith("LME+ ")
    }  # the paper has no such part
    assert titles.keys() - {"none"} - of_lme_plus == set(ablation_claims.CLAIMS)


def test_the_experiment_is_the_figures():
    schema.register()
    with Composer("eval") as composer:
        found = plan(composer, ["experiment=ablation"], multirun=False)
    assert found.multirun
    chosen = [job.hydra.runtime.choices for job in found.configs.values()]
    variants = ["none", *ablation_claims.CLAIMS]
    expected = [("lme_as_run", variant) for variant in variants]
    assert [(choices.system, choices.ablation) for choices in chosen] == expected
    assert {(job.map.subset, job.runs, job.robot.name) for job in found.configs.values()} == {
        ("lab100", 3, "jackal")
    }


def test_records_that_are_as_the_paper_says_agree_with_it():
    assert agreement(AS_THE_PAPER_SAYS) == dict.fromkeys(ablation_claims.CLAIMS, "yes")


@pytest.mark.parametrize(
    ("name", "rate", "agrees"),
    [
        ("no_c_t", 1.0, "no"),
        ("no_c_h", 0.89, "no"),
        ("no_a_dev", 0.7, "no"),
        ("no_a_dev", 1.0, "no"),
        ("no_a_close", 0.3, "in part"),
        ("no_maintenance", 0.9, "no"),
        ("no_c_o", 0.9, "no"),
        ("no_c_o", 0.5, "yes"),
    ],
)
def test_records_that_differ_from_what_the_paper_says_do_not_agree(name, rate, agrees, says):
    (study,) = AblationStudy.studies(sweep({**AS_THE_PAPER_SAYS, name: rate}))
    variant = next(each for each in study.variants if each.ablation == name)
    assert variant.agrees == agrees
    says(variant.words)


def test_almost_no_effect_is_not_none_where_there_are_worlds_enough_to_tell(says):
    (study,) = AblationStudy.studies(sweep({"none": 0.9, "no_a_dev": 0.885}, worlds=600, runs=1))
    variant = study.variants[1]
    assert variant.change["success"].beyond_noise
    assert variant.agrees == "yes"
    says(variant.words)


@pytest.mark.parametrize(
    ("name", "maps", "runs", "robot"),
    [("ablation_fresh", None, 1, "jackal"), ("ablation_stage", "env1,env2", 3, "stage")],
)
def test_the_figures_variants_elsewhere(name, maps, runs, robot):
    schema.register()
    with Composer("eval") as composer:
        config = composer.compose([f"experiment={name}"])
    params = config.hydra.sweeper.params
    assert params.ablation.split(",") == ["none", *ablation_claims.CLAIMS]
    assert (params.get("map"), config.runs, config.robot.name) == (maps, runs, robot)
    if maps is None:
        assert (config.map.subset, config.map.count) == ("fresh_hard", 300)


def test_the_most_significant_is_not_so_where_another_loses_more():
    found = agreement({**AS_THE_PAPER_SAYS, "no_c_o": 0.4, "no_maintenance": 0.1})
    assert (found["no_c_o"], found["no_maintenance"]) == ("in part", "yes")


@pytest.mark.parametrize(
    "columns", [{"map": "env1"}, {"robot": "go2"}, {"system": "LME-DWA"}, {"scale": "c_t × 2"}]
)
def test_the_paper_speaks_of_its_own_method_on_barn_alone(columns):
    frame = sweep(AS_THE_PAPER_SAYS).assign(**columns)
    (study,) = AblationStudy.studies(frame)
    assert [variant.agrees for variant in study.variants] == [""] * 8
    assert study.sentences() == []
    assert "the LME paper" not in to_markdown([study])


def test_a_factor_tells_studies_apart():
    rates = {"none": 0.9, "no_c_o": 0.1}
    scaled = sweep(rates, scale="a_close × 0.5").assign(run_dir=lambda frame: frame["run_dir"] + " scaled")
    found = AblationStudy.studies(pd.concat([sweep(rates, scale=""), scaled]))
    assert [study.heading for study in found] == ["LME", "LME, scale a_close × 0.5"]
    assert [study.variants[1].agrees for study in found] == ["yes", ""]


def test_a_part_of_the_sweep_is_enough():
    frame = sweep({"no_c_o": 0.1, "none": 0.9})
    part = frame[(frame["ablation"] == "none") | (frame["world"] < 20)]
    (study,) = AblationStudy.studies(part)
    assert [variant.ablation for variant in study.variants] == ["none", "no_c_o"]
    assert study.variants[1].change["success"].pairs == 40
    assert AblationStudy.studies(sweep({"no_c_o": 0.1, "no_c_t": 0.9})) == []
    assert AblationStudy.studies(sweep({"none": 0.9})) == []


def test_too_few_worlds_leave_the_claim_open(says):
    """Two worlds prove nothing; nor do forty whose interval has room for a noticeable loss."""
    (few,) = AblationStudy.studies(sweep(AS_THE_PAPER_SAYS, worlds=2))
    assert {variant.agrees for variant in few.variants[1:]} == {"open"}
    noisy = sweep({"none": 0.9}, worlds=40, runs=1)
    flipped = noisy.assign(ablation="no_c_t", run_dir="x", outcome="success")
    flipped.loc[noisy.index[:5], "outcome"] = "collision"
    (study,) = AblationStudy.studies(pd.concat([noisy, flipped]))
    change = study.variants[1].change["success"]
    assert change.low < -ablation_claims.MARGIN < 0 < change.high
    says(study.variants[1].words)


def test_an_ablation_in_one_world_has_no_interval_and_says_so(says):
    (study,) = AblationStudy.studies(sweep({"none": 0.9, "no_c_o": 0.1}, worlds=1))
    assert "| 0.000 | – | – | – |" in to_markdown([study])
    says(study.variants[1].words)
    assert study.setting.size.endswith("1 world × 2 runs")


def test_where_nothing_succeeds_there_is_nothing_to_lose():
    (study,) = AblationStudy.studies(sweep({"none": 0.0, "no_c_o": 0.0}))
    assert [variant.agrees for variant in study.variants] == ["", ""]


def test_a_variant_that_drove_other_worlds_is_shown_and_not_compared():
    frame = sweep({"none": 0.9, "no_c_o": 0.1, "no_c_t": 0.5})
    (study,) = AblationStudy.studies(frame[(frame["ablation"] == "no_c_o") != (frame["world"] < 50)])
    found = {variant.ablation: (variant.change == {}, variant.agrees) for variant in study.variants}
    assert found == {"none": (True, ""), "no_c_o": (True, ""), "no_c_t": (False, "no")}


def test_two_ablations_at_once_are_shown_last_without_a_verdict():
    (study,) = AblationStudy.studies(sweep({"no_c_o+no_c_t": 0.1, "none": 0.9, "no_c_h": 0.8}))
    assert [ablation_claims.variant_label(variant.ablation) for variant in study.variants] == [
        "Complete",
        "No c_h",
        "No c_o, c_t",
    ]
    assert study.variants[-1].agrees == ""
    assert study.variants[-1].change["success"].mean == pytest.approx(-0.8)


def test_the_words_follow_from_the_figures(says):
    lines = AblationStudy.studies(sweep({"none": 0.9, "no_c_t": 1.0}))[0].sentences()
    says(lines[0])
    says(lines[1])
    assert len(lines) == 2


def test_the_files_of_an_ablation_are_written(tmp_path):
    markdown, table, *_ = write(AblationStudy.studies(sweep(AS_THE_PAPER_SAYS)), tmp_path)
    text = markdown.read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line[:1] == "|"]
    assert len({len(row) for row in rows}) == 1
    assert dict(zip(rows[0][:6], rows[5][:6], strict=True)) == {
        "Variant": "No c_o", "Success": "0.100 ± 0.000", "Difference": "**\u22120.800**",
        "95 %": rows[5][3], "p (Holm)": "< 0.001", "Beyond the noise": "yes",
    }  # fmt: skip
    assert "not Gazebo" in text
    lines = list(csv.DictReader(table.open(encoding="utf-8")))
    assert [line["ablation"] for line in lines] == ["none", *ablation_claims.CLAIMS]
    assert float(lines[3]["success_difference"]) == pytest.approx(-0.8)
    assert float(lines[3]["success_low"]) == pytest.approx(wilson_interval(10, 100)[0])
    assert float(lines[3]["success_difference_low"]) < -0.8 < float(lines[3]["success_difference_high"])
    assert (lines[0]["success_difference"], lines[3]["agrees"]) == ("", "yes")


def test_the_order_of_records_does_not_matter():
    frame = sweep(AS_THE_PAPER_SAYS)
    shuffled = frame.sample(frac=1.0, random_state=2)
    assert to_markdown(AblationStudy.studies(shuffled)) == to_markdown(AblationStudy.studies(frame))
