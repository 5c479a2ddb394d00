"""Which weight set a job drives with, in its records and its launch record."""

from pathlib import Path

import pytest

from runners.cli.main import main
from runners.records.launch_record import launch_of, read_launch
from runners.records.records import read_episodes
from runners.reports.analysis.summary import row_keys
from tests.composing import jobs_of


@pytest.mark.parametrize(
    ("words", "used"),
    [
        ([], "published"),
        (["weights=skid"], "skid"),
        (["guide=target"], "published"),
        (["system=lme_plus"], "lme_plus"),
        (["system=lme_plus", "weights=published"], "lme_plus"),
        (["guide=lme_plus", "weights=lme_plus"], "lme_plus"),
        (["system=lme_plus", "guide.parameters={d1: 1.0}"], "published"),  # a changed key says what they are
    ],
)
def test_the_weight_set_that_is_used(words, used):
    with jobs_of("eval") as job:
        assert job(*words).weights == used


def test_resolved_weights_do_not_change_the_fingerprint():
    with jobs_of("eval", "system=lme_plus") as job:
        launch = launch_of("eval", [job()], [], False, None)
    assert launch.weights == ["lme_plus"]
    assert launch.config.scale == {}
    assert launch.configs[0]["weights"] == "published"  # as it was given: earlier runs are resumed by it


def test_records_say_which_set_was_used(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["system=lme_plus", "map.worlds=0", "map.time_limit=0.3", "runs=1"]
    assert main(["eval", *words, "executor=serial", "tracking=none", "hydra.run.dir=run"]) == 0
    assert read_launch(Path("run")).weights == ["lme_plus"]
    frame = read_episodes([Path("run")])
    assert set(frame["weights"]) == {"lme_plus"}
    assert "weights" not in row_keys(frame), "usual, so no column of the table"
