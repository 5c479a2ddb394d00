"""Figures can be made while another thread imports IPython, as MLflow does."""

import subprocess
import sys
import textwrap

from tests.places import ROOT

SCRIPT = """
    import sys, threading, time
    sys.path.insert(0, sys.argv[1])
    from runners.figures.parts.style import new_figure
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
