"""The words that drive what was trained: all that chose robot, system and simulator, and none of the trained values."""

import pytest

from runners.records.weight_file import driven
from tests.composing import jobs_of

D1 = ["guide.parameters.d1"]


@pytest.mark.parametrize(
    ("command", "words", "values", "driving"),
    [
        ("train", "", D1, "robot=stage sim=fast"),
        ("train", "robot=go2 robot.v_max=0.4 seed=3 runs=1", D1, "robot=go2 robot.v_max=0.4 sim=fast"),
        (
            "train",
            "guide.history_length=5 guide.blocking=corridor",
            ["guide.history_length"],
            "guide.blocking=corridor robot=stage sim=fast guide=lme planner=simple",
        ),
        ("train", "guide.parameters={d1:0.3}", D1, "robot=stage sim=fast"),
        ("train", "filter=stopping sim=skid", D1, "filter=stopping sim=skid robot=stage"),
        (
            "train",
            "cap.v_max=1 feedback=CLOSED_LOOP",
            D1,
            "cap.v_max=1 feedback=CLOSED_LOOP robot=stage sim=fast",
        ),
        ("train", "robot=jackal map=barn", D1, "robot=jackal sim=fast"),
        ("train", "planner=dwa", [*D1, "planner.predict_time"], "planner=dwa robot=stage sim=fast guide=lme"),
        ("train", "system=lme_plus", [*D1, "guide.margin"], "system=lme_plus robot=stage sim=fast"),
        ("learn", "", ["planner.weights"], "guide=target planner=dclp sim=fast"),
        (
            "learn",
            "robot=stage start=dclp validation=9",
            ["planner.weights"],
            "robot=stage guide=target planner=dclp sim=fast",
        ),
        (
            "learn",
            "robot.v_max=0.4 guide=lme guide.parameters={d1:0.3} planner.weights=dclp",
            ["planner.weights"],
            "robot.v_max=0.4 guide=lme guide.parameters={d1:0.3} planner=dclp sim=fast",
        ),
        ("learn", "system=learned_subgoal", ["guide.weights"], "system=learned_subgoal sim=fast"),
    ],
)
def test_what_drives_is_repeated_without_what_was_trained(command, words, values, driving):
    with jobs_of(command) as job_of:
        assert driven(job_of(*words.split()), values) == driving.split()
