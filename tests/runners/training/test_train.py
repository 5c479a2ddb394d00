"""`lme train` from the command line to the weight file, and what it refuses."""

import contextlib
import csv
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from lme.config.composer import parameters
from lme.config.presets import load_settings
from lme.errors import InputError
from lme.guides.lme.guide import LocalMinimumEscaper
from runners.cli.main import main
from runners.records.launch_record import read_launch
from runners.training.search import JOURNAL
from tests.builders import PUBLISHED, assert_same, escaper, explained, observation, stage
from tests.composing import last_of_each
from tests.places import ROOT
from tests.runners.training.test_report import links

pytestmark = pytest.mark.usefixtures("undrawn")

SMALL = (
    "map=env1",
    "race=null",
    "trials=7",
    "configurations=2",
    "runs=1",
    "map.configurations=2",
    "search.startup=2",
    "tracking=none",
)
IN_PROCESS = (*SMALL, "executor=serial")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def train(*words):
    """Directory of a training run in this process."""
    before = set(Path("outputs/train").glob("*"))
    assert main(["train", *last_of_each(*IN_PROCESS, *words)]) == 0
    (made,) = set(Path("outputs/train").glob("*")) - before or before
    return made


def trials(run_dir):
    return (run_dir / "trials.csv").read_text()


def finished(folder, *words):
    """The directory of a run with two workers, and what it said."""
    said = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(said):
        assert main(["train", *words, "executor.workers=2", "hydra.run.dir=run"]) == 0
    return folder / "run", said.getvalue()


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("trained"), *SMALL)


def test_a_run_leaves_its_study_weights_pictures_and_evaluation(trained):
    run_dir, said = trained
    names = {path.name for path in run_dir.iterdir()}
    assert names >= {"study.journal", "weights.yaml", "trials.csv", "convergence.png"}
    assert names >= {"env1", "table.md", "launch.json"}
    assert "There was no race" in (run_dir / "report.html").read_text()
    assert all(path.is_file() for path in links(run_dir / "report.html"))
    for what in ("the start", "the result"):
        assert f"Now {what}: 2 worlds of env1 that training never saw, 1 run each" in said
    assert "Best of 7 trials" in said


def test_the_weights_are_the_best_trials(trained):
    run_dir, _ = trained
    weights = yaml.safe_load((run_dir / "weights.yaml").read_text())
    rows = list(csv.DictReader((run_dir / "trials.csv").open()))
    best = max(rows, key=lambda row: float(row["reward"]))
    assert [int(row["trial"]) for row in rows] == list(range(7))
    assert weights["trial"] == int(best["trial"])
    assert weights["reward"] == float(best["reward"])
    found = {key.rpartition(".")[2]: float(value) for key, value in best.items() if key.startswith("guide.")}
    assert weights["parameters"] == found
    assert set(found) == set(PUBLISHED)
    expected = {"robot": "stage", "map": "env1", "seed": 0, "trials": 7, "search": "tpe"}
    assert {key: weights[key] for key in expected} == expected
    assert set(weights["versions"]) == {"python", "lme", "numpy", "numba", "optuna"}


def test_the_reward_is_the_papers(trained):
    for row in csv.DictReader((trained[0] / "trials.csv").open()):
        worlds = [key.removeprefix("outcome_") for key in row if key.startswith("outcome_")]
        rewards = [
            1 - int(row[f"steps_{world}"]) / 200 if row[f"outcome_{world}"] == "success" else -0.2
            for world in worlds
        ]
        assert len(worlds) == 2
        assert float(row["reward"]) == pytest.approx(np.mean(rewards), abs=1e-12)


def test_held_out_worlds_are_never_trained_on(trained):
    run_dir, _ = trained
    episodes = pd.read_parquet(run_dir / "env1" / "episodes.parquet")
    weights = yaml.safe_load((run_dir / "weights.yaml").read_text())
    assert set(episodes["world"]) == {0, 1}
    assert not set(episodes["world"]) & set(weights["configurations"])
    entries = map(json.loads, (run_dir / "study.journal").read_text().splitlines())
    attributes = [entry["user_attr"] for entry in entries if "configurations" in entry.get("user_attr", {})]
    trained_on = {tuple(place["start"]) for place in attributes[0]["configurations"]}
    assert len(trained_on) == 2
    held_out = set(zip(episodes["start_x_m"], episodes["start_y_m"], episodes["start_yaw_rad"], strict=True))
    assert not trained_on & held_out
    assert set(episodes["weights"]) == {weights["name"]}


