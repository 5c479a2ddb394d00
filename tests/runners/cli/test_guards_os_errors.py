"""Where nothing can be written, a command ends with one line."""

import os
import resource
import subprocess
import sys

import pytest

from tests.places import ROOT


@pytest.mark.parametrize(
    ("executor", "said"),
    [
        ("process", "no temporary file can be written in '/"),
        ("serial", "output directory outputs/eval/"),
    ],
)
def test_files_of_no_size_at_all_are_one_line(tmp_path, executor, said):
    """As after `ulimit -f 0`."""
    words = ["eval", "map.worlds=[0,1,2]", "runs=1", "tracking=none", f"executor={executor}"]
    done = subprocess.run(
        [sys.executable, "-m", "runners.cli.main", *words],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY)),
    )
    assert done.returncode in (1, 2)
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"lme eval: {said}")
