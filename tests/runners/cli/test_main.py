"""`lme` itself: finding commands, help, errors, exit statuses, and answering at once."""

import io
import os
import re
import shlex
import subprocess
import sys
import warnings

import pytest

from runners.cli import commands, main
from tests.places import ROOT

HEAVY = {"hydra", "omegaconf", "numba", "numpy", "pandas", "scipy", "mlflow", "matplotlib", "optuna", "rich"}
PRIVATE = '''
"""Greet.

More about it.
"""
import errno

from lme.errors import InputError

EXAMPLES = ("lme greet",)


def main(argv):
    if argv == ["wrong"]:
        raise InputError("greet.who is wrong: must be a name")
    if argv == ["stop"]:
        raise KeyboardInterrupt
    if argv == ["divide"]:
        return 1 // 0
    if argv == ["write"]:
        raise OSError(errno.ENOSPC, "No space left on device", "sweep/table.md")
    if argv == ["warn"]:
        import warnings
        warnings.warn("mind the gap")
    return 7
'''


@pytest.fixture
def greet(tmp_path, monkeypatch):
    """One more command: one more file in a commands folder."""
    folder = tmp_path / "commands"
    folder.mkdir()
    (folder / "greet.py").write_text(PRIVATE)
    monkeypatch.setattr(commands, "__path__", [*commands.__path__, str(folder)])
    yield
    sys.modules.pop("runners.cli.commands.greet", None)


def lme(*words, cwd=None):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-m", "runners.cli.main", *words],
        capture_output=True, text=True, env=environment, cwd=cwd, timeout=120,
    )  # fmt: skip


def test_a_command_is_one_file(greet, capsys):
    assert main.main(["greet"]) == 7
    assert main.main([]) == 0
    overview = capsys.readouterr().out
    assert "Greet." in overview
    assert "More about it" not in overview


def test_every_command_has_a_line_and_two_examples():
    for name, path in main.command_files().items():
        assert main.title(path), name
        module = __import__(f"runners.cli.commands.{path.stem}", fromlist=["EXAMPLES"])
        assert len(module.EXAMPLES) >= 2, name
        assert all(example.split()[0] in ("lme", "eval") for example in module.EXAMPLES), name


@pytest.mark.parametrize("words", [[], ["--help"], ["-h"]])
def test_the_overview_names_every_command_and_examples(words, capsys):
    assert main.main(words) == 0
    shown = capsys.readouterr().out
    for name in main.command_files():
        assert f"\n  {name}" in shown
    assert shown.count("  lme ") >= 2


def test_an_unknown_command_names_the_nearest(capsys, says):
    assert main.main(["evl"]) == 2
    shown = capsys.readouterr()
    assert shown.err.count("\n") == 1
    assert "evl" in shown.err
    says(shown.err)
    assert shown.out == ""


def test_an_input_error_is_one_line_and_status_2(greet, capsys, says):
    assert main.main(["greet", "wrong"]) == 2
    says(capsys.readouterr().err)


@pytest.mark.parametrize(
    "line",
    [
        "maps import ~no-such-user/barn worlds",
        "maps build ~no-such-user/drive.bag",
        "weights import dclp ~no-such-user/weights.h5",
        "replay ~no-such-user/drive.bag",
        "eval map=building \"map.paths=['~no-such-user/a.yaml']\" tracking=none",
        "eval planner=onnx \"planner.path='~no-such-user/a.onnx'\" tracking=none",
    ],
)
def test_the_home_folder_of_nobody_is_one_line(line, tmp_path, monkeypatch, capsys, says):
    monkeypatch.chdir(tmp_path)
    words = shlex.split(line)
    assert main.main(words) == 2
    says(capsys.readouterr().err)


def test_a_full_disk_is_one_line(greet, capsys, says):
    """Also outside of a job, as where a sweep ends."""
    assert main.main(["greet", "write"]) == 1
    says(capsys.readouterr().err)


def test_an_interrupt_is_status_130(greet):
    assert main.main(["greet", "stop"]) == 130


def test_a_warning_is_one_line(greet, capsys):
    with pytest.warns(UserWarning, match="mind the gap"):
        main.main(["greet", "warn"])


