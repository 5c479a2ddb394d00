"""Figures can be made while another thread imports IPython, as MLflow does; a full disk is reported as one."""

import errno
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from runners.reports.figures.style import FORMATS, new_figure, save
from tests.places import ROOT

SCRIPT = """
    import sys, threading, time
    sys.path.insert(0, sys.argv[1])
    from runners.reports.figures.style import new_figure
    from matplotlib.backends import backend_agg  # a figure imports it
    other = threading.Thread(target=__import__, args=("IPython",))
    other.start()
    while "IPython" not in sys.modules:
        time.sleep(0.001)
    new_figure(1, 1)
    other.join()
"""


def test_a_figure_waits_for_an_import_of_ipython_in_another_thread(tmp_path):
    slow = tmp_path / "IPython.py"
    slow.write_text("import time\ntime.sleep(0.5)\nversion_info = (9, 0)\n")
    command = [sys.executable, "-c", textwrap.dedent(SCRIPT), str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("ending", FORMATS)
def test_a_full_disk_is_reported_as_one_and_leaves_the_old_picture(tmp_path, monkeypatch, ending):
    path = tmp_path / f"chart.{ending}"
    path.write_text("before")

    def full(self, data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self))

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space left") as caught:
        save(new_figure(1, 1), tmp_path / "chart", [ending])
    assert caught.value.filename == str(path)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "before"
