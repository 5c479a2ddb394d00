"""Mistakes on the command line of a benchmark: one line, and the exit status 2; what was not named may be absent."""

import os
import subprocess
import sys

import pytest

from tests.places import ROOT

PROGRAMS = sorted(
    path for path in (ROOT / "benchmarks").rglob("*.py") if "__main__" in path.read_text(encoding="utf-8")
)


def ran(folder, *words):
    command = [sys.executable, "-m", *words]
    places = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, cwd=folder, env=places, capture_output=True, text=True, check=False)


@pytest.fixture
def broken(tmp_path):
    """A run whose records are no Parquet file."""
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / "episodes.parquet").write_bytes(b"not a table")
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        ["collisions", "/nosuch"],
        ["collisions", "broken"],
        ["buildings", "nosuch.yaml"],
        ["gazebo", "--log", "nosuch.txt"],
        ["gazebo", "--shared", "nosuch"],
        ["people", "--part", "moving", "--moving", "nosuch.bag"],
        ["people.film", "--shared", "nosuch"],
    ],
    ids=" ".join,
)
def test_a_mistake_is_one_line(broken, words, says):
    done = ran(broken, f"benchmarks.{words[0]}", *words[1:])
    says(done.stderr)
    assert (done.returncode, done.stderr.count("\n"), done.stdout) == (2, 1, "")


def test_an_absent_default_is_skipped_with_the_reason(broken):
    (broken / "here").mkdir()
    done = ran(broken / "here", "benchmarks.gazebo")
    assert done.returncode == 0
    assert "Skipped: ../shared has no barn/dwa_out.txt" in done.stdout


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_every_benchmark_ends_so(path):
    assert path.read_text(encoding="utf-8").endswith('if __name__ == "__main__":\n    run_main(main)\n')
