"""Episodes in a worker: worlds with people have social measures, others have the columns that they had."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lme
from lme.simulation.social import SocialMeasures
from lme.types import Twist
from runners.cli import main
from runners.records.episode_record import COLUMNS
from tests.places import ROOT

pytestmark = pytest.mark.usefixtures("undrawn")

SOCIAL = list(SocialMeasures.__dataclass_fields__)
MEASURED = ["decision_us_p50", "decision_us_p99", "wall_s"]  # times that no two runs have in common
DOORWAY = ["map=social", "map.kind=doorway", "map.worlds=[0,1,2]"]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def driven(*words, **keys):
    return lme.evaluate(*words, **{"runs": 1, "executor": "serial", "progress": False, **keys})


class Backwards:
    """Backs up, whatever is there."""

    @dataclass
    class Config:
        """No settings."""

    def __init__(self, config, robot):
        pass

    def reset(self, rng):
        pass

    def plan(self, observation, guidance):
        return Twist(-0.5, 0.0)


def test_static_worlds_have_no_social_columns():
    names = set(driven("map.worlds=[200]").columns)
    assert not names & set(SOCIAL)
    assert set(COLUMNS) <= names


def test_backing_up_is_counted_and_so_is_a_collision_on_the_way():
    words = (
        "map.worlds=[200,201]",
        "robot=jackal",
        "planner=custom",
        f"planner._target_={__name__}.Backwards",
    )
    frame = driven(*words)
    assert (frame["outcome"] == "collision").all()
    assert (frame["reversals"] == 1).all()
    assert (frame["collision_in_reverse"] == 1).all()
    assert frame["contact_part"].str.startswith("rear").all()
    ahead = driven("map.worlds=[200]")
    assert (ahead["collision_in_reverse"] == 0).all()
    assert (ahead["contact_part"] == "").all()


def test_the_part_of_a_legged_robot_that_touches_is_in_the_record():
    pytest.importorskip("mujoco", reason="sim=mujoco needs MuJoCo")
    backwards = "planner._target_=tests.runners.workers.test_episodes.Backwards"
    frame = driven("robot=go2", "map=real2", "map.worlds=[0]", "sim=mujoco", "guide=target", backwards)
    assert (frame["outcome"] == "collision").all()
    assert frame["contact_part"].isin(["trunk", "thigh", "calf", "foot", "fall"]).all()


def test_worlds_with_people_have_them():
    frame = driven("map.worlds=[200,201]", "crowd=orca", "crowd.density=0.2")
    assert set(SOCIAL) <= set(frame.columns)
    assert (frame["minimum_distance_to_people_m"] >= 0.0).all()
    collided = frame["robot_on_person_collision"] + frame["person_on_robot_collision"]
    assert (collided <= (frame["outcome"] == "collision")).all()
    assert (frame["world_people"] > 1).all()


def test_the_time_alone_is_that_of_the_same_episode_without_people():
    frame = driven("map.worlds=[200,201]", "crowd=orca").set_index("world")
    alone = driven("map.worlds=[200,201]").set_index("world")
    both = (frame["outcome"] == "success") & (alone["outcome"] == "success")
    assert both.any()
    expected = (frame["time_s"] / alone["time_s"])[both]
    assert frame["time_against_alone"][both].to_numpy() == pytest.approx(expected.to_numpy(), rel=1e-12)
    assert frame["time_against_alone"][~both].isna().all()


def test_dynabarn_counts_its_cylinders_as_people():
    frame = driven("map=dynabarn", "map.worlds=[0]")
    assert np.isfinite(frame["minimum_distance_to_people_m"]).all()


@pytest.mark.parametrize("motion", ["orca", "social_force"])
def test_any_number_of_workers_gives_the_same_records(motion):
    words = [*DOORWAY, f"map.motion={motion}"]
    one, two = driven(*words), lme.evaluate(*words, workers=2, runs=1, progress=False)
    pd.testing.assert_frame_equal(one.drop(columns=MEASURED), two.drop(columns=MEASURED), check_exact=True)


def test_killed_and_resumed_it_has_the_records_of_an_uninterrupted_run():
    words = [*DOORWAY, "runs=4", "tracking=none", "executor=serial"]
    assert main.main(["eval", *words, "hydra.run.dir=whole"]) == 0
    log = Path("killed", "parts", "episodes.jsonl")
    process = subprocess.Popen(
        [sys.executable, "-m", "runners.cli.main", "eval", *words, "hydra.run.dir=killed"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + 120
    while (
        not (log.is_file() and log.stat().st_size) and time.monotonic() < deadline and process.poll() is None
    ):
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait(timeout=60)
    assert 0 < log.read_bytes().count(b"\n") < 12
    assert main.main(["eval", "resume=killed"]) == 0
    whole, resumed = (pd.read_parquet(f"{name}/episodes.parquet") for name in ("whole", "killed"))
    pd.testing.assert_frame_equal(
        whole.drop(columns=MEASURED), resumed.drop(columns=MEASURED), check_exact=True
    )


def test_the_table_shows_what_was_measured(capsys):
    assert main.main(["eval", *DOORWAY, "tracking=none", "executor=serial", "hydra.run.dir=run"]) == 0
    table = Path("run/table.md").read_text(encoding="utf-8")
    for header in ("Robot on person", "Person on robot", "Min. distance [m]", "Time against alone"):
        assert header in table
    assert (
        main.main(
            ["eval", "map.worlds=[200]", "runs=1", "tracking=none", "executor=serial", "hydra.run.dir=static"]
        )
        == 0
    )
    assert "person" not in Path("static/table.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("group", "option"), [("filter", "stopping"), ("crowd", "orca")])
def test_runs_with_and_without_a_part_are_rows_of_their_own(capsys, group, option):
    usual = ["map.worlds=[200]", "runs=1", "tracking=none", "executor=serial", "map.time_limit=3"]
    assert main.main(["eval", "-m", *usual, f"{group}=none,{option}", "hydra.sweep.dir=swept"]) == 0
    capsys.readouterr()
    assert main.main(["table", "swept", "--format", "md"]) == 0
    head, _, *rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    place = [cell.strip() for cell in head.split("|")].index(group.capitalize())
    assert [row.split("|")[place].strip() for row in rows if row.startswith("| LME |")] == ["–", option]


def test_the_cold_trial_drives_every_system_with_the_same_draws():
    words = [
        "experiment=cold_trial",
        "map.trial_seed=7",
        "map.worlds=[3,7]",
        "map.subset=static",
        "executor=serial",
    ]
    words += ["system=lme,simple", "tracking=none"]
    assert main.main(["eval", *words, "hydra.sweep.dir=runs"]) == 0
    paths = sorted(Path("runs").rglob("episodes.parquet"))
    one, two = map(pd.read_parquet, paths)
    assert main.main(["eval", *words, "resume=runs"]) == 0
    pd.testing.assert_frame_equal(
        pd.read_parquet(paths[0]), one, check_exact=True
    )  # with its wall_s: not driven again
    drawn = [name for name in one if name.startswith("world_")]
    assert len(drawn) >= 19
    pd.testing.assert_frame_equal(one[drawn], two[drawn], check_exact=True)
    assert set(one["robot"]) == {"drawn"}
