"""The chart of a sweep: all rows, or the ends of a long table."""

import math

import pytest

from runners.reports.analysis import comparison
from runners.reports.analysis.comparison import MOST, best_and_worst
from runners.reports.analysis.summary import Row, summarise
from tests.runners.reports.analysis.test_tables import records


def row(number, success, metric=math.nan):
    return Row(
        "LME", {"seed": str(number)}, {"success": (success, math.nan), "barn_metric": (metric, math.nan)}
    )


@pytest.mark.parametrize("count", [1, MOST])
def test_a_short_table_is_drawn_whole_and_in_its_order(count):
    rows = [row(number, (number * 7 % count) / count) for number in range(count)]
    assert best_and_worst(rows) == rows


def test_of_a_long_table_the_best_and_the_worst_are_drawn_in_its_order():
    count = 10 * MOST
    rows = [row(number, 0.5, (number * 7 % count) / count) for number in range(count)]
    drawn = best_and_worst(rows)
    metrics = [one.stats["barn_metric"][0] for one in drawn]
    ranked = sorted(one.stats["barn_metric"][0] for one in rows)
    assert sorted(metrics) == ranked[: MOST // 2] + ranked[-MOST // 2 :]
    assert [int(one.keys["seed"]) for one in drawn] == sorted(int(one.keys["seed"]) for one in drawn)


def test_rows_without_a_metric_rank_by_success_and_empty_rows_last():
    rows = [row(number, number / 100) for number in range(MOST)] + [Row("none", {}, {})]
    drawn = best_and_worst(rows)
    assert len(drawn) == MOST
    assert rows[-1] in drawn
    assert rows[MOST // 2 - 1] not in drawn


def whiskers(axes):
    """(line, low, high) of every whisker."""
    return {
        (line.get_ydata()[0], *line.get_xdata())
        for line in axes.lines
        if len(line.get_xdata()) == 2 and line.get_ydata()[0] == line.get_ydata()[1]
    }


def test_whiskers_are_the_intervals_of_the_table_and_the_notes_say_so(tmp_path, monkeypatch, says):
    drawn = []
    monkeypatch.setattr(comparison, "save", lambda figure, *_: drawn.append(figure) or [])
    frame = records(runs=2)
    rows = summarise(frame)
    ours, published = rows
    comparison.comparison_figure(frame, rows, tmp_path)
    (figure,) = drawn
    outcomes, metric = figure.axes
    assert whiskers(outcomes) == {(0, *ours.interval)}
    assert ours.interval[1] - ours.stats["success"][0] != ours.stats["success"][0] - ours.interval[0]
    assert not math.isnan(published.stats["success"][1])  # its deviation over runs is another thing
    assert whiskers(metric) == set()
    (notes,) = [text.get_text() for text in figure.texts if "Whiskers" in text.get_text()]
    says(notes)


def test_the_heading_says_once_what_all_rows_of_ours_share(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(comparison, "save", lambda figure, *_: drawn.append(figure) or [])
    rows = [
        Row("LME", {"sim": "skid", "seed": str(seed)}, {"success": (0.5, math.nan)}) for seed in range(2)
    ] + [Row("LME (published)", {}, {"success": (0.6, math.nan)}, published_map="barn")]
    comparison.comparison_figure(records(), rows, tmp_path)
    (figure,) = drawn
    assert any(text.get_text().endswith(" · sim skid") for text in figure.texts)
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert names == ["LME – seed 0", "LME – seed 1", "LME (published)"]


def test_a_row_says_that_its_system_sees_nobody(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(comparison, "save", lambda figure, *_: drawn.append(figure) or [])
    rows = [Row("LME", {"people": people}, {"success": (0.5, math.nan)}) for people in ("truth", "none")]
    comparison.comparison_figure(records(), rows, tmp_path)
    names = [label.get_text() for label in drawn[0].axes[0].get_yticklabels()]
    assert names == ["LME", "LME – people none"]
