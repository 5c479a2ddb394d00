"""The chart of curves: every value of every curve, a panel for each key, and nothing over another."""

import pytest

from runners.reports.analysis.curves import CurveStudy
from runners.reports.analysis.study import write
from tests.runners.reports.analysis.test_curves import BY_LATENCY, BY_SPEED, job, sweep
from tests.runners.reports.analysis.test_sensitivity_picture import overlapping

LONG = [
    part.assign(subset="a subset with a long name", map="a map with a long name", sim="skid")
    for part in BY_LATENCY
]
SYSTEMS = [job(0.3 * k, latency=f"{0.05 * k:g}", system=name) for name in "ABCDEF" for k in (0, 1, 2, 3)]


def drawn(frame):
    figure = CurveStudy.figure(CurveStudy.studies(frame))
    figure.draw_without_rendering()
    return figure


def test_points_are_those_of_the_records():
    figure = drawn(sweep(*BY_LATENCY))
    success, metric = figure.axes
    assert success.lines[0].get_xydata().tolist() == [[0.0, 0.9], [0.05, 0.8], [0.1, 0.5]]
    assert list(metric.lines[0].get_ydata()) == pytest.approx([0.36, 0.32, 0.2])


@pytest.mark.parametrize("jobs", [BY_LATENCY, [*BY_LATENCY, *BY_SPEED[1:]], SYSTEMS, LONG])
def test_nothing_lies_over_another(jobs):
    assert overlapping(drawn(sweep(*jobs))) == []


def test_the_chart_of_curves_is_written(tmp_path):
    paths = write(CurveStudy.studies(sweep(*BY_LATENCY)), tmp_path)
    assert [path.name for path in paths][-2:] == ["curves.png", "curves.pdf"]
    assert all(path.stat().st_size > 1000 for path in paths[-2:])