def test_the_weights_are_found_by_path_run_and_name(trained, monkeypatch):
    run_dir, _ = trained
    monkeypatch.chdir(run_dir.parent)
    weights = yaml.safe_load((run_dir / "weights.yaml").read_text())
    for name in ("run", "run/weights.yaml", weights["name"], f"outputs/weights/{weights['name']}.yaml"):
        assert parameters(name, {}) == weights["parameters"]
    made = LocalMinimumEscaper.from_file(run_dir / "weights.yaml", stage(), load_settings("guide/lme"))
    made.reset(np.random.default_rng(0))
    expected = explained(escaper(weights["parameters"]), observation())
    assert_same(explained(made, observation()), expected)


def test_weights_of_one_map_come_with_the_command_that_tries_them_elsewhere(trained):
    run_dir, said = trained
    name = yaml.safe_load((run_dir / "weights.yaml").read_text())["name"]
    assert f"lme eval -m robot=stage sim=fast map=indoor weights=published,{name}" in said


def test_where_no_trial_beats_the_start_it_says_so_and_drives_it_once(capsys):
    run_dir = train("trials=1")
    said = capsys.readouterr().out
    assert "(the start)" in said
    assert "Level: no trial was better than the weights started from (published); keep them" in said
    assert said.count("worlds of env1 that training never saw") == 1
    assert (run_dir / "env1" / "episodes.parquet").is_file()
    assert not (run_dir / "start").exists()
    assert set(pd.read_parquet(run_dir / "env1" / "episodes.parquet")["weights"]) == {"published"}
    written = (run_dir / "weights.yaml").read_text()
    assert written.startswith(
        "# Written by lme train: no trial beat the start, published; use with: lme eval"
    )
    weights = yaml.safe_load(written)
    assert (weights["trial"], weights["parameters"]) == ("start", PUBLISHED)
    assert "keep them" in (run_dir / "report.html").read_text()


def test_training_on_one_map_needs_no_families(capsys):
    run_dir = train("training.env1=null", "training.fresh=null", "training.indoor=null", "trials=1")
    assert (run_dir / "report.html").is_file()
    assert "worse elsewhere" not in capsys.readouterr().out


def test_an_evaluation_with_the_weights_repeats_the_one_that_training_ended_with(trained, monkeypatch):
    run_dir, _ = trained
    monkeypatch.chdir(run_dir.parent)
    words = ["robot=stage", "map=env1", "map.configurations=2", "runs=1", "tracking=none", "executor=serial"]
    assert main(["eval", *words, "weights=run", "hydra.run.dir=again"]) == 0
    columns = ["world", "outcome", "steps", "path_length_m"]
    again = pd.read_parquet("again/episodes.parquet")[columns]
    pd.testing.assert_frame_equal(again, pd.read_parquet("run/env1/episodes.parquet")[columns])


def test_any_number_of_workers_finds_the_same(trained):
    run_dir = train()
    assert trials(run_dir) == trials(trained[0])
    ours, theirs = (yaml.safe_load((path / "weights.yaml").read_text()) for path in (run_dir, trained[0]))
    assert ours == theirs


