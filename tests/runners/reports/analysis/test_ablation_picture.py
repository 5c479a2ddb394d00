"""The chart of the ablations: what stands where, and that it can be read."""

import pytest

from runners.reports.analysis import ablation
from runners.reports.analysis.ablation import AblationStudy
from runners.reports.analysis.study import write
from tests.runners.reports.analysis.test_ablation import AS_THE_PAPER_SAYS, sweep
from tests.runners.reports.analysis.test_sensitivity_picture import overlapping


def drawn(studies):
    """The figure of the studies, laid out."""
    figure = AblationStudy.figure(studies)
    figure.draw_without_rendering()
    return figure


def test_bars_are_the_shares_in_the_papers_order():
    figure = drawn(AblationStudy.studies(sweep(AS_THE_PAPER_SAYS)))
    above, below = figure.axes
    heights = [bar.get_height() for bar in above.patches]
    assert heights[::3] == pytest.approx(list(AS_THE_PAPER_SAYS.values()))
    assert [sum(heights[i : i + 3]) for i in range(0, 24, 3)] == pytest.approx([1.0] * 8)
    labels = [text.get_text() for text in below.get_xticklabels()]
    assert labels[:2] == ["Complete", "No\n$a_{\\mathrm{close}}$"]
    assert labels[-1] == "No\nmaintenance"


def test_whiskers_are_the_intervals_of_the_table():
    studies = AblationStudy.studies(sweep(AS_THE_PAPER_SAYS))
    above = drawn(studies).axes[0]
    whiskers = [tuple(line.get_ydata()) for line in above.lines if line.get_marker() == "_"]
    assert whiskers == [variant.row.interval for variant in studies[0].variants]


def test_markers_are_filled_where_the_difference_exceeds_the_noise():
    rates = {"none": 0.9, "no_c_o": 0.1, "no_c_h": 0.89}
    below = drawn(AblationStudy.studies(sweep(rates))).axes[1]
    markers = {
        round(line.get_ydata()[0], 2): line.get_markerfacecolor()
        for line in below.lines
        if line.get_marker() == "o"
    }
    assert markers == {-0.8: ablation.INK, -0.01: "white"}


@pytest.mark.parametrize("more", [0, 1, 6])
def test_nothing_overlaps(more):
    rates = {**AS_THE_PAPER_SAYS, **{f"no_maintenance+no_{number}": 0.05 for number in range(more)}}
    assert overlapping(drawn(AblationStudy.studies(sweep(rates)))) == []


def test_the_same_records_make_the_same_bytes(tmp_path):
    found = AblationStudy.studies(sweep({"none": 0.9, "no_c_o": 0.1}))
    paths = write(found, tmp_path)
    assert [path.name for path in paths][-2:] == ["ablation.png", "ablation.pdf"]
    before = [path.read_bytes() for path in paths]
    assert [path.read_bytes() for path in write(found, tmp_path)] == before


def test_more_studies_than_a_page_holds_are_mentioned():
    found = AblationStudy.studies(sweep({"none": 0.9, "no_c_o": 0.1})) * (ablation.STUDIES + 2)
    figure = drawn(found)
    assert len(figure.axes) == 2 * ablation.STUDIES
    assert any(text.get_text().endswith("2 more in ablation.md.") for text in figure.texts)
