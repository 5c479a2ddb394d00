"""`lme learn` from the command line to the weight file: tiny trainings, resumed ones, and what it refuses."""

import csv
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

from lme.inputs.onnx_graph import read_weights
from runners.cli.main import main
from runners.config.command_line import compose
from runners.learning import learn
from tests.composing import last_of_each
from tests.networks import network_file, subgoal_file
from tests.places import ROOT

pytest.importorskip("torch")

SHORT = (
    "validation=2",
    "runs=1",
    "map.worlds=[0,6]",
    "tracking=none",
    *(f"{each}.time_limit=6" for each in ("map", "training.fresh", "training.fresh_hard")),
)
CLONE = (*SHORT, "learner.rounds=2", "learner.episodes=4", "learner.updates=[3,5]", "learner.time_limit=3")
FLEET = (
    *SHORT, "training.fresh_hard.subset=fresh", "learner.robots=4", "learner.worlds=3", "learner.batch=16",
    "learner.warm_up=32", "executor=serial",
)  # fmt: skip
PPO = (*FLEET, "learner=ppo", "learner.horizon=8", "learner.judge_every=64")
SAC = (
    *FLEET,
    "learner=sac",
    "learner.critics_first=2",
    "learner.updates=1",
    "learner.steps=64",
    "learner.judge_every=40",
)
IN_PROCESS = (*CLONE, "executor=serial")
SUBGOALS = (*PPO, "guide=learned_subgoal", "planner=simple", "learner.steps=128")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def curves(run_dir):
    with (run_dir / "curves.csv").open() as file:
        return [{key: float(text) for key, text in row.items()} for row in csv.DictReader(file)]


def without_time(rows):
    timed = ("hours", "cpu_hours", "steps_per_s")
    return [{key: value for key, value in row.items() if key not in timed} for row in rows]


@pytest.fixture(scope="module")
def learned(tmp_path_factory):
    """A finished run."""
    folder = tmp_path_factory.mktemp("learned")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["learn", *IN_PROCESS, "guides={target:0.5,lme:0.5}", "hydra.run.dir=run"]) == 0
    return folder / "run"


def test_a_run_leaves_its_network_card_curves_and_evaluation(learned):
    names = {path.name for path in learned.iterdir()}
    assert names >= {
        "weights.onnx",
        "card.yaml",
        "curves.csv",
        "curves.png",
        "checkpoint.pt",
        "barn",
        "table.md",
    }
    rows = curves(learned)
    assert [row["round"] for row in rows] == [1, 2]
    assert [row["episodes"] for row in rows] == [4, 8]
    assert [row["beta"] for row in rows] == [1.0, 0.5]
    assert rows[0]["steps"] < rows[1]["steps"]
    for row in rows:
        assert row["success"] + row["collision"] + row["timeout"] == pytest.approx(1.0)
        assert row["success"] == pytest.approx((row["success_target"] + row["success_lme"]) / 2)


def test_the_card_says_what_the_network_is(learned):
    card = yaml.safe_load((learned / "card.yaml").read_text())
    assert card["command"].startswith("lme learn validation=2 ")
    assert (card["planner"], card["learner"], card["robot"], card["seed"]) == ("dclp", "clone", "jackal", 0)
    assert card["validation"] == {
        "worlds": 2,
        "guides": ["target", "lme"],
        "best_success": max(row["success"] for row in curves(learned)),
    }
    assert card["held_out"]["barn"]["episodes"] == 2
    assert set(card["versions"]) == {"python", "lme", "numpy", "numba", "torch", "onnxruntime"}


def test_the_network_drives_by_name_and_by_run(learned, monkeypatch):
    monkeypatch.chdir(learned.parent)
    (name,) = (path.stem for path in Path("outputs/weights").glob("*.onnx"))
    assert yaml.safe_load(Path(f"outputs/weights/{name}.card.yaml").read_text())["name"] == name
    words = ["guide=target", "planner=dclp", "map=barn", "sim=fast", *SHORT[1:5], "executor=serial"]
    found = []
    for weights in (name, "run"):
        assert (
            main(
                [
                    "eval",
                    *words[:-2],
                    "executor=serial",
                    f"planner.weights={weights}",
                    f"hydra.run.dir={weights}-eval",
                ]
            )
            == 0
        )
        found.append(pd.read_parquet(f"{weights}-eval/episodes.parquet")[["world", "outcome", "steps"]])
    pd.testing.assert_frame_equal(found[0], found[1])
    pd.testing.assert_frame_equal(
        found[0], pd.read_parquet("run/barn/episodes.parquet")[["world", "outcome", "steps"]]
    )


def test_round_zero_collects_what_the_expert_does(learned):
    """In round 0 the expert drives, so that its commands are the robot's next speeds, limits aside."""
    with np.load(learned / "data" / "round_000.npz") as data:
        state, actions, ends = data["feature_1"], data["actions"], data["outcomes"]
    first = slice(0, int(ends[0, 1]))
    assert len(state) == len(actions) == ends[:, 1].sum()
    speeds, wanted = state[first, 2][1:], 2.0 * actions[first, 0][:-1]  # [m/s]; Jackal's limit is 2 m/s
    assert speeds == pytest.approx(wanted, abs=1e-4)