@pytest.mark.slow  # tests/runners/training/test_study.py kills a study at every byte of its journal
def test_killed_and_resumed_it_ends_as_the_uninterrupted_one(trained):
    command = [sys.executable, "-m", "runners.cli.main", "train"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    words = [*SMALL, "executor.workers=2", "hydra.run.dir=killed"]
    process = subprocess.Popen(
        [*command, *words], env=environment, stderr=subprocess.DEVNULL, start_new_session=True
    )
    journal, deadline = Path("killed/study.journal"), time.monotonic() + 120
    while time.monotonic() < deadline and not (journal.is_file() and b'"scores"' in journal.read_bytes()):
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    left = journal.read_bytes()
    assert not Path("killed/weights.yaml").exists()
    resumed = [*command, "resume=killed", "executor.workers=1"]
    done = subprocess.run(resumed, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert trials(Path("killed")) == trials(trained[0])
    assert journal.read_bytes().startswith(left[: left.rfind(b'"lme:entries"')])
    weights = [yaml.safe_load((path / "weights.yaml").read_text()) for path in (Path("killed"), trained[0])]
    assert weights[0] == weights[1]


def test_a_finished_run_resumed_adds_nothing(trained, monkeypatch):
    run_dir, _ = trained
    monkeypatch.chdir(run_dir.parent)
    before = (run_dir / "study.journal").read_bytes()
    assert main(["train", "resume=run", "executor.workers=1"]) == 0
    assert (run_dir / "study.journal").read_bytes() == before


def test_a_sweep_is_one_table_over_its_studies(capsys):
    assert (
        main(["train", "-m", *last_of_each(*IN_PROCESS, "trials=2"), "seed=0,1", "hydra.sweep.dir=sweep"])
        == 0
    )
    assert Path("sweep/table.md").read_text().count("| LME |") == 2
    rows = [(Path("sweep") / str(job) / "trials.csv").read_text().splitlines()[0] for job in (0, 1)]
    assert rows[0] != rows[1], "another seed trains on other configurations"


def test_table1_trains_once_and_evaluates_both_maps():
    words = [
        f"held_out.{place}_{limit}.configurations=1"
        for place in ("env1", "env2")
        for limit in ("60s", "100s")
    ]
    words += ["trials=1", "held_out.env1.configurations=2", "held_out.env2.configurations=1"]
    run_dir = train("experiment=table1", *words)
    assert [len(pd.read_parquet(run_dir / name / "episodes.parquet")) for name in ("env1", "env2")] == [2, 1]
    table = (run_dir / "table.md").read_text()
    assert "LME (published)" not in table, "the paper has 50 configurations"
    assert "map.configurations" in table
    launches = [read_launch(run_dir / name) for name in ("env1", "env2")]
    assert [launch.changes[0]["map.configurations"] for launch in launches] == [2, 1]
    assert [launch.choices[0]["map"] for launch in launches] == ["env1", "env2"]


def test_a_planner_is_tuned_by_its_own_space(capsys):
    """What is trained is a matter of the space alone."""
    Path("own/space").mkdir(parents=True)
    Path("own/space/gains.yaml").write_text("# Gains\nplanner:\n  kp: {low: 0.5, high: 8.0}\n")
    run_dir = train("guide=tangent_bug", "planner.kp=0.1", "space=gains", "--config-dir", "own", "trials=4")
    weights = yaml.safe_load((run_dir / "weights.yaml").read_text())
    assert weights["parameters"] == {}
    gain = weights["settings"]["planner.kp"]
    assert 0.5 <= gain <= 8.0
    assert (
        f"lme eval guide=tangent_bug robot=stage sim=fast planner=simple planner.kp={gain}"
        in capsys.readouterr().out
    )
    assert not list(Path("outputs/weights").glob("*"))


@pytest.mark.parametrize(
    "words",
    [
        ["trials=0"],
        ["trials=x"],
        ["configurations=0"],
        ["runs=0"],
        ["reward.crash=0.5"],
        ["reward.crsh=0.5"],
        ["reward.max_steps=0"],
        ["search=tpee"],
        ["search.batch=0"],
        ["space.guide.parameters.d1.high=0.001"],
        ["space.guide.parameters.d3={low: 1, high: 2}"],
        ["guide=target", "space=lme"],
        ["training_numbers=[5]"],
        ["training_numbers=[0,2]"],
        ["name=a/b"],
        ["name=published"],
        ["name=taken"],
        ["storage=nonsense"],
        ["weights=broken.yaml"],
        ["resume=nowhere"],
        ["robot=jakal"],
        ["sead=1"],
    ],
    ids=" ".join,
)
def test_a_mistake_in_train_is_one_line_and_writes_nothing(words, capsys, says):
    Path("outputs/weights").mkdir(parents=True)
    Path("outputs/weights/taken.yaml").write_text("study: another\n")
    Path("broken.yaml").write_text("parameters: {a_close: 1}")
    before = sorted(Path().rglob("*"))
    assert main(["train", *last_of_each(*IN_PROCESS, *words)]) == 2
    shown = capsys.readouterr().err
    says(shown)
    assert shown.count("\n") == 1
    assert sorted(Path().rglob("*")) == before


def test_training_numbers_that_the_map_has_not(capsys):
    assert main(["train", "robot=jackal", "map=barn", "executor=serial", "tracking=none"]) == 2
    assert "must be worlds that barn has, such as [0,299]" in capsys.readouterr().err


@pytest.mark.parametrize("search", ["gp", "cmaes"])
def test_a_search_without_its_package_says_what_to_install(search, monkeypatch, capsys, says):
    from runners.training import samplers

    monkeypatch.setattr(samplers, "find_spec", lambda package: None)
    assert main(["train", *SMALL[:6], f"search={search}"]) == 2
    says(capsys.readouterr().err)


def test_another_robot_map_or_space_cannot_be_resumed(trained, monkeypatch, capsys):
    run_dir, _ = trained
    monkeypatch.chdir(run_dir.parent)
    for word, said in (
        ("robot=jackal", "robot.alpha_omega"),
        ("map.name=env2", "map.name: env1 there, env2 now"),
        ("space.guide.parameters.d1.low=0.2", "space.guide.parameters.d1.low: 0.01 there, 0.2 now"),
        ("search.batch=2", "search.batch: 4 there, 2 now"),
    ):
        assert main(["train", "resume=run", word]) == 2
        assert said in capsys.readouterr().err


def test_a_corrupt_journal_is_one_line(trained, capsys, says):
    run_dir = Path(shutil.copytree(trained[0], "run"))
    journal = run_dir / JOURNAL
    lines = journal.read_text().splitlines()
    journal.write_text("\n".join([*lines[:3], "not json", *lines[3:]]) + "\n")
    assert main(["train", f"resume={run_dir}"]) == 2
    says(capsys.readouterr().err.splitlines()[-1])


def test_a_map_that_has_changed_is_refused(capsys):
    drawing = (ROOT / "maps" / "env1" / "shapes.yaml").read_text()
    Path("mine.yaml").write_text(drawing)
    run_dir = train("trials=1", "map=file", "map.path=mine.yaml")
    Path("mine.yaml").write_text("bounds: [0, 0, 10, 10]\n")
    assert main(["train", f"resume={run_dir}"]) == 2
    assert "mine.yaml has changed since the run began" in capsys.readouterr().err


def test_two_processes_do_not_share_a_run(trained, monkeypatch, capsys, says):
    import fcntl

    run_dir, _ = trained
    monkeypatch.chdir(run_dir.parent)
    with (run_dir / "launch.json").open("rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        assert main(["train", "resume=run"]) == 2
    says(capsys.readouterr().err)


RACE = (
    "trials=5", "search.startup=2", "configurations=1", "race.candidates=[3,2]", "race.worlds=[1,2]", "runs=1",
    "training.env1.configurations=2", "training.fresh.count=2", "training.indoor=null", "tracking=none",
)  # fmt: skip


@pytest.fixture(scope="module")
def raced(tmp_path_factory):
    return finished(tmp_path_factory.mktemp("raced"), *RACE)


def test_families_a_race_and_a_verdict(raced):
    run_dir, said = raced
    assert "Training on env1 (stage), fresh (jackal)" in said
    race = pd.read_csv(run_dir / "race.csv")
    assert race.groupby("rung")["worlds"].first().tolist() == [2, 4, 8]
    assert race.groupby("rung").size().le([6, 4, 3]).all()
    assert (race[race["trial"] == "start"].groupby("rung").size() == 1).all()
    weights = yaml.safe_load((run_dir / "weights.yaml").read_text())
    winner = race[race["rung"] == 2].iloc[0]
    assert (str(weights["trial"]), weights["reward"]) == (str(winner["trial"]), winner["reward"])
    assert weights["map"] == "env1+fresh"
    columns = (run_dir / "trials.csv").read_text().splitlines()[0].split(",")
    assert len(set(columns)) == len(columns)
    assert sum(column.startswith("outcome_fresh_") for column in columns) == 1
    assert weights["held_out"]["verdict"] in ("better", "level", "worse")
    start = pd.read_parquet(run_dir / "start" / "fresh" / "episodes.parquet")
    assert set(start["robot"]) == {"jackal"}
    assert set(start["weights"]) == {"published"}
    assert set(start["world"]) == {1000, 1001}
    driven = {json.loads(line)[1] for line in (run_dir / "race.jsonl").read_text().splitlines()}
    assert not driven & {0, 1, 1000, 1001}, "held-out worlds are not raced on"


def test_a_race_on_any_number_of_workers_or_killed_and_resumed_ends_the_same(raced, tmp_path):
    run_dir, _ = raced
    again = tmp_path / "again"
    assert main(["train", *RACE, "executor=serial", f"hydra.run.dir={again}"]) == 0
    names = ("race.csv", "trials.csv", "weights.yaml")
    for name in names:
        assert (again / name).read_bytes() == (run_dir / name).read_bytes()
    lines = (again / "race.jsonl").read_bytes().splitlines(keepends=True)
    (again / "race.jsonl").write_bytes(b"".join(lines[: len(lines) // 2]) + b'[1,2,"suc')
    for name in names:
        (again / name).unlink()
    assert main(["train", f"resume={again}", "executor=serial"]) == 0
    for name in names:
        assert (again / name).read_bytes() == (run_dir / name).read_bytes()


def test_barn_may_be_the_only_family():
    words = ("training.env1=null", "training.indoor=null", "training.fresh.count=2", "race=null", "trials=1")
    words += ("configurations=1", "runs=1", "tracking=none", "executor=serial", "hydra.run.dir=run")
    assert main(["train", *words]) == 0
    assert yaml.safe_load(Path("run/weights.yaml").read_text())["map"] == "fresh"


def test_a_robot_that_is_too_large_for_a_family_is_told_so(capsys):
    words = last_of_each(*RACE, "trials=1", "executor=serial")
    assert main(["train", "+robot=go2", *words, "hydra.run.dir=run"]) == 0
    assert "Not on fresh: too narrow for an outer radius of 0.41 m" in capsys.readouterr().out
    assert yaml.safe_load(Path("run/weights.yaml").read_text())["robot"] == "go2"


# Weight files

GOOD = yaml.safe_dump({"parameters": PUBLISHED})


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("d2: 200.0", ""),
        ("d2: 200.0", "d2: 200.0\n  d3: 1.0"),
        ("d2: 200.0", "d2: -1.0"),
        ("d2: 200.0", "d2: .nan"),
        ("d2: 200.0", "d2: much"),
        ("d2: 200.0", "d2: true"),
        ("d2: 200.0", "d2: 1.0\n  d2: 2.0"),
        ("parameters:", "parametres:"),
        ("parameters:", "parameters: ["),
    ],
)
def test_a_weight_file_that_is_not_right(old, new, says):
    assert old in GOOD
    Path("mine.yaml").write_text(GOOD.replace(old, new))
    for read in (
        lambda: parameters("mine.yaml", {}),
        lambda: LocalMinimumEscaper.from_file("mine.yaml", stage(), load_settings("guide/lme")),
    ):
        with pytest.raises(InputError) as caught:
            read()
        message = str(caught.value)
        assert "mine.yaml" in message
        says(message)
        assert "\n" not in message


def test_weights_that_are_nowhere(capsys, says):
    Path("empty").mkdir()
    with says.raises(InputError):
        parameters("empty", {})
    Path("outputs/weights").mkdir(parents=True)
    Path("outputs/weights/mine.yaml").write_text(GOOD)
    with says.raises(InputError):
        parameters("mnie", {})
    assert parameters("mine", {"c_o": 0.0}) == {**PUBLISHED, "c_o": 0.0}


def test_a_further_criterion_has_a_weight_too():
    Path("mine.yaml").write_text(yaml.safe_dump({"parameters": {**PUBLISHED, "a_left": 1.0}}))
    assert parameters("mine.yaml", {}, ["a_left"])["a_left"] == 1.0
    with pytest.raises(InputError, match="'a_left' is unknown"):
        parameters("mine.yaml", {})


def test_the_advice_drives_the_system_that_was_trained(capsys):
    """With the values found, also elsewhere, and not with those before the training."""
    words = ["system=lme_plus", "robot=turtlebot2", "guide.reach=6"]
    run_dir = train(*words, "guide.margin=0.1", "trials=3", "start_from_config=false")
    text, said = (run_dir / "weights.yaml").read_text(), capsys.readouterr().out
    content = yaml.safe_load(text)
    assert content["settings"]["guide.margin"] != 0.1
    weights = f"weights={content['name']}"
    found = " ".join(f"{key}={value!r}" for key, value in content["settings"].items())
    command = " ".join(["lme eval", *words, "sim=fast", weights, found])
    assert f"use with: {command}\n" in text
    assert f"{command}\n" in said
    elsewhere = "robot=turtlebot2 system=lme_plus guide.reach=6 sim=fast map=indoor"
    assert f"worse elsewhere: lme eval -m {elsewhere} {weights} {found}\n" in said
