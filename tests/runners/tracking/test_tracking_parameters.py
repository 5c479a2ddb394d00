"""The parameters of a tracked run are short where one searches for them, and hold what was chosen for the run alone."""

from runners.records.episode_record import RunLabels
from runners.tracking.tracking import parameters

LABELS = RunLabels(
    system="LME", guide="lme", planner="simple", global_map="", ablation="none", weights="published",
    robot="jackal", map="barn", subset="all", people="truth",
)  # fmt: skip


def test_they_are_the_config_and_the_labels():
    config = {
        "system": {"label": "LME"},
        "robot": {"name": "jackal"},
        "ablation": {},
    }
    found = parameters(config, LABELS)
    assert found == {
        "system.label": "LME", "robot.name": "jackal",
        "system": "LME", "robot": "jackal", "map": "barn", "ablation": "none",
    }  # fmt: skip