def test_a_warning_is_shown_once_however_often_the_filters_change():
    with main.plain_warnings():
        first, second = (
            warnings.formatwarning(UserWarning("mind the gap"), UserWarning, "file.py", 3) for _ in range(2)
        )
        assert (first, second) == ("lme: warning: mind the gap\n", "")
        assert "file.py:3" in warnings.formatwarning(RuntimeWarning("x"), RuntimeWarning, "file.py", 3)


def test_another_error_keeps_its_traceback(greet, monkeypatch):
    monkeypatch.setattr(main, "terminable", len)  # which takes one argument
    with pytest.raises(TypeError):
        main.main(["greet"])


def test_an_error_of_a_users_own_code_is_one_line(greet, capsys):
    assert main.main(["greet", "divide"]) == 1
    assert re.fullmatch(
        r"lme greet: \S+greet\.py:\d+: ZeroDivisionError: .* by zero \(.*\)\n", capsys.readouterr().err
    )


def test_version():
    done = lme("--version")
    assert done.returncode == 0
    assert done.stdout.startswith("lme ")


def test_quick_answers_import_nothing_heavy():
    lines = ["", "--help", "eval --help", "--version", "evl", "completion bash", "doctor", "doctor --help",
             "completion words -- 'lme eval robot='"]  # fmt: skip
    code = (
        "import shlex, sys, runners.cli.main as cli\n"
        "for line in sys.argv[1:]:\n"
        "    try: cli.main(shlex.split(line))\n"
        "    except SystemExit: pass\n"
        "    print('\\nLOADED', line, '|', *{name.partition('.')[0] for name in sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *lines], capture_output=True, text=True, cwd=ROOT, timeout=60
    )
    assert "Traceback" not in done.stderr
    loaded = [line.split("|")[1].split() for line in done.stdout.splitlines() if line.startswith("LOADED")]
    assert len(loaded) == len(lines)
    for line, names in zip(lines, loaded, strict=True):
        assert "runners" in names
        assert not HEAVY & set(names), line


def test_eval_help_teaches(capsys):
    assert main.main(["eval", "--help"]) == 0
    shown = capsys.readouterr().out
    for expected in (
        "usage: lme eval", "examples:", "* jackal", "turtlebot2", "no_maintenance", "* barn",
        "seed=0", "draws its random numbers", "runs=3", "weights=published",
        "-m", "resume=true", "--config-dir", "--cfg job",
    ):  # fmt: skip
        assert expected in shown
    examples = shown[shown.index("examples:") : shown.index("groups")]
    assert examples.count("  lme eval") >= 2


def test_help_fits_the_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    main.main(["eval", "--help"])
    table = capsys.readouterr().out.partition("groups")[2]
    assert max(map(len, table.splitlines())) <= 80


def test_a_reader_that_closes_the_pipe_ends_it_quietly():
    """As `lme --help | head -1` does."""
    with subprocess.Popen(
        [sys.executable, "-m", "runners.cli.main", "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("train", "  map@training.fresh: an option of map; * barn"),
        ("train", "  robot@training_robots.fresh: an option of robot; * jackal"),
        ("learn", "  map@training.fresh_hard: an option of map; * barn"),
    ],
)
def test_help_lists_the_options_of_a_group_once(command, line, capsys):
    assert main.main([command, "--help"]) == 0
    said = capsys.readouterr().out
    assert line in said.splitlines()
    assert "none yet" not in said


def run_in_shell(redirected, **environment):
    """`lme --help` in a shell; its status and what it says on standard error."""
    command = f"{shlex.quote(sys.executable)} -m runners.cli.main --help {redirected}"
    done = subprocess.run(
        ["sh", "-c", command], cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True
    )
    return done.returncode, done.stdout, done.stderr


def test_a_closed_standard_output_is_one_line():
    said = "lme --help: standard output is closed, so nothing could be shown\n"
    assert run_in_shell(">&-") == (1, "", said)
    assert run_in_shell(">&- 2>&-") == (1, "", "")
    status, shown, _ = run_in_shell("2>&- <&-")
    assert status == 0
    assert "lme" in shown


def test_a_character_that_the_terminal_lacks_is_a_question_mark(greet, monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    assert not main.open_streams()
    print("± Δ")
    stream.flush()
    assert stream.buffer.getvalue() == b"? ?\n"
