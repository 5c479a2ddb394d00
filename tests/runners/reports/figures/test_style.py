"""Figures can be made while another thread imports IPython, as MLflow does; a full disk is reported as one."""

import errno
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from runners.reports.figures.style import (
    FORMATS,
    PicturePage,
    drawn_on,
    entitle,
    new_figure,
    save,
    saved_area,
)
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


@pytest.fixture
def chart():
    figure = new_figure(3.5, 1.0)
    figure.subplots().plot([0, 1], label="line")
    figure.legend(loc="outside upper right")
    return figure


def test_long_texts_widen_no_page_and_cover_no_key(chart):
    entitle(chart, "A title of many words " * 8, "a_caption_without_blanks" * 8)
    area = saved_area(chart)
    assert (area.x0, area.x1) == (0.0, 3.5)
    page = area.transformed(chart.dpi_scale_trans)
    boxes = [text.get_window_extent() for text in chart.texts]
    assert all(page.contains(box.x0, box.y0) and page.contains(box.x1, box.y1) for box in boxes)
    assert not any(box.overlaps(chart.legends[0].get_window_extent()) for box in boxes)


@pytest.mark.parametrize(
    ("page", "texts"),
    [
        (PicturePage(), ["own", "title", "note"]),
        (PicturePage(title="mine", caption=""), ["mine"]),
        (PicturePage(title="", caption="$5"), ["\\$5"]),
    ],
)
def test_the_users_texts_replace_those_of_a_picture(chart, page, texts):
    with drawn_on(page):
        entitle(chart, "title", "note", subtitle="own")
    assert [text.get_text() for text in chart.texts] == texts
