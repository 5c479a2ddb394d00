"""What `lme eval` refuses before anything runs."""

import pytest

from runners.cli.main import main


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("record=mcap", "record is mcap: must be none where the map draws a robot for every episode"),
        ("robot=go2", "robot is go2: must be left out where the map draws it for every episode (map.ranges)"),
        ("robot.v_max=1", "robot.v_max is 1.0: must be left out"),
        ("sim.slip=0.3", "sim.slip is 0.3: must be left out"),
        ("planner.latency=0", "planner.latency is 0: must be left out"),
        ("crowd=orca", "crowd is orca: must be none"),
        ("ablation=no_latency", "ablation is no_latency: must be another one where the map draws the delay"),
    ],
)
def test_a_map_that_draws_the_robot_refuses(tmp_path, monkeypatch, capsys, word, message):
    monkeypatch.chdir(tmp_path)
    words = [
        "experiment=cold_trial",
        "map.subset=static",
        "map.trial_seed=7",
        "map.count=1",
        "system=lme_plus",
    ]
    assert main(["eval", *words, "tracking=none", word]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert not list(tmp_path.rglob("*.parquet"))
