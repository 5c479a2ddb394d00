"""Sweeps whose jobs submitit runs: in processes of this machine, and in a real Slurm."""

import os
import subprocess
import sys
from types import SimpleNamespace

import pandas as pd
import pytest
from omegaconf import OmegaConf

from runners.cli.hydra_jobs import LauncherError, Submitted
from tests import slurm
from tests.places import ROOT

WORDS = ["map.worlds=[0,3]", "runs=1", "executor=serial", "tracking=none"]
TIMED = ["wall_s", "decision_us_p50", "decision_us_p99"]
LOCAL = Submitted("eval", "out/.submitit/%j")
PLANNER = """
from dataclasses import dataclass
import os, signal
from lme.errors import InputError

@dataclass
class Config:
    ends: str = "well"

class Planner:
    Config = Config

    def __init__(self, config, robot):
        self.ends = config.ends

    def reset(self, rng):
        pass

    def plan(self, observation, guidance):
        if self.ends == "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.ends == "wrong":
            raise InputError("the goal is wrong")
        return 0.5, 0.0
"""


def job(number, status, *overrides):
    """What Hydra gives for a job that submitit ran."""
    config = OmegaConf.create({"hydra": {"job": {"num": number, "id": f"7_{number}"}}})
    return SimpleNamespace(return_value=status, hydra_cfg=config, overrides=overrides)


def test_a_failed_job_is_reported_with_its_log_file(capsys):
    LOCAL.announce(2)
    LOCAL.report_failures([job(0, 0), job(1, 2, "seed=1", "runs=1")])
    assert capsys.readouterr().err.splitlines() == [
        "lme eval: 2 jobs submitted; their output: out/.submitit",
        "lme eval: job 1 failed (seed=1 runs=1): see out/.submitit/7_1/7_1_0_log.err",
    ]


def test_jobs_of_another_launcher_are_not_announced(capsys):
    other = Submitted.of(OmegaConf.create({"hydra": {"launcher": {"_target_": "BasicLauncher"}}}), "eval")
    other.announce(2)
    other.report_failures([job(0, 2)])
    assert capsys.readouterr().err == ""


def test_only_errors_of_submitit_are_explained(says):
    utils = pytest.importorskip("submitit").core.utils
    with (
        says.raises(LauncherError),
        LOCAL.explain_errors(),
    ):
        utils.CommandFunction(["bash", "-c", "echo bash: command not found >&2; exit 1"], verbose=False)()
    with pytest.raises(RuntimeError, match="ours"), LOCAL.explain_errors():
        raise RuntimeError("ours")


def lme(folder, *words, environment=None):
    """`lme` in a process of its own, with what it said."""
    command = [sys.executable, "-m", "runners.cli.main", *words]
    environment = {**(environment or os.environ), "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)


def same_records(one, other):
    frames = [pd.read_parquet(folder / "episodes.parquet").drop(columns=TIMED) for folder in (one, other)]
    pd.testing.assert_frame_equal(*frames)


def check_a_sweep(folder, launcher, environment=None):
    """Two jobs give a table, and records as without the launcher."""
    sweep = ["eval", "-m", *WORDS, "ablation=none,no_c_t"]
    done = lme(folder, *sweep, *launcher, "hydra.sweep.dir=far", environment=environment)
    assert done.returncode == 0, done.stderr
    assert "lme eval: 2 jobs submitted; their output: far/.submitit" in done.stderr
    assert "no_c_t" in done.stdout
    assert lme(folder, *sweep, "hydra.sweep.dir=near").returncode == 0
    for number in "01":
        same_records(folder / "far" / number, folder / "near" / number)


def check_failures(folder, launcher, environment=None):
    """A job that cannot continue is reported at the end, and the other is done. Once mended, the sweep continues."""
    (folder / "my_module.py").write_text(PLANNER)
    ends = ["planner._target_=my_module.Planner", "+planner.ends=well,wrong"]
    failed = lme(
        folder, "eval", "-m", *WORDS, *ends, *launcher, "hydra.sweep.dir=bad", environment=environment
    )
    assert failed.returncode == 2
    (line,) = [line for line in failed.stderr.splitlines() if "job 1 failed" in line]
    assert (folder / line.rpartition("see ")[2]).read_text().endswith("lme eval: the goal is wrong\n")
    assert (folder / "bad" / "0" / "episodes.parquet").is_file()
    (folder / "my_module.py").write_text(PLANNER.replace("raise InputError", "print"))
    assert lme(folder, "eval", "resume=bad", "hydra/launcher=basic").returncode == 0
    assert (folder / "bad" / "1" / "episodes.parquet").is_file()


@pytest.mark.slow
def test_processes_of_this_machine(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    check_a_sweep(tmp_path, ["hydra/launcher=submitit_local"])
    check_failures(tmp_path, ["hydra/launcher=submitit_local"])


@pytest.mark.slow
def test_a_killed_job_is_one_line_and_the_sweep_can_continue(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    (tmp_path / "my_module.py").write_text(PLANNER)
    words = [*WORDS, "planner._target_=my_module.Planner", "+planner.ends=killed,well", "hydra.sweep.dir=cut"]
    killed = lme(tmp_path, "eval", "-m", *words, "hydra/launcher=submitit_local")
    assert killed.returncode == 1
    assert "Traceback" not in killed.stderr
    assert "has not produced any output" in killed.stderr
    assert killed.stderr.splitlines()[-1] == "The whole sweep: lme eval resume=cut"


@pytest.mark.slow
@pytest.mark.skipif(bool(slurm.lacking()), reason=slurm.lacking() or "Slurm")
def test_a_sweep_runs_on_a_real_slurm(tmp_path):
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    launcher = ["hydra/launcher=submitit_slurm", "hydra.launcher.partition=debug"]
    with slurm.running() as environment:
        check_a_sweep(tmp_path, launcher, environment)
        check_failures(tmp_path, launcher, environment)
        nowhere = lme(
            tmp_path,
            "eval",
            "-m",
            *WORDS,
            launcher[0],
            "hydra.launcher.partition=nowhere",
            environment=environment,
        )
    assert nowhere.returncode == 1
    assert "lme eval: sbatch: error: invalid partition specified: nowhere" in nowhere.stderr
    assert "Traceback" not in nowhere.stderr
