"""Figures of a paper fit a column or a page, and can be read there."""

import re
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from runners.reports.analysis.compare_pictures import PrintSpace, compare_figure
from runners.reports.analysis.compare_runs import compare_runs
from runners.reports.analysis.comparison import chart
from runners.reports.analysis.summary import summarise
from runners.reports.figures.style import COLUMN_IN, PAGE_IN, PicturePage, drawn_on
from runners.reports.paper import figures
from runners.reports.paper.write import Recorded, write_paper
from tests.runners.reports.analysis.test_paired import episodes
from tests.runners.reports.analysis.test_sensitivity_picture import overlapping


def size_in(path):
    """Width and height of a PDF [in]."""
    (box,) = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+) ?\]", path.read_bytes())
    return [float(side) / 72 for side in box]


@pytest.fixture(scope="module")
def drawn(runs, tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper") / "mine"
    write_paper(Recorded.read([runs]), folder)
    return folder / "figures"


@pytest.mark.filterwarnings("ignore:Glyph")
def test_a_chart_is_as_wide_as_a_column_and_a_picture_of_worlds_as_the_page(drawn):
    assert size_in(drawn / "outcomes.pdf")[0] == pytest.approx(COLUMN_IN)
    assert size_in(drawn / "worlds.pdf")[0] == pytest.approx(PAGE_IN, abs=0.01)


def test_text_is_embedded_as_text(drawn):
    """Publishers refuse fonts of type 3."""
    for path in drawn.glob("*.pdf"):
        content = path.read_bytes()
        assert b"/Type0" in content
        assert b"/Type3" not in content


@pytest.mark.filterwarnings("ignore:Glyph")
def test_the_document_has_the_captions_and_the_pictures_have_none(runs, tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(figures, "save", lambda figure, *_: kept.append(figure))
    write_paper(Recorded.read([runs]), tmp_path / "mine")
    assert len(kept) > 1
    assert not any(figure.texts for figure in kept)


@pytest.mark.parametrize("systems", [2, 3, 12])
def test_names_in_a_column_do_not_lie_over_one_another(systems):
    frame = pd.concat(
        [episodes([1, 0, 1], system=f"A system of the number {n} with a long name") for n in range(systems)]
    )
    with drawn_on(PicturePage(width_in=COLUMN_IN)):
        figure = chart(summarise(frame, systems={}))
    figure.draw_without_rendering()
    names = [label.get_window_extent() for label in figure.axes[0].get_yticklabels()]
    assert figure.get_figwidth() == COLUMN_IN
    assert all(above.y0 >= below.y1 for above, below in pairwise(names))
    assert min(box.x0 for box in names) > 0
    assert figure.axes[0].get_window_extent().width > 0.25 * figure.bbox.width


@pytest.mark.parametrize(("systems", "worlds"), [(2, 60), (5, 2000)])
def test_worlds_that_do_not_fit_a_page_are_left_out_and_the_note_says_so(systems, worlds):
    values = np.linspace(0.0, 0.5, worlds)
    parts = [
        episodes([1] * len(values), system=f"S{n}", run_dir=f"runs/{n}", seed=0, map="barn").assign(
            barn_metric=np.roll(values, n)
        )
        for n in range(systems)
    ]
    (comparison,) = compare_runs(parts)
    figure, note = compare_figure(comparison, PrintSpace(PAGE_IN, figures.TALL_IN))
    figure.draw_without_rendering()
    assert figure.get_figwidth() == PAGE_IN
    assert figure.get_figheight() <= figures.TALL_IN + 0.2
    assert overlapping(figure) == []
    assert not figure.texts
    assert ("worst of 2,000 worlds" in note) == (worlds > 60)
