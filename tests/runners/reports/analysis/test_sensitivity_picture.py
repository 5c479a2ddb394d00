"""The curves over factors: one panel each on one scale, 0 apart from the rest."""

from itertools import combinations

import pytest

from runners.reports.analysis import sensitivity
from runners.reports.analysis.sensitivity import SensitivityStudy
from runners.reports.analysis.study import write
from runners.reports.figures.style import saved_area, symbol
from tests.conf.test_conf import PARAMETERS
from tests.runners.reports.analysis.test_sensitivity import RATES, launched, sweep

__all__ = ["launched"]  # a fixture

EIGHT = {"": 0.9} | {f"{name} × {factor}": 0.8 for name in sorted(PARAMETERS) for factor in (0, 0.25, 4)}


def drawn(records):
    """The figure of records or of success rates, laid out."""
    frame = sweep(records) if isinstance(records, dict) else records
    figure = SensitivityStudy.figure(SensitivityStudy.studies(frame))
    figure.draw_without_rendering()
    return figure


def overlapping(figure):
    """Pairs of texts of a drawn figure that lie over one another, and texts that leave the page."""
    from matplotlib.text import Text

    beyond = {
        label for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) for label in _out_of_view(axis)
    }
    shown = [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]
    texts = [text for text in shown if text not in beyond]
    boxes = {}
    for text in texts:
        owner = text.axes
        if owner is None or owner.get_visible():
            boxes[text] = text.get_window_extent()
    area = saved_area(figure) or figure.bbox_inches
    page = area.transformed(figure.dpi_scale_trans).padded(1)
    outside = [
        text.get_text()
        for text, box in boxes.items()
        if not (page.contains(box.x0, box.y0) and page.contains(box.x1, box.y1))
    ]
    pairs = [
        (one.get_text(), other.get_text())
        for one, other in combinations(boxes, 2)
        if boxes[one].padded(-1).overlaps(boxes[other].padded(-1))
    ]
    return outside + pairs


def _out_of_view(axis):
    """Labels of ticks beyond the ends of an axis, which are never drawn."""
    low, high = sorted(axis.get_view_interval())
    return [tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high]


def test_a_panel_for_each_parameter_all_on_one_scale():
    figure = drawn(EIGHT)
    panels = [axes for axes in figure.axes if axes.get_visible()]
    titles = [axes.get_title() for axes in panels]
    assert titles == [
        f"{symbol(name)}{' = 1.51' if name == 'a_close' else ' = 200' if name == 'd2' else ''}"
        for name in sorted(PARAMETERS)
    ]
    assert len({axes.get_ylim() for axes in panels}) == 1
    assert overlapping(figure) == []


def test_points_stand_at_their_factors_in_doublings():
    figure = drawn(RATES)
    (axes,) = [axes for axes in figure.axes if "close" in axes.get_title()]
    points = {
        line.get_xdata()[0]: line
        for line in axes.lines
        if line.get_marker() == "o" and len(line.get_xdata()) == 1
    }
    assert {x: line.get_ydata()[0] for x, line in points.items() if x > -3} == {-2: 0.8, 0: 0.9, 2: 0.9}
    assert min(points) == -2 - 4 * sensitivity.ZERO_GAP
    assert {x: line.get_markerfacecolor() != "white" for x, line in points.items()} == {
        min(points): True, -2: True, 0: False, 2: False,
    }  # fmt: skip
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0", "¼", "1", "2", "4"]


def test_the_same_records_make_the_same_bytes(tmp_path):
    studies = SensitivityStudy.studies(sweep(RATES))
    paths = write(studies, tmp_path)
    assert [path.name for path in paths][-2:] == ["sensitivity.png", "sensitivity.pdf"]
    before = [path.read_bytes() for path in paths]
    assert [path.read_bytes() for path in write(studies, tmp_path)] == before


@pytest.mark.parametrize(
    "factors", [(0.9, 0.95, 1.05, 1.1), (0, 0.001, 1.05, 1.1, 1000), (0.5, 0.6, 0.7, 0.8)]
)
def test_names_of_factors_that_lie_close_do_not_overlap(factors):
    rates = {"": 0.9} | {f"{name} × {factor}": 0.8 for name in sorted(PARAMETERS)[:4] for factor in factors}
    figure = drawn(rates)
    assert overlapping(figure) == []
    assert "1" in [text.get_text() for text in figure.axes[-1].get_xticklabels()]


def test_the_dashed_line_is_at_factor_one_whatever_was_not_compared():
    """Factor 0 drove other worlds, so nothing is known of how it differs."""
    frame = sweep({"": 0.9, "d1 × 0": 0.1, "d1 × 2": 0.5})
    apart = frame[(frame["scale"] == "d1 × 0") != (frame["world"] < 50)]
    (axes,) = drawn(apart).axes
    (dashed,) = [
        line for line in axes.lines if line.get_linestyle() == "--" and line.get_color() == sensitivity.INK
    ]
    assert list(dashed.get_ydata()) == [1.0, 1.0]


def test_a_single_factor_and_zero_alone_can_be_drawn():
    figure = drawn({"": 0.9, "d1 × 0": 0.1})
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["0", "1"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a_close", r"$a_{\mathrm{close}}$"),
        ("c_o", r"$c_{\mathrm{o}}$"),
        ("d1", r"$d_{\mathrm{1}}$"),
        ("maintenance", "maintenance"),
        ("clearance", "clearance"),
        ("away_from_doors", "away_from_doors"),
        ("a_b_c", "a_b_c"),
    ],
)
def test_names_are_the_papers(name, text):
    assert symbol(name) == text
