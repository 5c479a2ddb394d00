"""Runs for papers."""

import pytest

from tests.composing import jobs_of
from tests.made_runs import write_run

HOSTILE = r"A_b & 50 % #1 $x$ ~ ^ \input{c} Δω ± – µ 中 é [d] -- <e>"
JOBS = (([], {}), (["ablation=no_c_o"], {"ablation": "no_c_o"}), (["robot.v_max=1"], {"system": HOSTILE}))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder of three jobs in the same worlds; the last has a name that LaTeX would read."""
    folder = tmp_path_factory.mktemp("runs")
    with jobs_of("eval", "map=barn", "map.worlds=[200,201]", "sim=fast", "runs=1") as job:
        for number, (words, columns) in enumerate(JOBS):
            write_run(folder / str(number), subset="custom", job=job(*words), **columns)
    return folder
