"""A weight set and an ablation of parameters that are typed must be used by some job, and the set must exist."""

import pytest

from lme.errors import InputError
from runners.config import command_line
from runners.config.command_line import compose, compose_job
from runners.config.composer import Composer

pytestmark = pytest.mark.usefixtures("no_own_weights")

NOTHING = "nothing here drives with this weight set; omit it, or choose a guide such as guide=lme"


def said(*words, command="eval"):
    with pytest.raises(InputError) as caught:
        compose(command, words)
    return str(caught.value)


@pytest.fixture
def checked_in_part(monkeypatch):
    """Sweeps of more than four jobs count as large, of which not every job is checked."""
    monkeypatch.setattr(command_line, "MAX_JOBS_CHECKED", 4)


@pytest.mark.parametrize(
    "words",
    [
        ["system=dwa_tuned", "weights=/tmp/nope.yaml"],
        ["-m", "system=dwa_tuned", "weights=published,skid"],
        ["system=drl_dclp", "weights=skid"],
        ["guide.parameters={d1: 1.0}", "+weights=skid"],
        ["system=lme_plus", "weights=published"],
        ["-m", "system=lme_plus,dwa", "weights=published"],
        ["-m", "system=lme,dwa_tuned", "weights=skid,nope"],
        ["experiment=table2_ideal", "weights=nope"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_a_typed_set_that_no_job_uses(words, says):
    says(said(*words))


def test_a_typed_system_that_an_experiment_replaces(says):
    says(said("experiment=train/tune", "system=lme_plus", command="train"))


@pytest.mark.parametrize("words", [["guide=lme_plus", "planner=min_time"], ["guide=lme_plus"]], ids=" ".join)
def test_a_typed_pair_beats_an_experiment(words):
    (job,) = compose("train", ["experiment=train/tune", "system=lme_plus", *words])
    assert (job.choices["guide"], job.choices["planner"]) == ("lme_plus", "min_time")


@pytest.mark.parametrize(
    "words",
    [
        ["-m", "system=dwa_tuned,eband", "weights=skid", "seed=range(3)"],
        # Not every job is composed: only dwa_tuned has met the second set here.
        ["-m", "system=dwa_tuned,lme", "weights=skid,nope", "seed=range(3)"],
    ],
    ids=" ".join,
)
def test_a_typed_set_that_no_job_of_a_large_sweep_uses(words, checked_in_part, says):
    says(said(*words))


@pytest.mark.parametrize("words", [["weights=lme_plus"], ["system=lme_plus", "weights=skid"]], ids=" ".join)
def test_a_set_of_another_guide(words, says):
    says(said(*words))


def test_of_a_training_too():
    assert NOTHING in said("guide=target", "planner=dwa", "weights=skid", command="train")


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("eval", ["weights=skid"]),
        ("eval", ["system=lme_skid", "weights=published"]),
        ("eval", ["system=lme_plus", "weights=lme_plus"]),
        ("eval", ["-m", "system=lme,dwa_tuned", "weights=skid"]),
        ("eval", ["-m", "system=lme,lme_plus", "weights=published"]),
        ("eval", ["experiment=table2_ideal", "weights=skid"]),
        ("eval", ["experiment=lme_plus_skid", "hydra.mode=RUN", "system=lme_skid"]),
        ("train", ["weights=skid"]),
        ("learn", ["weights=skid", "guides={target: 0.6, lme: 0.4}"]),
        ("learn", ["weights=skid", "learner.expert.guide=lme"]),
    ],
)
def test_a_set_that_some_job_uses(command, words):
    assert compose(command, words)


def test_a_set_that_some_job_of_a_large_sweep_uses(checked_in_part):
    assert compose("eval", ["-m", "system=dwa_tuned,lme", "weights=published,skid", "seed=range(3)"])


def test_a_guide_of_ones_own_may_take_the_set(tmp_path):
    (tmp_path / "guide").mkdir()
    (tmp_path / "guide" / "mine.yaml").write_text("# Mine\n_target_: my.Guide\nset: ${weights}\n")
    (job,) = compose("eval", ["--config-dir", str(tmp_path), "guide=mine", "weights=skid"])
    assert job.config.guide["set"] == "skid"


def test_files_and_resumed_runs_may_name_one_that_is_not_used(tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text("# @package _global_\n# Mine\nweights: skid\n")
    (job,) = compose("eval", ["--config-dir", str(tmp_path), "experiment=mine", "system=dwa"])
    assert job.config.weights == "skid"
    with Composer("eval") as composer:
        assert compose_job(composer, ["system=dwa", "weights=skid"]).config.weights == "skid"


@pytest.mark.parametrize(
    "words",
    [
        ["system=dwa_tuned", "ablation=no_c_h"],
        ["system=dwa_tuned", "ablation=[no_c_h,no_c_t]"],
        ["system=dwa_tuned", "+ablation.c_t=100"],
        ["guide.parameters={d1: 1.0}", "ablation=no_c_h"],
        ["-m", "system=dwa_tuned,eband", "ablation=none,no_c_h"],
        ["experiment=ablation", "system=dwa_tuned"],
    ],
    ids=" ".join,
)
def test_an_ablation_of_parameters_that_no_guide_has(words, says):
    says(said(*words))


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("eval", ["ablation=no_c_h"]),
        ("eval", ["+ablation.c_t=100"]),
        ("eval", ["system=dwa_tuned", "ablation=none"]),
        ("eval", ["system=dwa_tuned", "planner=min_time", "ablation=no_grip"]),  # no parameter of a guide
        ("eval", ["-m", "system=dwa_tuned,lme", "ablation=none,no_c_h"]),
        ("train", ["ablation=no_c_h"]),
        ("learn", ["ablation=no_c_h", "guides={target: 0.6, lme: 0.4}"]),
    ],
)
def test_an_ablation_that_some_job_uses(command, words):
    assert compose(command, words)


def test_an_ablation_that_some_job_of_a_large_sweep_uses(checked_in_part):
    assert compose("eval", ["-m", "system=dwa_tuned,lme", "ablation=no_c_h,none", "seed=range(3)"])
