"""The parameters of a tracked run are short where one searches for them, and hold what was chosen for the run alone."""

from dataclasses import asdict, replace

from lme.config.composer import SHIPPED
from runners.records.episode_record import RunLabels
from runners.tracking.tracking import parameters, short_names
from tests.composing import jobs_of

LABELS = RunLabels(
    system="LME", guide="lme", planner="simple", global_map="", ablation="none", weights="published",
    robot="jackal", map="barn", subset="all", people="truth",
)  # fmt: skip


def test_they_are_the_config_and_the_short_names():
    with jobs_of() as job:
        values = parameters(job("robot=jackal", "seed=3", "weights=skid"), replace(LABELS, weights="other"))
    short = {"system": "lme", "robot": "jackal", "map": "barn", "ablation": "none", "weights": "skid"}
    assert {**short, "robot.name": "jackal", "seed": 3}.items() <= values.items()


def test_the_system_is_the_option_that_was_chosen_or_has_the_pair():
    assert short_names(asdict(LABELS), SHIPPED, "lme_as_run")["system"] == "lme_as_run"
    assert short_names(asdict(LABELS), SHIPPED, "dwa")["system"] == "lme"  # dwa has another pair
    unnamed = asdict(replace(LABELS, system="lme+Mine", planner="Mine"))
    assert short_names(unnamed, SHIPPED)["system"] == "lme+Mine"
