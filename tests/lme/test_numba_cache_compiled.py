"""Whether kernels are compiled is known without asking Numba."""

import os
import shutil
import subprocess
import sys
import time

import pytest

from tests.places import ROOT

DRIVE = """
import numpy as np
from lme.geometry.motion import travelled
from lme.numba_cache import compiled
said = compiled()
travelled(0.0, 0.0, np.ones((2, 3)))
print(said, not travelled.stats.cache_misses, compiled())
"""


@pytest.fixture
def installed(tmp_path):
    """A fresh copy of the packages."""
    for package in ("lme", "runners"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def drive(place, **variables):
    """What is said before a kernel is called, whether it was compiled indeed, and what is said after."""
    environment = {name: text for name, text in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    environment |= {"PYTHONPATH": str(place), **variables}
    command = [sys.executable, "-c", DRIVE]
    done = subprocess.run(command, env=environment, cwd=place, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return [word == "True" for word in done.stdout.split()]


@pytest.mark.parametrize("elsewhere", [False, True])
def test_kernels_are_compiled_once(installed, elsewhere):
    variables = {"NUMBA_CACHE_DIR": str(installed / "cache")} if elsewhere else {}
    assert drive(installed, **variables) == [False, False, True]
    assert drive(installed, **variables) == [True, True, True]


@pytest.mark.parametrize("later_s", [3600, -3600])  # than the index; an update may bring an older file
def test_the_report_agrees_with_numba_on_touched_and_changed_sources(installed, later_s):
    source = installed / "lme" / "geometry" / "motion.py"
    drive(installed)
    now = time.time()
    os.utime(source, (now + later_s, now + later_s))
    said, true, _ = drive(installed)
    assert said == true
    source.write_text(source.read_text(encoding="utf-8") + "\n# changed\n", encoding="utf-8")
    os.utime(source, (now + 2 * later_s, now + 2 * later_s))
    said, true, _ = drive(installed)
    assert said == true == False  # noqa: E712
