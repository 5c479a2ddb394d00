"""What `lme eval` refuses before anything runs."""

import pytest

from runners.cli.main import main


@pytest.mark.parametrize(
    "word",
    [
        "record=mcap",
        "robot=go2",
        "robot.v_max=1",
        "sim.slip=0.3",
        "planner.latency=0",
        "crowd=orca",
        "ablation=no_latency",
    ],
)
def test_a_map_that_draws_the_robot_refuses(tmp_path, monkeypatch, capsys, word, says):
    monkeypatch.chdir(tmp_path)
    words = [
        "experiment=cold_trial",
        "map.subset=static",
        "map.trial_seed=7",
        "map.count=1",
        "system=lme_plus",
    ]
    assert main(["eval", *words, "tracking=none", word]) == 2
    says(capsys.readouterr().err)
    assert not list(tmp_path.rglob("*.parquet"))
