"""Pictures of compared runs: what they show, read back from the axes."""

import numpy as np
import pytest

from runners.reports.analysis import compare_pictures as figures
from runners.reports.analysis.compare_runs import compare_runs
from runners.reports.figures.style import saved_area
from tests.runners.reports.analysis.test_paired import episodes


def study(*metrics):
    """A comparison of runs with these BARN metrics by world."""
    parts = [
        episodes([1] * len(values), runs=2, system=f"S{n}", run_dir=f"runs/{n}", seed=0, map="barn").assign(
            barn_metric=np.repeat(np.asarray(values, dtype=float), 2)
        )
        for n, values in enumerate(metrics)
    ]
    return compare_runs(parts)[0]


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """A function from a comparison to its figure."""
    kept = []
    monkeypatch.setattr(figures, "save", lambda figure, stem, formats: kept.append(figure) or [stem])

    def draw(found):
        figures.compare_figures([found], tmp_path)
        kept[-1].draw_without_rendering()
        return kept[-1]

    return draw


def ticks(axes):
    return [label.get_text() for label in axes.get_xticklabels()]


def test_two_runs_are_a_dot_per_world_and_a_bar_per_difference(drawn):
    scatter, bars = drawn(study([0.5, 0.4, 0.0, 0.5], [0.5, 0.2, 0.5, 0.5])).axes
    dots = [tuple(each.get_offsets()[0]) for each in scatter.collections]
    assert sorted(dots) == [(0.0, 0.5), (0.4, 0.2), (0.5, 0.5)]
    assert [text.get_text() for text in scatter.texts] == ["2 worlds"]
    assert ticks(bars) == ["1", "2"]  # from worst to best
    assert [bar.get_height() for bar in bars.patches] == pytest.approx([-0.2, 0.5])


@pytest.mark.parametrize("here", [0.0, 0.5])
@pytest.mark.parametrize("there", [0.0, 0.5])
def test_labels_of_dots_stay_within_the_axes(drawn, here, there):
    scatter, _ = drawn(study([here] * 9, [there] * 9)).axes
    (label,) = scatter.texts
    box, axes = label.get_window_extent(), scatter.get_window_extent()
    assert (axes.x0, axes.y0) < (box.x0, box.y0)
    assert box.x1 < axes.x1
    assert box.y1 < axes.y1


def test_numbers_of_worlds_do_not_overlap(drawn):
    scatter, _ = drawn(study([0.5] * 5 + [0.1] * 2, [0.48] * 2 + [0.5] * 3 + [0.4] * 2)).axes
    assert sorted(text.get_text() for text in scatter.texts) == ["2 worlds", "3 worlds"]
    one, other = (text.get_window_extent() for text in scatter.texts)
    assert not one.overlaps(other)


def test_the_note_stays_on_the_page(drawn):
    heat = drawn(study([0.5, 0.4, 0.3], [0.5, 0.0, 0.3], [0.5, 0.1, 0.3]))
    pair = drawn(study([0.5], [0.4]))
    for figure in (heat, pair):
        assert all(text.get_window_extent().x1 < figure.bbox.x1 for text in figure.texts)
        assert saved_area(figure).y0 < 0  # the note is below


def test_pictures_of_an_earlier_comparison_are_removed(tmp_path):
    own = tmp_path / "compare_of_mine.png"
    own.touch()
    found = study([0.5], [0.4])
    assert [path.name for path in figures.compare_figures([found, found], tmp_path)] == [
        "compare_1.png", "compare_2.png",
    ]  # fmt: skip
    assert figures.compare_figures([found], tmp_path) == [tmp_path / "compare.png"]
    assert {path.name for path in tmp_path.iterdir()} == {"compare.png", "compare.pdf", own.name}


def test_equal_runs_have_no_bars(drawn, says):
    _, bars = drawn(study([0.5, 0.4], [0.5, 0.4])).axes
    assert not bars.patches
    says(bars.get_xlabel())


def test_only_the_ends_of_many_bars_are_drawn(drawn, says):
    _, bars = drawn(study(np.zeros(100), np.linspace(0.001, 0.5, 100))).axes
    assert ticks(bars) == [str(world) for world in (*range(20), *range(80, 100))]
    says(bars.get_xlabel())


def test_a_heat_map_has_the_worlds_that_differ_from_worst_to_best(drawn, says):
    figure = drawn(study([0.5, 0.5, 0.4, 0.3], [0.5, 0.0, 0.5, 0.3], [0.5, 0.1, 0.2, 0.3]))
    heat, bar = figure.axes
    assert (heat.collections[0].get_cmap().name, bar.get_ylabel()) == ("viridis", "BARN metric")
    assert ticks(heat) == ["1", "2"]
    assert [label.get_text() for label in heat.get_yticklabels()] == ["S0", "S1", "S2"]
    shown = heat.collections[0].get_array().reshape(3, 2)
    np.testing.assert_allclose(shown, [[0.5, 0.4], [0.0, 0.5], [0.1, 0.2]])
    says(figure.texts[-1].get_text())


def test_many_worlds_come_in_bands_and_only_the_worst(drawn, says):
    values = np.linspace(0.0, 0.4, 400)
    figure = drawn(study(values, values + 0.1, values + 0.05))
    *bands, _ = figure.axes
    assert [len(ticks(band)) for band in bands] == [75] * 4
    assert ticks(bands[0])[0] == "0"
    says(figure.texts[-1].get_text())


def test_of_many_runs_the_worst_and_the_best_are_drawn(drawn, monkeypatch, says):
    monkeypatch.setattr(figures, "MOST_RUNS", 6)  # the reference, two worst and three best
    ranks = np.random.default_rng(0).permutation(12)
    figure = drawn(study([0.0], *([rank / 24] for rank in ranks)))
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    ends = np.flatnonzero((ranks < 2) | (ranks >= 9)) + 1
    assert names == ["S0", *(f"S{run}" for run in ends)]
    says(figure.texts[-1].get_text())
