"""Tab completion: what is offered, and that real shells offer it."""

import os
import shutil
import subprocess
import sys

import pytest

from runners.cli import main
from runners.cli.commands import completion
from tests.places import ROOT

COMMANDS = ("completion", "eval", "table")
JACKALS = "jackal jackal_real"


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("lme ev", ["eval"]),
        ("lme --v", ["--version"]),
        ("lme eval rob", ["robot="]),
        ("lme eval +rob", ["+robot="]),
        ("lme eval see", ["seed="]),
        ("lme eval robot=tur", ["robot=turtlebot2"]),
        ("lme eval   -m  robot=ja", [f"robot={name}" for name in JACKALS.split()]),
        ("lme eval ablation=none,no_mai", ["ablation=none,no_maintenance"]),
        ("lme eval ablation=[no_c_o,no_c_h", ["ablation=[no_c_o,no_c_h"]),
        ("lme eval robot.lidar.nu", ["robot.lidar.num_beams="]),
        ("lme eval planner.k", ["planner.kp=", "planner.kd="]),
        ("lme eval guide=target guide.cand", []),
        ("lme eval weights=pub", ["weights=published"]),
        ("lme eval resume=t", ["resume=true"]),
        ("lme eval --cfg j", ["job"]),
        ("lme eval -i defaults-", ["defaults-tree"]),
        ("lme eval --mul", ["--multirun"]),
        ("lme eval nothing", []),
        ("lme evl x", []),
        ("lme compare --", ["--help", "--into", "--format"]),
        ("lme export RUN --ste", ["--steps"]),
        ("lme table --f", ["--format"]),
        ("lme evl --h", ["--help"]),
    ],
)
def test_a_line_is_completed_with_what_fits(line, offered, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert completion.candidates(line, COMMANDS) == offered


def test_every_group_and_key_is_offered():
    offered = completion.candidates("lme eval ", COMMANDS)
    assert {"robot=", "map=", "guide=", "planner=", "ablation=", "seed=", "runs=", "weights="} <= set(offered)


def test_paths_are_completed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "best").mkdir()
    (tmp_path / "best" / "weights.yaml").write_text("")
    (tmp_path / "best.yaml").write_text("")
    assert completion.candidates("lme eval weights=bes", COMMANDS) == ["weights=best/", "weights=best.yaml"]
    assert completion.candidates("lme eval weights=best/", COMMANDS) == ["weights=best/weights.yaml"]
    assert completion.candidates("lme eval --config-dir b", COMMANDS) == ["best/"]
    assert completion.candidates("lme table be", COMMANDS) == ["best/", "best.yaml"]
    assert completion.candidates("lme table ~no-such-user/", COMMANDS) == []


def test_options_of_ones_own_are_completed(tmp_path):
    (tmp_path / "robot").mkdir()
    (tmp_path / "robot" / "mine.yaml").write_text("v_max: 1.0\n")
    line = f"lme eval --config-dir {tmp_path} robot"
    assert completion.candidates(f"{line}=mi", COMMANDS) == ["robot=mine"]
    assert completion.candidates(f"{line}=mine robot.v", COMMANDS) == ["robot.v_max="]


def test_bash_breaks_words_at_equal_signs():
    line = "lme eval robot=tur"
    assert completion.drop_broken_part(["robot=turtlebot2"], line, " =:") == ["turtlebot2"]
    assert completion.drop_broken_part(["robot=turtlebot2"], line, " ") == ["robot=turtlebot2"]


@pytest.fixture
def environment(tmp_path):
    """PATH with an `lme` that is this checkout's."""
    script = tmp_path / "bin" / "lme"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m runners.cli.main "$@"\n')
    script.chmod(0o755)
    return {**os.environ, "PATH": f"{script.parent}{os.pathsep}{os.environ['PATH']}"}


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash on this machine")
@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("lme ev", "eval"),
        ("lme eval robot=tur", "turtlebot2"),
        ("lme eval robot=ja", JACKALS),
        ("lme eval -m ablation=none,no_mai", "none,no_maintenance"),
    ],
)
def test_bash_completes(line, offered, environment):
    code = f"""
    eval "$(lme completion bash)"
    COMP_WORDBREAKS=' =:'
    complete -p lme >/dev/null || exit 1
    COMP_LINE='{line}'; COMP_POINT=${{#COMP_LINE}}; COMP_WORDS=($COMP_LINE); COMP_CWORD=${{#COMP_WORDS[@]}}
    _lme 2>/dev/null
    echo "${{COMPREPLY[*]}}"
    """
    done = subprocess.run(
        ["bash", "--norc", "-c", code], capture_output=True, text=True, env=environment, timeout=60
    )
    assert done.stdout.strip() == offered


@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh on this machine")
def test_zsh_completes(environment):
    code = """
    compdef() { print "defined $@" }
    compadd() { shift $(( ${@[(i)--]} )); print -r -- "$@" }
    eval "$(lme completion zsh)"
    words=(lme eval robot=tur); CURRENT=3; _lme
    """
    done = subprocess.run(
        ["zsh", "-f", "-c", code], capture_output=True, text=True, env=environment, timeout=60
    )
    assert done.stdout.split() == ["defined", "_lme", "lme", "robot=turtlebot2"]


def test_an_unknown_shell_is_refused():
    with pytest.raises(SystemExit) as caught:
        main.main(["completion", "fishy"])
    assert caught.value.code == 2