def killed_and_resumed(words, ready, run_dir="killed", before=None):
    """The curves of a run that was killed as soon as `ready()`, and then resumed. before: takes those at the kill."""
    process = subprocess.Popen(
        [sys.executable, "-m", "runners.cli.main", "learn", *words, f"hydra.run.dir={run_dir}"],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 240
    while time.monotonic() < deadline and process.poll() is None and not ready():
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not Path(run_dir, "card.yaml").exists()
    if before is not None:
        before += curves(Path(run_dir))
    assert main(["learn", f"resume={run_dir}"]) == 0
    return curves(Path(run_dir))


def test_killed_and_resumed_it_ends_as_the_uninterrupted_one(learned):
    words = [*IN_PROCESS, "guides={target:0.5,lme:0.5}"]
    rows = killed_and_resumed(words, lambda: Path("killed/data/round_001.npz").is_file())
    assert without_time(rows) == without_time(curves(learned))
    assert Path("killed/weights.onnx").read_bytes() == (learned / "weights.onnx").read_bytes()


def test_a_finished_run_resumed_adds_nothing(learned, monkeypatch):
    monkeypatch.chdir(learned.parent)
    before = (learned / "checkpoint.pt").read_bytes()
    assert main(["learn", "resume=run"]) == 0
    assert (learned / "checkpoint.pt").read_bytes() == before


def test_learning_continues_from_a_network_with_robots_that_differ():
    network_file(Path("mine.onnx"))
    words = [
        "learner.rounds=1",
        "start=mine.onnx",
        "name=next",
        "robots.v_max=[0.5,2]",
        "robots.length=[0.3,0.6]",
    ]
    assert (
        main(["learn", *last_of_each(*IN_PROCESS, *words), "robots.width=[0.2,0.4]", "hydra.run.dir=run"])
        == 0
    )
    with np.load("run/data/round_000.npz") as data:
        directions, state, ends = data["feature_0"], data["feature_1"], data["outcomes"]
    firsts = np.cumsum([0, *ends[:-1, 1]]).astype(int)
    assert len(set(state[firsts, 4])) == len(set(directions[firsts, 0, 3])) == len(ends)
    assert 0.5 <= state[:, 4].min() <= state[:, 4].max() <= 2.0
    assert 0.15 <= directions[:, :, 3].min() <= directions[:, :, 3].max() <= 0.3
    assert Path("outputs/weights/next.onnx").is_file()
    trained, before = (
        read_weights(Path("run/weights.onnx"), "a network"),
        read_weights(Path("mine.onnx"), "a network"),
    )
    shift = np.abs(trained["dense_1.kernel"] - before["dense_1.kernel"]).max()
    assert 0 < shift < 0.02, "three updates change little"


@pytest.mark.parametrize(
    ("words", "points", "losses"),
    [
        (
            [*PPO, "learner.steps=192", "learner.curriculum.within=[11]"],
            [0, 64, 128, 192],
            ["loss_policy", "loss_value", "kl"],
        ),
        ([*SAC, "robots.v_max=[0.5,2]"], [0, 40, 64], ["loss_policy", "loss_value", "entropy"]),
    ],
    ids=["ppo", "sac"],
)
def test_reinforcement_from_a_network(words, points, losses):
    network_file(Path("mine.onnx"))
    assert main(["learn", *words, "start=mine.onnx", "hydra.run.dir=run"]) == 0
    rows = curves(Path("run"))
    assert [row["steps"] for row in rows] == points
    assert all(np.isfinite(rows[-1][name]) for name in (*losses, "steps_per_s"))
    trained, before = (
        read_weights(Path("run/network.onnx"), "a network"),
        read_weights(Path("mine.onnx"), "a network"),
    )
    assert 0 < np.abs(trained["dense_1.kernel"] - before["dense_1.kernel"]).max() < 0.05
    card = yaml.safe_load(Path("run/card.yaml").read_text())
    assert card["last"]["steps"] == points[-1]
    assert "barn" in card["held_out"]
    assert Path("run/curves.png").stat().st_size > 10_000


@pytest.mark.parametrize("planner", ["simple", "dclp"])
def test_a_guide_learns_subgoals_for_a_planner(planner, capsys):
    subgoal_file(Path("mine.onnx"))
    words = last_of_each(
        *SUBGOALS, f"planner={planner}", "start=mine.onnx", "name=subgoals", "device=cpu", "robot.v_max=1.5"
    )
    assert main(["learn", *words, "hydra.run.dir=run"]) == 0
    rows = curves(Path("run"))
    assert [row["steps"] for row in rows] == [0, 64, 128]
    assert all(np.isfinite(rows[-1][name]) for name in ("loss_policy", "loss_value", "kl", "steps_per_s"))
    trained, before = (read_weights(Path(name), "a network") for name in ("run/network.onnx", "mine.onnx"))
    assert 0 < np.abs(trained["output.kernel"] - before["output.kernel"]).max() < 0.05
    card = yaml.safe_load(Path("run/card.yaml").read_text())
    assert (card["guide"], card["planner"]) == ("learned_subgoal", planner)
    use = f"lme eval guide=learned_subgoal planner={planner} robot.v_max=1.5 sim=fast guide.weights=subgoals"
    assert f"use it with: {use}\n" in capsys.readouterr().out
    assert Path("run/card.yaml").read_text().startswith(f"# Written by lme learn; use with: {use}\n")
    assert "barn" in card["held_out"]
    words = ["sim=fast", "guide=learned_subgoal", f"planner={planner}", "guide.weights=subgoals", *SHORT[1:5]]
    assert main(["eval", *words, "executor=serial", "hydra.run.dir=eval"]) == 0
    columns = ["world", "outcome", "steps"]
    again = (pd.read_parquet(f"{run}/episodes.parquet")[columns] for run in ("eval", "run/barn"))
    pd.testing.assert_frame_equal(*again)


@pytest.mark.slow  # cloning, killed above, continues from the same kind of checkpoint
def test_reinforcement_killed_and_resumed_ends_with_its_steps():
    def ready():
        file = Path("killed/curves.csv")
        return file.is_file() and len(file.read_text().splitlines()) > 2

    before = []
    rows = killed_and_resumed([*PPO, "learner.steps=256"], ready, before=before)
    assert [row["steps"] for row in rows] == [0, 64, 128, 192, 256]
    np.testing.assert_equal(without_time(rows)[:2], without_time(before)[:2])  # which takes NaN for equal
    assert rows[-1]["episodes"] >= before[-1]["episodes"]
    assert all(np.diff([row[key] for row in rows]).min() > 0 for key in ("hours", "cpu_hours"))


@pytest.mark.parametrize(
    "words",
    [
        ["planner=dwa"],
        ["planner._target_={}"],
        ["planner.weights=x"],
        ["start=nowhere"],
        ["learner=clonee"],
        ["learner.rounds=0"],
        ["learner.updates=[5]"],
        ["learner.beta=2"],
        ["learner.expert.planner=dwaa"],
        ["learner.expert.guide=none"],
        ["learner.expert.settings={claerance:1}"],
        ["guides={targt:1}"],
        ["guides={target:0}"],
        ["robots.v_max=[2]"],
        ["robots.length=[1,2]"],
        ["planner=dclp_barn", "robots.v_max=[1,2]"],
        ["first_world=3"],
        ["training.fresh.subset=all"],
        ["training.frsh=null"],
        ["training.fresh=null", "training.fresh_hard=null"],
        ["learner=ppo", "sim=physics"],
        ["learner=ppo", "robot=turtlebot2"],
        ["learner=sac", "learner.alpha=-1"],
        ["learner=ppo", "learner.reward.succes=1"],
        ["learner=sac", "guide=learned_subgoal"],
        ["learner=ppo", "guide=learned_subgoal", "guides={lme:1}"],
        ["learner=ppo", "guide=learned_subgoal", "guide.weights=x"],
        ["device=gpu"],
        ["threads=0"],
        ["validation=0"],
        ["name=a/b"],
        ["name=taken"],
        ["resume=nowhere"],
    ],
    ids=" ".join,
)  # fmt: skip
def test_a_mistake_in_learn_is_one_line_and_writes_nothing(words, capsys, says):
    Path("outputs/weights").mkdir(parents=True)
    network_file(Path("outputs/weights/taken.onnx"))
    before = sorted(Path().rglob("*"))
    base = SHORT if words[0].startswith("learner=") else IN_PROCESS  # which has keys of the clone
    assert main(["learn", *last_of_each(*base, *words)]) == 2
    shown = capsys.readouterr().err
    says(shown)
    assert shown.count("\n") == 1
    assert sorted(Path().rglob("*")) == before


def test_a_training_map_can_be_left_out():
    (job,) = compose("learn", [*IN_PROCESS, "training.fresh_hard=null"])
    learn.validate(job)


def test_without_torch_learn_says_what_to_install(monkeypatch, capsys, says):
    monkeypatch.setattr(learn, "find_spec", lambda package: None)
    assert main(["learn", *IN_PROCESS]) == 2
    says(capsys.readouterr().err)


def test_a_gpu_that_is_not_there_is_one_line(monkeypatch, capsys, says):
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert main(["learn", *IN_PROCESS, "device=cuda"]) == 2
    says(capsys.readouterr().err)
    assert not list(Path().iterdir())


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("checkpoint.pt", lambda data: data[: len(data) // 2]),
        ("checkpoint.pt", lambda data: b"no checkpoint"),
        ("data/round_000.npz", lambda data: data[: len(data) // 2]),
    ],
)
def test_a_damaged_file_of_a_training_is_named(learned, name, damage, capsys):
    shutil.copytree(learned, "run")
    file = Path("run") / name
    file.write_bytes(damage(file.read_bytes()))
    assert main(["learn", "resume=run"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len([line for line in said if f"run/{name}: is" in line and "damaged" in line]) == 1
    assert not any("Traceback" in line for line in said)
